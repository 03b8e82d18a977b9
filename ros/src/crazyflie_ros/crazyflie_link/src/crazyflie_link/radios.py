"""What cflib's radio driver leaves behind when a dongle fails.

All vehicles of a dongle share one thread of cflib, which ends at an error of the USB device.
Whoever sends through it then waits for ever, and later connections are given the dead thread
again. An attempt to open a dongle that is not there leaves an entry that nobody takes away.
"""

import contextlib

from cflib.crtp.crtpdriver import CRTPDriver
from cflib.crtp.radiodriver import RadioDriver, RadioManager


def forget_dead_radios() -> None:
    """Have cflib open every dongle anew whose thread has ended or that nobody uses."""
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


def release(link: CRTPDriver) -> None:
    """Let the thread of a radio link end, though it may wait for a dead dongle; never blocks."""
    if not isinstance(link, RadioDriver):
        return
    thread, radio = link._thread, link._radio
    if thread is not None:
        thread._sp = True
    if radio is not None:
        radio._rsp_queue.put(None)
