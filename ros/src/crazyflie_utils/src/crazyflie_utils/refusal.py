"""What an algorithm raises, so that a service is answered with the reason."""


class RefusalError(Exception):
    """A command makes no sense now; the text says why. Nothing has changed.

    Raised in the callback of a service, it is the service's error.
    """
