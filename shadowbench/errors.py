"""Errors that a user can cause and mend."""


class InputError(Exception):
    """Invalid input: the command ends with exit code 2."""
