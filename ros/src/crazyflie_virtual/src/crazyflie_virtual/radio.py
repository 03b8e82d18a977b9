"""Model of a radio channel: the time that a Crazyradio needs for each packet; its vehicles.

All vehicles of a channel share it. A packet to one vehicle is acknowledged, and the acknowledgement
contains the vehicle's next packet; a broadcast is not acknowledged.

Sources: nRF24L01+ product specification 1.0 (format of a packet, times); for the dongle the
measurements in bitcraze/crazyradio2-firmware, issues 9 (2.5 ms for the setup requests before a
packet, three of them) and 23 (1370 acknowledged packets a second to several vehicles, when address
and channel come with the packet); for the distance of two broadcasts the serial line in the
vehicle (syslink, 1 Mbit/s).
"""

from dataclasses import dataclass
from random import Random

from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle

BIT_RATE = 2e6  #: bit/s on air, of radio://.../2M.
TURNAROUND = 130e-6  #: Transceiver, from standby or reception to transmission (s).
#: Time of an acknowledged packet with its USB transfers, without setup requests (s).
ROUND_TRIP = 1.0 / 1370
SETUP_REQUEST = 2.5e-3 / 3  #: A USB control transfer that changes address or acknowledgement, s.
#: Interval of two broadcasts (s): 37 bytes of 10 bits on the vehicle's serial line.
BROADCAST_GAP = 0.5e-3
_OVERHEAD_BITS = 8 * (1 + 5 + 2) + 9  #: Preamble, address, check sum; packet control field.


def air_time(data: int) -> float:
    """Return the time on air of a packet with a number of bytes (0 to 32), s."""
    if not 0 <= data <= 32:
        raise ValueError(f"a radio packet has 0 to 32 bytes; got {data}")
    return (_OVERHEAD_BITS + 8 * data) / BIT_RATE


@dataclass
class RadioChannel:
    """The schedule of one dongle on its channel."""

    #: Whether each change of the address or of the acknowledgement is a USB request of its own, as
    #: with the Crazyradio PA, and with cflib 0.1.34 for all. Otherwise they come with the packet
    #: (the Crazyradio 2.0's inline mode).
    has_setup_requests: bool = True
    free: float = 0.0  #: Time at which the dongle becomes free (s).
    busy: float = 0.0  #: Total time for which it has been busy (s).
    #: unicasts, broadcasts: number of packets sent.
    unicasts: int = 0
    broadcasts: int = 0
    _address: int | None = None

    def unicast(self, time: float, address: int, data: int, answer: int) -> float:
        """Send a packet of ``data`` bytes from ``time`` (s) on; return the time of its answer, s.

        The bytes of the answer come with the acknowledgement.
        """
        on_air = 2.0 * TURNAROUND + air_time(data) + air_time(answer)
        self.unicasts += 1
        return self._occupy(time, address, max(ROUND_TRIP, on_air))

    def broadcast(self, time: float, data: int) -> float:
        """Send a packet to all vehicles; return the time of its arrival, s."""
        self.broadcasts += 1
        return self._occupy(time, None, max(BROADCAST_GAP, TURNAROUND + air_time(data)))

    def _occupy(self, time, address, duration):
        if self.has_setup_requests and address != self._address:
            changes_acknowledgement = (address is None) != (self._address is None)
            duration += SETUP_REQUEST * (1 + changes_acknowledgement)
        self._address = address
        self.free = max(self.free, time) + duration
        self.busy += duration
        return self.free


@dataclass(frozen=True)
class Load:
    """Traffic of a channel."""

    vehicles: int
    pose_rate: float  #: Frames of the motion capture, Hz.
    frame: tuple[int, ...]  #: Bytes of each broadcast packet of a frame.
    #: Packets with acknowledgement to each vehicle, Hz: each brings one of its packets.
    polls: float = 20.0
    poll_size: tuple[int, int] = (1, 31)  #: Bytes of the packet, and of the answer.


@dataclass(frozen=True)
class Usage:
    """Utilization and delays of a channel under a load."""

    share: (
        float  #: Fraction of time for which the dongle is busy; above 1 the channel is overloaded.
    )
    #: frame_delay, poll_delay: longest delay of a frame, and of a packet to a vehicle (s).
    frame_delay: float
    poll_delay: float


def usage(load: Load, channel: RadioChannel) -> Usage:
    """Send a load on a channel for 1 s; frames have priority over single packets."""
    frames = [i / load.pose_rate for i in range(round(load.pose_rate))]
    rate = load.polls * load.vehicles
    polls = [(i / rate, i % load.vehicles) for i in range(round(rate))]
    frame_delay = poll_delay = 0.0
    while frames or polls:
        now = max(channel.free, min(frames[:1] + [due for due, _ in polls[:1]]))
        if frames and frames[0] <= now:
            due = frames.pop(0)
            for size in load.frame:
                frame_delay = max(frame_delay, channel.broadcast(now, size) - due)
        else:
            due, vehicle = polls.pop(0)
            poll_delay = max(poll_delay, channel.unicast(now, vehicle, *load.poll_size) - due)
    return Usage(channel.busy, frame_delay, poll_delay)


SPACING = 1.0  #: Distance between two vehicles (m).


class RadioSwarm:
    """Vehicles with the addresses 1, 2, ..., side by side along y.

    Each misses broadcasts with a probability ``loss``. Their clocks are the channel's.
    """

    def __init__(self, vehicles: int, channel: RadioChannel, loss: float = 0.0, seed: int = 0):
        self.channel = channel
        self._loss = loss
        self._random = Random(seed)
        settings = (
            {"address": n, "init/y": SPACING * n, "positioning": "none"}
            for n in range(1, vehicles + 1)
        )
        self.vehicles = [VirtualVehicle(VehicleSettings.from_mapping(each)) for each in settings]

    def broadcast(self, time: float, datagram: bytes) -> dict[int, tuple[float, list[bytes]]]:
        """Send a packet to all from ``time`` (s) on.

        Returns, by address of the vehicles that have received it, the time of arrival (s) and the
        answers.
        """
        arrival = self.channel.broadcast(time, len(datagram))
        received = {}
        for number, vehicle in enumerate(self.vehicles, start=1):
            vehicle.advance_to(arrival)
            if self._random.random() >= self._loss:
                received[number] = (arrival, vehicle.receive(datagram))
        return received
