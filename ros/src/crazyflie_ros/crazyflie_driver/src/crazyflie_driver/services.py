"""Services of one vehicle, their names, and the firmware parameters that they write."""

import contextlib
import math
from collections.abc import Callable, Collection
from concurrent.futures import wait
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from std_srvs.srv import Empty, SetBool, SetBoolResponse

from crazyflie_driver import srv
from crazyflie_driver.commands import SERVICE_TYPES, CommandedFlight, requested
from crazyflie_driver.flight_commands import FlightCommands
from crazyflie_driver.setpoint_gate import GateEvent
from crazyflie_driver.trajectory_messages import from_message
from crazyflie_driver.vehicle_base import BaseVehicle, Job, awaited
from crazyflie_link.errors import CrazyflieError, LinkLostError
from crazyflie_link.triggers import is_trigger
from crazyflie_model.lights import COLOR_LED_DECKS, wrgb
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle, ParameterError, ServiceError
from crazyflie_utils.parameters.types import FIRMWARE_NUMBER, Converted

#: Period and limit of the wait for a controller that has parameters, s.
CONTROLLER_PERIOD, CONTROLLER_LIMIT = 0.1, 3.0
#: Longest wait for ROS parameters to be read or set (s): without the master, jobs for the vehicle
#: go on.
MASTER_LIMIT = 3.0
#: Namespace, below the vehicle's, of services whose names belong to other nodes.
ASIDE = "driver"
_SHARED = {"takeoff", "land"}  #: Services of controllers, unless they are remapped.
#: Services that are carried out at once; all others are jobs.
_AT_ONCE = {"emergency", "notify_setpoints_stop", "send_packet"}
_UPLOADS = {"upload_trajectory", "upload_compressed_trajectory"}  #: They end before a landing.
_SOLID_COLOR = 7  #: The firmware's ring.effect for a given color.
_XMLRPC_INTEGERS = range(-(2**31), 2**31)

#: Where the estimate begins (m, m, m, rad) when the firmware starts, and after a reset.
_START = frozenset(f"kalman.initial{part}" for part in ("X", "Y", "Z", "Yaw"))
_RESET = "kalman.resetEstimation"


def _instance_of(types: type | tuple[type, ...], words: str) -> Converted:
    def convert(value: Any) -> Any:
        if not isinstance(value, types):
            raise ValueError
        return value

    return Converted(convert, words)


_NAMESPACE = _instance_of(dict, "a namespace")


@dataclass(eq=False)
class ParameterMirror:
    """Copy the firmware's parameters to ROS, as PREFIX/GROUP/NAME, and back; all methods block."""

    _handle: NodeHandle
    _prefix: str
    _crazyflie: Any  # A `Crazyflie`, as an `External`.
    _on_estimate_reset: Callable[[], None] = lambda: None
    _written: dict[str, int | float] = field(default_factory=dict)

    def lost(self) -> dict[str, int | float]:
        """Return what was written, and what a vehicle on a new link has not kept: it was off.

        What triggers an action, such as the self test of the motors, is never part of it.
        """
        known = self._crazyflie.parameters.known
        return {
            name: value
            for name, value in self._written.items()
            if not is_trigger(name) and known(name) != value
        }

    def reapply(self, lost: dict[str, int | float]) -> list[str]:
        """Write parameters again that are `lost`; the vehicle must be on the ground.

        An estimate that has begun elsewhere is reset, if that was asked for before. Returns why
        parameters could not be written; all are tried, unless the link is lost.
        """
        problems = {}
        for name, value in lost.items():
            if problem := self._try(name, value):
                problems[name] = problem
        if self.begins_elsewhere(lost) and not self.begins_elsewhere(problems):
            if problem := self._try(_RESET, 1):
                problems[_RESET] = problem
            else:
                self._on_estimate_reset()
        return [*problems.values()]

    def begins_elsewhere(self, lost: Collection[str]) -> bool:
        """Return whether an estimate has begun at another place than was asked for, and a reset."""
        return _RESET in self._written and not _START.isdisjoint(lost)

    def _try(self, name, value):
        try:
            self._crazyflie.parameters.write(name, value)
        except LinkLostError:
            raise
        except CrazyflieError as error:
            return str(error)
        return ""

    def publish(self) -> None:
        """Set the ROS parameters to the firmware's values; see `MASTER_LIMIT`."""
        groups: dict[str, dict[str, int | float]] = {}
        for name, value in self._crazyflie.parameters.values().items():
            group, _, parameter = name.partition(".")
            groups.setdefault(group, {})[parameter] = _portable(value)
        # Group by group: all in one would take everything else below the prefix away.
        self._set_on_master({f"{self._prefix}/{group}": each for group, each in groups.items()})

    def write(self, names: list[str]) -> None:
        """Write parameters, named GROUP/NAME, with the values of the ROS parameters.

        All are tried, unless the ROS master does not answer (see `MASTER_LIMIT`), and a
        `ServiceError` names those that could not be written; the ROS parameters are then what the
        firmware has confirmed.
        """
        problems = []
        for name in names:
            try:
                known = parsed_name(name)
            except ParameterError as error:
                problems.append(str(error))
                continue
            try:
                self.set(known, self._on_master(known))
            except (CrazyflieError, ParameterError) as error:
                problems.append(str(error))
                self._restore(known)
            except TimeoutError as error:
                problems.append(str(error))
                break
        if problems:
            raise ServiceError("; ".join(problems))

    def set(self, name: str, value: float) -> None:
        """Write a parameter, named GROUP.NAME; the ROS parameter is then what is confirmed."""
        confirmed = self._crazyflie.parameters.write(name, value)
        self._written[name] = confirmed
        if name == _RESET:
            self._on_estimate_reset()
        self._set_on_master({self._full_name(name): _portable(confirmed)})

    def _restore(self, name):
        """Set a ROS parameter to the value that the firmware has, if that is known."""
        with contextlib.suppress(CrazyflieError):
            values = self._crazyflie.parameters.values()
            if name in values:
                self._set_on_master({self._full_name(name): _portable(values[name])})

    def _on_master(self, name):
        # A frozen master never answers; the task that asks it is left behind.
        asked = Job(lambda _: self._handle.get_param(self._full_name(name), FIRMWARE_NUMBER))
        try:
            return awaited(self._handle, asked.start(self._handle.task, "ask-master"), MASTER_LIMIT)
        except TimeoutError:
            raise TimeoutError(
                f"the ROS master has not told the parameter {self._full_name(name)} within "
                f"{MASTER_LIMIT:g} s: is it frozen?"
            ) from None

    def _set_on_master(self, values):
        later = self._handle.set_param_later
        done = [later(name, value) for name, value in values.items()]
        self._handle.outside(wait, done, MASTER_LIMIT)

    def _full_name(self, name):
        return f"{self._prefix}/{name.replace('.', '/')}"


def parsed_name(name: str) -> str:
    """Return GROUP.NAME of a firmware parameter that a caller names; or raise `ParameterError`."""
    group, _, parameter = name.strip("/").replace(".", "/").partition("/")
    if not group or not parameter:
        raise ParameterError(f"{name!r} is not a firmware parameter; expected GROUP/NAME")
    return f"{group}.{parameter}"


def _portable(value):
    # XML-RPC, and so ROS, knows integers of 32 bits only.
    return float(value) if isinstance(value, int) and value not in _XMLRPC_INTEGERS else value


@dataclass(eq=False)
class VehicleServices:
    """Announce a vehicle's services and carry them out.

    Calls that block on the vehicle are jobs, of which landing and stopping supersede earlier ones;
    all others are done at once.

    rosmaster gives a name to the node that registers it last, and callers of the other node get an
    error about md5 sums. A controller in the vehicle's namespace, such as crazyflie_controller, has
    services takeoff and land as well.
    """

    _vehicle: BaseVehicle
    _flight: CommandedFlight
    _commands: FlightCommands
    _mirror: ParameterMirror
    _latch_emergency: Callable[[], None]

    def wait_for_controllers(self) -> None:
        """Wait for the services of controllers that are about to come; blocks.

        Their parameters are set before they start. They may also have been left by controllers that
        ended long ago: therefore the wait has a limit.
        """
        vehicle = self._vehicle
        prefix = vehicle.parameters.prefix
        values = vehicle.handle.get_param(prefix or "/", _NAMESPACE, {})
        controllers = {
            (f"{prefix}/{name}", service)
            for name, below in values.items()
            if isinstance(below, dict) and "PIDs" in below
            for service in _SHARED
        }
        end = vehicle.monotonic() + CONTROLLER_LIMIT
        while controllers and not vehicle.is_closing() and vehicle.monotonic() < end:
            nodes = vehicle.handle.service_nodes()
            controllers -= {(node, name.rpartition("/")[2]) for name, node in nodes.items()}
            if controllers:
                vehicle.sleep(CONTROLLER_PERIOD)

    def advertise(self) -> None:
        """Offer all services that the vehicle has, below `ASIDE` what is another node's; blocks."""
        crazyflie, mirror = self._vehicle.crazyflie, self._mirror
        services: dict[str, tuple[type, Callable[[Job, Any], Any]]] = {
            "emergency": (Empty, self._emergency),
            "notify_setpoints_stop": (
                srv.NotifySetpointsStop,
                lambda _, r: self._commands.notify(r.remainValidMillisecs),
            ),
            "send_packet": (srv.sendPacket, self._send_packet),
            "arm": (SetBool, self._arm),
            "recover": (Empty, self._recover),
            "upload_trajectory": (srv.UploadTrajectory, self._upload),
            "upload_compressed_trajectory": (
                srv.UploadCompressedTrajectory,
                self._upload_compressed,
            ),
            "update_params": (srv.UpdateParams, lambda _, r: mirror.write(r.params)),
            "set_group_mask": (
                srv.SetGroupMask,
                lambda _, r: crazyflie.high_level.set_group_mask(r.groupMask),
            ),
            "set_led_color": (srv.SetLedColor, self._set_led_color),
            "store_params": (srv.UpdateParams, partial(self._for_each, crazyflie.parameters.store)),
            "clear_params": (srv.UpdateParams, partial(self._for_each, crazyflie.parameters.clear)),
            "param_state": (srv.ParamState, self._state),
            "write_lighthouse": (srv.WriteLighthouse, self._write_lighthouse),
        }
        if crazyflie.address.is_radio:
            services["reboot"] = Empty, self._reboot
        callbacks: dict[str, tuple[type, Callable[[Any], Any]]] = {
            name: (kind, partial(self._on_call, name, work))
            for name, (kind, work) in services.items()
        }
        for name, kind in SERVICE_TYPES.items():
            callbacks[name] = kind, partial(self._on_command, name)
        handle, prefix = self._vehicle.handle, self._vehicle.parameters.prefix
        nodes = handle.service_nodes()
        for name, (kind, callback) in callbacks.items():
            free = desired = f"{prefix}/{name}"
            if desired in nodes:
                free = f"{prefix}/{ASIDE}/{name}"
                handle.warn(f"{desired} is a service of {nodes[desired]}: the driver's is {free}")
            handle.advertise_service(free, kind, callback)

    def _on_command(self, name, request):
        return self._commands.send(requested(name, request))

    def _on_call(self, name, work, request):
        if name not in _AT_ONCE:
            is_flight = name in _UPLOADS
            return self._vehicle.jobs.submit(name, lambda job: work(job, request), is_flight)
        try:
            return work(None, request)
        except CrazyflieError as error:
            raise ServiceError(str(error)) from None

    # At once.

    def _emergency(self, *_):
        try:
            self._latch_emergency()
        except CrazyflieError as error:
            text = f"emergency stop may not have arrived, is sent when the link is back: {error}"
            self._vehicle.error(text)
            raise ServiceError(text) from None
        self._vehicle.error(
            "emergency stop; to fly again remove the vehicle, restart it and add it again"
        )

    def _send_packet(self, _, request):
        packet = request.packet
        data = bytes(packet.data)
        if packet.size > len(data):
            raise ServiceError(f"size is {packet.size}; a packet has at most {len(data)} bytes")
        port, channel = packet.header >> 4, packet.header & 3
        self._vehicle.crazyflie.send_packet(port, channel, data[: packet.size])

    # As jobs.

    def _arm(self, _, request):
        vehicle = self._vehicle
        try:
            if request.data:
                vehicle.refuse_after_emergency()
                vehicle.refuse_to_arm_in_stream()
            else:
                vehicle.gate.handle(GateEvent.DISARMED)
            vehicle.crazyflie.supervisor.arm(request.data)
            if request.data:
                vehicle.gate.handle(GateEvent.FLIGHT_CALLED)
            else:
                self._commands.end_stream()
        except (CrazyflieError, ServiceError) as error:
            return SetBoolResponse(False, str(error))
        return SetBoolResponse(True, "armed" if request.data else "disarmed")

    def _upload(self, job, request):
        pieces = [from_message(piece) for piece in request.pieces]
        self._vehicle.crazyflie.trajectories.guarded(job.may_send).upload(
            request.trajectoryId, request.pieceOffset, pieces, job.check
        )

    def _upload_compressed(self, job, request):
        start = (request.start.x, request.start.y, request.start.z, request.startYaw)
        segments = [
            (each.duration.to_sec(), each.x, each.y, each.z, each.yaw) for each in request.segments
        ]
        self._vehicle.crazyflie.trajectories.guarded(job.may_send).upload_compressed(
            request.trajectoryId, request.offset, start, segments, job.check
        )

    def _recover(self, *_):
        self._vehicle.refuse_after_emergency()
        self._vehicle.crazyflie.supervisor.recover()

    def _set_led_color(self, _, request):
        color = request.color
        parts = {"Red": color.r, "Green": color.g, "Blue": color.b}
        for name, value in parts.items():
            # One that is not a number is refused as well.
            if not 0.0 <= value <= 1.0:
                raise ServiceError(f"color: {name.lower()} is {value:g}; expected 0 to 1")
        known = self._vehicle.crazyflie.parameters.known
        decks = [color for deck, color in COLOR_LED_DECKS.items() if known(deck)]
        for name in decks:
            self._mirror.set(name, wrgb(color.r, color.g, color.b))
        if decks:
            return
        for name, value in parts.items():
            self._mirror.set(f"ring.solid{name}", round(255 * value))
        self._mirror.set("ring.effect", _SOLID_COLOR)

    def _state(self, _, request):
        state = self._vehicle.crazyflie.parameters.stored(parsed_name(request.param))
        stored = math.nan if state.stored_value is None else state.stored_value
        return srv.ParamStateResponse(state.is_stored, state.default_value, stored)

    def _write_lighthouse(self, _, request):
        state = self._flight.read()
        if state is None or SupervisorState.FLYING in state:
            words = "unknown" if state is None else state.words()
            raise ServiceError(
                "write_lighthouse moves the vehicle's estimate: expected it on the ground (2 s "
                f"after a landing); its state is: {words}"
            )
        self._vehicle.crazyflie.lighthouse.write_file(
            request.file, self._vehicle.crazyflie.parameters
        )

    def _for_each(self, act, _, request):
        names = [parsed_name(each) for each in request.params]
        for name in names:
            # Before the first one is changed.
            self._vehicle.crazyflie.parameters.check_persistent(name)
        for name in names:
            act(name)

    def _reboot(self, *_):
        try:
            state = self._flight.read()
        except LinkLostError:
            state = None
        if state is None:
            raise ServiceError(
                "no reboot: it is not known whether the vehicle flies, and it would fall; on the "
                "ground, remove the vehicle and call `rosrun crazyflie_tools reboot --uri "
                f"{self._vehicle.parameters.uri}`"
            )
        if state & (SupervisorState.FLYING | SupervisorState.HIGH_LEVEL_ACTIVE):
            raise ServiceError(
                "no reboot: the vehicle flies (until 2 s after a landing it says so) and would "
                f"fall; its state is: {state.words()}"
            )
        self._vehicle.crazyflie.reboot()
