"""Errors of a link, with what the operator can do."""

import difflib


class CrazyflieError(Exception):
    """Base of all errors of this package; the text says what to do."""


class AddressError(CrazyflieError):
    """The address of a vehicle is malformed, or its host is unknown."""


class NoDongleError(CrazyflieError):
    """The Crazyradio is missing, or may not be used."""


class NoAnswerError(CrazyflieError):
    """No answer comes from the address."""


class SetupError(CrazyflieError):
    """The vehicle answers, but the connection could not be set up."""


class NoSafelinkError(SetupError):
    """The vehicle was first heard after cflib had given up to ask for numbered packets."""


class LinkLostError(CrazyflieError):
    """The connection does not exist, or was lost."""


class NoReplyError(CrazyflieError):
    """The vehicle has not replied to a request in time."""


class RefusedError(CrazyflieError):
    """The vehicle has refused a request."""


class AlreadyLandingError(RefusedError):
    """The vehicle has refused to land, since it is landing already."""


class UnknownNameError(CrazyflieError):
    """The vehicle has no log variable or parameter of this name."""


class ValueRangeError(CrazyflieError):
    """A value cannot be sent: it is not finite or out of range."""


UDEV_HINT = (
    "install the udev rule: sudo cp $(rospack find crazyflie_link)/udev/99-crazyflie.rules "
    "/etc/udev/rules.d/ && sudo udevadm control --reload-rules && sudo udevadm trigger, add "
    "yourself to the group plugdev, log in again and plug the dongle in again"
)

#: Lower-case text of an error after which the radio driver continues.
UNANSWERED = "too many packets lost"

_CAUSES = (
    # Text of a driver (lower case), error, advice to the operator.
    (
        ("cannot find a crazyradio", "cannot find radio with serial", "cannot find crazyradio"),
        NoDongleError,
        "no Crazyradio dongle found: plug it in; if `lsusb -d 1915:7777` shows it, " + UDEV_HINT,
    ),
    (
        ("access denied", "insufficient permissions", "permission denied"),
        NoDongleError,
        "no permission to use the USB device: " + UDEV_HINT,
    ),
    (
        ("resource busy",),
        NoDongleError,
        "the USB device is in use by another program: close it (cfclient, another driver?)",
    ),
    (
        (UNANSWERED,),
        NoAnswerError,
        "the radio gets no answer: is the vehicle on and near, and are channel, data rate and "
        "address right? `rosrun crazyflie_tools scan` lists the vehicles in range",
    ),
    (
        ("connection refused",),
        NoAnswerError,
        "nothing listens on this port: is the virtual vehicle running, and is the port right?",
    ),
    (
        ("name or service not known", "temporary failure in name resolution", "gaierror"),
        AddressError,
        "the host name is unknown: use an IP address such as udp://127.0.0.1:19850",
    ),
    (
        ("network is unreachable", "no route to host"),
        NoAnswerError,
        "the host cannot be reached: check the IP address and the network",
    ),
    (
        ("no driver found", "could not open usb", "cannot find a crazyflie"),
        NoAnswerError,
        "no such device: is the vehicle plugged in and on?",
    ),
)


def explain(uri: str, text: str) -> CrazyflieError:
    """Return the error for a text of one of cflib's drivers, which may contain a traceback."""
    lower = text.lower()
    for patterns, error_type, advice in _CAUSES:
        if any(pattern in lower for pattern in patterns):
            return error_type(f"{uri}: {advice}")
    first_line = next(
        (line.strip() for line in text.splitlines() if line.strip()), "no reason given"
    )
    return NoAnswerError(f"{uri}: {first_line}")


def unknown_name(what: str, name: str, known: list[str]) -> UnknownNameError:
    """Return the error for a name that is not in a table, with the names that are near it."""
    near = [other for other in known if other.lower() == name.lower()]
    near = near or difflib.get_close_matches(name, known, n=3, cutoff=0.6)
    group = [other for other in known if other.split(".")[0] == name.split(".")[0]]
    hint = near or group[:3]
    suggestion = f"; did you mean {' or '.join(hint)}?" if hint else ""
    return UnknownNameError(
        f"the vehicle has no {what} {name!r} among its {len(known)}{suggestion}"
    )
