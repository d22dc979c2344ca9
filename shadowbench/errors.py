"""Errors that are the user's to mend."""


class InputError(Exception):
    """Invalid input: the command prints the message, without a traceback, and ends with exit code 2."""
