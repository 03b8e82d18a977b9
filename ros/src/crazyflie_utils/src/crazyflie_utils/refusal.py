"""The exception by which an algorithm refuses a command, with the reason."""


class RefusalError(Exception):
    """A command is not possible now; the text says why. Nothing has changed.

    If the callback of a service raises it, the text is the service's error.
    """
