"""The exceptions by which a command is refused, with the reason."""


class RefusalError(Exception):
    """A command is not possible now; the text says why. Nothing has changed.

    If the callback of a service raises it, the text is the service's error.
    """


class ServiceError(Exception):
    """A service refused or failed; the text is the reason, for the caller."""
