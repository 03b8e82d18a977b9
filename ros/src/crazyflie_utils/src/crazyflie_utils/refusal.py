"""What an algorithm raises, so that its node can answer a service with the reason."""


class RefusalError(Exception):
    """A command makes no sense now; the text says why. Nothing has changed."""
