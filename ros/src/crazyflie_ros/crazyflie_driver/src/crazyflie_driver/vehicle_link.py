"""What the driver reaches outside of its node: a vehicle by its link, and a radio channel."""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from cflib.crazyflie.param import PersistentParamState

from crazyflie_link import errors
from crazyflie_link.address import Address
from crazyflie_link.broadcast import Broadcaster, SharedCommand
from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import CrazyflieError, LinkLostError
from crazyflie_link.link import Link
from crazyflie_link.localization import PackedPoses
from crazyflie_link.supervisor import BROADCAST_STOP
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle
from crazyflie_utils.external import External, Interface

_ERRORS = {
    name: each
    for name, each in vars(errors).items()
    if isinstance(each, type) and issubclass(each, CrazyflieError)
}

#: See `Crazyflie`.
_VEHICLE = Interface(
    parts=frozenset(
        "setpoints high_level trajectories localization lighthouse parameters log "
        "supervisor".split()
    ),
    reads=frozenset("state connection_count restarts sent rssi".split()),
    waits=frozenset(
        [
            *"connect close add_log_block reboot setpoints.send_zero_thrust".split(),
            *"trajectories.upload trajectories.upload_compressed lighthouse.write_file".split(),
            *(f"parameters.{name}" for name in "write store clear stored".split()),
            *(f"supervisor.{name}" for name in "read arm recover wait_for_emergency_stop".split()),
            *(
                f"high_level.{name}"
                for name in (
                    "take_off land land_lower stop go_to spiral start_trajectory set_group_mask "
                    "restore_group_mask"
                ).split()
            ),
        ]
    ),
    views={"guarded": None, "broadcast": None, "dry_run": "dry_run"},
    decode={
        "state": LinkState,
        "supervisor.read": SupervisorState,
        "parameters.stored": lambda values: PersistentParamState(*values),
    },
    errors=_ERRORS,
)


def vehicle_link(handle: NodeHandle, name: str, uri: str, **callbacks: Any) -> Any:
    """Return a `Crazyflie` that connects again, as an `External`; `AddressError`."""
    address = Address.parse(uri)
    vehicle = None if handle.is_replay else Crazyflie(uri, reconnect=True, **callbacks)
    link: Any = External(handle, _VEHICLE, vehicle, name)
    link.address = address
    return link


class _RadioChannel:
    """Packets to all vehicles of a channel."""

    def __init__(self, address: Address, links: Callable[[], Iterable[Link]], *repeats: Any):
        self._broadcaster = Broadcaster(address, links, *repeats)
        self.poses = PackedPoses(self._broadcaster)
        self.close = self._broadcaster.close

    @property
    def sent(self) -> int:
        """Packets that were broadcast."""
        return self._broadcaster.sent

    def stop_motors(self) -> None:
        """Send the emergency stop before all other packets."""
        self._broadcaster.send(BROADCAST_STOP, urgent=True)

    def share(self, vehicles: int) -> SharedCommand:
        """Return a command to a number of vehicles."""
        return SharedCommand(self._broadcaster, vehicles)

    def pack_poses(self, vehicles: int) -> None:
        """Pack the poses of a number of vehicles."""
        self.poses.vehicles = vehicles


_CHANNEL = Interface(
    parts=frozenset(["poses"]), reads=frozenset(["sent"]), waits=frozenset(["close"]),
    views={"share": "shared"},
)  # fmt: skip


def radio_channel(
    handle: NodeHandle, address: Address, vehicles: Iterable[Any], *repeats: Any
) -> Any:
    """Return a `_RadioChannel` as an `External`; ``vehicles`` are those of the channel."""

    def links() -> Iterator[Link]:
        for vehicle in list(vehicles):
            with contextlib.suppress(LinkLostError):
                yield vehicle.crazyflie.target.link()

    channel = None if handle.is_replay else _RadioChannel(address, links, *repeats)
    return External(handle, _CHANNEL, channel, address.channel)
