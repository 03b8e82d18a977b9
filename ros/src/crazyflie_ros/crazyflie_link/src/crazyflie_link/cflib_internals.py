"""The private names of cflib that this package uses, and what its radio driver leaves behind.

All vehicles of a dongle share one thread of cflib, which ends at an error of the USB device.
Every later send through it blocks for ever, and later connections are given the dead thread
again. An attempt to open a dongle that is absent leaves an entry that is never removed.
"""

import contextlib
import importlib
import re
from collections.abc import Iterable
from pathlib import Path

from cflib.crtp.crtpdriver import CRTPDriver
from cflib.crtp.radiodriver import RadioDriver, RadioManager

PRIVATE_NAMES = (
    "cflib.crazyflie:Crazyflie._link_error_cb",
    "cflib.crazyflie:Crazyflie._platform_info_fetched",
    "cflib.crazyflie:Crazyflie._send_lock",
    "cflib.crazyflie.log:Log._err_codes",
    "cflib.crazyflie.mem:_WriteRequest.MAX_DATA_LENGTH",
    "cflib.crtp.radiodriver:RadioDriver._radio",
    "cflib.crtp.radiodriver:RadioDriver._thread",
    "cflib.crtp.radiodriver:RadioManager._lock",
    "cflib.crtp.radiodriver:RadioManager._radios",
    "cflib.crtp.radiodriver:_RadioDriverThread._sp",
    "cflib.crtp.radiodriver:_SharedRadio._lock",
    "cflib.crtp.radiodriver:_SharedRadio._radio",
    "cflib.crtp.radiodriver:_SharedRadio._rsp_queues",
    "cflib.crtp.radiodriver:_SharedRadioInstance._rsp_queue",
)
"""MODULE:CLASS.ATTRIBUTE; an attribute of the class, or one that its constructor sets."""


def check_private_names(names: Iterable[str] = PRIVATE_NAMES) -> None:
    """Raise `ImportError` at the first name that the installed cflib does not have."""
    for name in names:
        module, _, path = name.partition(":")
        class_name, _, attribute = path.partition(".")
        owner = getattr(importlib.import_module(module), class_name, None)
        constructor = getattr(getattr(owner, "__init__", None), "__code__", None)
        set_there = constructor.co_names if constructor is not None else ()
        if not hasattr(owner, attribute) and attribute not in set_there:
            raise ImportError(
                f"cflib has no {name.replace(':', '.')}, which crazyflie_link uses: install the "
                f"version it was tested with, {pinned_version()}"
            )


def pinned_version() -> str:
    """Return the version in ros/requirements.txt, such as "cflib==0.1.34"."""
    for folder in Path(__file__).resolve().parents:
        with contextlib.suppress(OSError):
            text = (folder / "requirements.txt").read_text(encoding="utf-8")
            if found := re.search(r"^cflib==[\w.]+", text, re.MULTILINE):
                return found[0]
    # In an installed workspace.
    return "cflib of the workspace's ros/requirements.txt"


def forget_dead_radios() -> None:
    """Have cflib open every dongle anew whose thread has ended or that has no user."""
    with RadioManager._lock:
        for devid, radio in enumerate(RadioManager._radios):
            if radio is None:
                continue
            if not radio.is_alive():
                RadioManager._radios[devid] = None
                if radio._radio is not None:
                    # The new owner cannot claim the device before. It is dead: what it raises, of
                    # whatever type, is the reason why it is closed.
                    with contextlib.suppress(Exception):
                        radio._radio.close()
                    radio._radio = None
            elif radio._radio is None:
                with radio._lock:
                    radio._rsp_queues.clear()


def release(driver: CRTPDriver) -> None:
    """Let the thread of a radio link end, though a dead dongle may block it; never blocks."""
    if not isinstance(driver, RadioDriver):
        return
    thread, radio = driver._thread, driver._radio
    if thread is not None:
        thread._sp = True
    if radio is not None:
        radio._rsp_queue.put(None)


check_private_names()
