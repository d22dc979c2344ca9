<<<<<<< HEAD
"""Errors that a user can cause and mend."""


class InputError(Exception):
    """Invalid input: the command ends with exit code 2."""
=======
"""Errors that are the user's to mend."""


class InputError(Exception):
    """Invalid input: the command prints the message, without a traceback, and ends with exit code 2."""
>>>>>>> d2843c9839fe35f8ffb38ff0d266927feb9b1926
