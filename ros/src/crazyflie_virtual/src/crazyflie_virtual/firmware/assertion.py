"""What ends in a restart of the microcontroller."""


class FirmwareAssertionError(Exception):
    """An assertion of the firmware has failed, on a packet that it takes no care of.

    The text says on what.
    """
