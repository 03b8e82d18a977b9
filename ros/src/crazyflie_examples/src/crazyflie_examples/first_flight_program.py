"""The command `first_flight`: the protocol with a vehicle, by the driver and then by the LQR."""

import contextlib
import math
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import genpy
import rosgraph
import rospkg
from geometry_msgs.msg import Point, PoseStamped, TransformStamped
from std_msgs.msg import Bool, Float32
from std_srvs.srv import Empty, EmptyRequest, SetBool, SetBoolRequest
from tf2_msgs.msg import TFMessage

from crazyflie_doctor.vehicle import VehicleFacts, examine
from crazyflie_driver.monitors import VARIANCES, VARIANCES_PERIOD_MS, Variances
from crazyflie_driver.msg import GenericLogData
from crazyflie_driver.positioning import ESTIMATOR, KALMAN, MOCAP, SOURCES
from crazyflie_driver.srv import (
    GoTo,
    GoToRequest,
    Land,
    LandRequest,
    Takeoff,
    TakeoffRequest,
    UpdateParams,
    UpdateParamsRequest,
)
from crazyflie_examples.first_flight import HEIGHT, Sample, Stop, fly, report
from crazyflie_link.address import Address
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.errors import CrazyflieError
from crazyflie_link.log import LogBlock
from crazyflie_model.angles import zyx_from_quaternion
from crazyflie_model.supervisor import SupervisorState
from crazyflie_msgs.msg import (
    FilterStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    VehicleStatus,
)
from crazyflie_utils import Parameters, ServiceError, parameter
from crazyflie_utils.main import begin_script
from crazyflie_utils.parameters import model_file, vehicle_model
from crazyflie_utils.parameters.command_line import parse_arguments
from crazyflie_utils.parameters.types import BOOLEAN, FILE, FINITE, FRAME, Text
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL
from crazyflie_utils.terminal import copy_output, waiting
from crazyflie_utils.vectors import stamped

PREFIX = "/crazyflie"  #: Namespace of the driver.
_RELAYED = "first_flight"  #: Frame that the LQR uses: the relayed poses, until they are hidden.
_LIMIT = 60.0  #: Timeout of starts, of services and of ends (s).
_CONVERGENCE_LIMIT = 10.0  #: Timeout of the convergence of the vehicle's Kalman filter (s).
_REACH_LIMIT = 5.0  #: Timeout of reaching a service, whose process may have died (s).
_POLL = 0.1  #: Longest time until a key, a signal or a fault is noticed (s).
_MAX_SILENCE = 1.0  #: Time without poses or log in flight after which the flight ends (s).
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_CARRY_TIME = 4.0  #: Duration of a virtual vehicle's carrying (s).
_DURATION = genpy.Duration(2)  #: Duration of each of the driver's movements.
_HAND = ("handX", "handY", "handZ", "handYaw")


class FirstFlightParameters(Parameters):
    """Options of the command line."""

    positioning: str = parameter(Text(SOURCES), "source of the pose", MOCAP)
    mocap_frame: str = parameter(
        FRAME, "frame of the vehicle in motion capture, which must be running", "HY5/base_link"
    )
    model: str = parameter(VEHICLE_MODEL, "type of the vehicle, or model file", "cf21")
    out: str = parameter(FILE, "folder of the report and the recording", "out/first_flight")
    yes: bool = parameter(
        BOOLEAN, "answer every question with yes: for virtual vehicles only", False
    )


class LiveRig:
    """Moves a vehicle by the driver, or by hw_hover.launch, and records it from ROS.

    All methods block, and raise `Stop` at a key or a signal. The driver is launched once: a new one
    would feed the emergency-stop watchdog too late, and the vehicle would be locked.
    """

    def __init__(self, uri: str, options: FirstFlightParameters, folder: Path):
        self.samples: list[Sample] = []
        self._uri, self._options, self._folder = uri, options, folder
        self._launched: list[subprocess.Popen[str]] = []
        self._signals: list[int] = []
        self.model = vehicle_model.load(options.model)
        self._model_file = options.model  # With the measured thrust of hover, once there is one.
        self._log: tuple[float, ...] = (0.0,) * 6
        self._voltage = math.nan
        self._supervisor: SupervisorState | None = None
        # Stamp of the last pose; arrival of the last log and of the last pose (s).
        self._stamp = self._log_time = self._pose_time = -math.inf
        self._hides = self._is_connected = self._has_controller = False
        self._examined: Crazyflie | None = None  # While the doctor watches it.
        self._end_node: Callable[[], None] = lambda: None
        #: Lands the vehicle; None while it does not fly.
        self._landing: Callable[[], None] | None = None
        is_mocap = options.positioning == MOCAP
        self._frame = options.mocap_frame if is_mocap else f"{PREFIX[1:]}/estimate"

    def begin(self) -> None:
        """Connect to the graph."""
        if not self._wait(rosgraph.is_master_online, _LIMIT, what="until a ROS master answers"):
            raise Stop(f"no ROS master at {rosgraph.get_master_uri()} for {_LIMIT:g} s")
        process, self._end_node = begin_script("first_flight")
        self._handle = handle = process.handle("/first_flight")
        self._tf = handle.publisher("/tf", TFMessage)
        self._external = handle.publisher(f"{PREFIX}/external_pose", PoseStamped)
        self._reference = handle.publisher("/ref", PositionVelocityStateStamped)
        handle.subscribe(f"{PREFIX}/first_flight", GenericLogData, self._on_log)
        handle.subscribe(f"{PREFIX}/battery", Float32, self._on_battery)
        handle.subscribe(f"{PREFIX}/vehicle_status", VehicleStatus, self._on_status)
        handle.subscribe(f"{PREFIX}/connected", Bool, self._on_connected)
        handle.subscribe("/in_flight_filter_status", FilterStatus, self._on_filter_status)
        handle.subscribe("/tf", TFMessage, self._on_tf)
        process.start()

    def _on_log(self, message):
        self._log, self._log_time = message.values, self._handle.time()

    def _on_battery(self, message):
        self._voltage = message.data

    def _on_status(self, message):
        is_known = message.has_supervisor
        self._supervisor = SupervisorState(message.supervisor) if is_known else None

    def _on_connected(self, message):
        self._is_connected = message.data

    def _on_filter_status(self, message):
        self._has_controller = message.has_controller

    def _on_tf(self, message):
        for each in message.transforms:
            if each.child_frame_id == self._frame and not self._hides:
                self._on_pose(each)

    def _on_pose(self, pose):
        place, q = pose.transform.translation, pose.transform.rotation
        yaw = zyx_from_quaternion((q.x, q.y, q.z, q.w))[2]
        m1, m2, m3, m4, gyro, thrust = self._log
        stamp, motors = pose.header.stamp.to_sec(), (m1, m2, m3, m4)
        # On a busy computer poses arrive together, and speeds by their arrival would be wrong.
        if stamp > self._stamp:
            self._stamp, self._pose_time = stamp, self._handle.time()
            self.samples.append(
                Sample(
                    stamp,
                    place.x,
                    place.y,
                    place.z,
                    yaw,
                    math.radians(gyro),
                    self._voltage,
                    motors,
                    thrust,
                )
            )
        self._tf.publish(TFMessage([TransformStamped(pose.header, _RELAYED, pose.transform)]))
        if self._options.positioning == MOCAP:
            external = PoseStamped(header=pose.header)
            external.pose.position, external.pose.orientation = Point(place.x, place.y, place.z), q
            self._external.publish(external)
            if (vehicle := self._examined) is not None:
                # Its link may end at any time.
                with contextlib.suppress(CrazyflieError):
                    vehicle.localization.pose((place.x, place.y, place.z), (q.x, q.y, q.z, q.w))

    # What ends the protocol.

    def note(self, number: int) -> None:
        """Note a signal: the next check ends what is going on, which is nowhere interrupted."""
        self._signals.append(number)

    def _check_signals(self):
        if self._signals:
            name = signal.Signals(self._signals[-1]).name
            self._signals.clear()
            raise Stop(f"ended by {name}")

    def _check(self):
        self._check_signals()
        if any(launched.poll() is not None for launched in self._launched):
            raise Stop(f"the launch has ended; see the logs in {self._folder}")
        if self._landing is None:
            return
        now = self._handle.time()
        for what, last in (
            (f"log of the vehicle on {PREFIX}/first_flight", self._log_time),
            (f"pose in the frame {self._frame}", self._pose_time),
        ):
            if now - last > _MAX_SILENCE:
                raise Stop(f"no {what} has come for {_MAX_SILENCE:g} s in flight")

    def _wait(self, is_over, limit, ends_at_key=True, what="under way"):
        """Wait until a condition holds, or for a time (s); return whether the condition holds."""
        with waiting(what):
            return self._wait_unseen(is_over, limit, ends_at_key)

    def _wait_unseen(self, is_over, limit, ends_at_key):
        end = time.monotonic() + limit
        while not is_over():
            left = end - time.monotonic()
            if left <= 0.0:
                return False
            if not ends_at_key:
                time.sleep(min(left, _POLL))
                self._check_signals()
                continue
            if sys.stdin.isatty():
                if _line(min(left, _POLL)) is not None:
                    raise Stop("ended by the pilot")
            else:
                time.sleep(min(left, _POLL))
            self._check()
        return True

    def ask(self, text: str) -> bool:
        """Ask a person, also in flight; return whether the answer is yes."""
        return self._options.yes or self._confirm(text)

    def _confirm(self, text):
        print(f"{text}\n  Enter for yes, anything else ends: ", end="", flush=True)
        while (answer := _line(_POLL)) is None:
            self._check()
        return answer == b"\n"

    # The rig.

    def examine(self) -> VehicleFacts:
        """Return the facts of the doctor, without the self tests, which spin fast.

        With motion capture the vehicle is sent its poses meanwhile, for its Kalman filter.
        """
        examined: Future[VehicleFacts] = Future()

        def work():
            is_mocap = self._options.positioning == MOCAP
            prepare = self._begin_estimate if is_mocap else lambda _: None
            try:
                examined.set_result(examine(self._uri, prepare=prepare))
            except Exception as error:
                examined.set_exception(error)
            finally:
                self._examined = None

        threading.Thread(target=work, daemon=True).start()
        self._wait(examined.done, math.inf, what="the doctor examines the vehicle")
        return examined.result()

    def _begin_estimate(self, vehicle):
        """Let the vehicle's Kalman filter begin with the poses that come, and converge; blocks."""
        variances = Variances()
        variances.is_logged = {*VARIANCES} <= {*vehicle.log.variables()}
        vehicle.parameters.write(ESTIMATOR, KALMAN)
        self._examined = vehicle
        vehicle.parameters.write("kalman.resetEstimation", 1)
        if variances.is_logged:
            vehicle.add_log_block(
                LogBlock(
                    "converging", VARIANCES_PERIOD_MS, VARIANCES, lambda _, v: variances.add(v)
                )
            )
        end = time.monotonic() + _CONVERGENCE_LIMIT
        # What has not converged then is named by the doctor.
        while (not variances.are_enough or variances.problem()) and time.monotonic() < end:
            time.sleep(_POLL)

    def run(self, duration: float) -> None:
        """Wait for a duration (s)."""
        self._wait(lambda: False, duration)

    def spin(self, motor: int, pwm: int) -> None:
        """Turn one motor for a second, by a separate link."""
        names = [f"motor.m{i}" for i in range(1, 5)]

        def note(_: int, values: tuple[float, ...]) -> None:
            m1, m2, m3, m4 = values
            self.samples.append(Sample(time.monotonic(), 0, 0, 0, 0, 0, 0, (m1, m2, m3, m4)))

        try:
            with Crazyflie(self._uri) as vehicle:
                write = vehicle.parameters.write
                vehicle.add_log_block(LogBlock("motors", 100, tuple(names), note))
                is_armed_here = self._arm(vehicle.supervisor.read, vehicle.supervisor.arm)
                try:
                    write(f"motorPowerSet.m{motor}", pwm)
                    write("motorPowerSet.enable", 1)
                    self.run(1.0)
                finally:
                    write("motorPowerSet.enable", 0)
                    write(f"motorPowerSet.m{motor}", 0)
                    if is_armed_here:
                        vehicle.supervisor.arm(False)
        except CrazyflieError as error:
            raise Stop(str(error)) from None

    def carry(self, x: float, y: float, z: float, yaw: float) -> None:
        """Ask a person to carry the vehicle; a virtual one is moved by its parameters."""
        if not self._launched:
            self._launch("first_flight.launch", f"positioning:={self._options.positioning}")
            self._await_poses()
        name = f"{PREFIX}/virtual/{_HAND[0]}"
        if self._handle.get_param(name, FINITE, math.inf) == math.inf:
            ways = zip((x, y, z), ("forward", "left", "up"), strict=True)
            goal = [f"{way:g} m {name}" for way, name in ways if way]
            goal += [f"turned {yaw:g} degrees to the left"] if yaw else []
            where = f"Carry it from its place: {' '.join(goal)}" if goal else "Put it in its place"
            if not self._confirm(f"{where}; is it there, and still?"):
                raise Stop("ended by the pilot")
            return
        for name, value in zip(_HAND, (x, y, z, yaw), strict=True):
            self._handle.set_param(f"{PREFIX}/virtual/{name}", float(value))
        names = [f"virtual/{name}" for name in _HAND]
        self._call("update_params", UpdateParams, UpdateParamsRequest(names))
        self.run(_CARRY_TIME)

    def driver_takeoff(self, height: float) -> None:
        """Take off by the driver."""
        self._landing = self.driver_land
        goal = self.samples[-1].z + height
        self._call("takeoff", Takeoff, TakeoffRequest(height=goal, duration=_DURATION))
        self.run(2.0)

    def driver_turn(self, yaw: float) -> None:
        """Turn by the driver."""
        request = GoToRequest(relative=True, yaw=math.radians(yaw), duration=_DURATION)
        self._call("go_to", GoTo, request)
        self.run(2.0)

    def driver_land(self) -> None:
        """Land by the driver."""
        self._landing = None
        request = LandRequest(height=0.0, duration=_DURATION)
        self._call("land", Land, request, ends_at_key=False)
        self._wait(lambda: False, 5.0, ends_at_key=False)

    def note_hover(self, pwm: float) -> str:
        """Write a model that hovers at a command (PWM), with which the LQR flies; return words."""
        path = self._folder.resolve() / "model.yaml"
        model_file.save_with_hover(path, self._options.model, pwm)
        self._model_file = str(path)
        return f"hw_hover.launch with model:={path} hovers so"

    def _arm(self, read, arm):
        """Arm a vehicle that does not arm itself, as one with brushless motors; return whether.

        ``read()`` returns its `SupervisorState`; None from firmware that does not report it.
        """
        state = read()
        if state is None or SupervisorState.AUTO_ARMED in state:
            return False
        # One that is armed since its last flight soon disarms itself.
        arm(False)
        known = SupervisorState.ARMED | SupervisorState.CAN_BE_ARMED
        if not self._wait(lambda: read() & known == SupervisorState.CAN_BE_ARMED, _LIMIT):
            raise Stop(f"the vehicle cannot be armed; it reports: {read().words()}")
        arm(True)
        # Brushless motors spin up.
        if not self._wait(lambda: SupervisorState.CAN_FLY in read(), _LIMIT):
            raise Stop(f"the vehicle was armed, and cannot fly; it reports: {read().words()}")
        return True

    def take_off(self) -> None:
        """Launch the hover stack and take off."""
        self._launch(
            "hw_hover.launch",
            "driver:=false",
            f"positioning:={self._options.positioning}",
            f"pose_frame:={_RELAYED}",
            f"takeoff_hover_z:={HEIGHT}",
            f"model:={self._model_file}",
            "rviz:=false",
            "record:=true",
            f"record_folder:={self._folder.resolve()}",
        )
        # Its gains may take seconds to design; the server does not know yet that there is none.
        if not self._wait(
            lambda: self._has_controller, _LIMIT, what="until a controller publishes"
        ):
            raise Stop(
                f"no controller publishes {_LIMIT:g} s after the launch; see the logs in "
                f"{self._folder}"
            )
        self._arm(
            lambda: self._supervisor,
            lambda do_arm: self._call("arm", SetBool, SetBoolRequest(do_arm)),
        )
        self._landing = self.land
        self._call("/takeoff", Empty, EmptyRequest())

    def refer(self, x: float, y: float, z: float) -> None:
        """Publish a reference."""
        state, stamp = PositionVelocityState(x=x, y=y, z=z), self._handle.stamp()
        self._reference.publish(stamped(PositionVelocityStateStamped, stamp, state=state))

    def land(self) -> None:
        """Land by the takeoff server."""
        self._landing = None
        self._call("/land", Empty, EmptyRequest(), ends_at_key=False)
        self._wait(lambda: False, 1.0, ends_at_key=False)

    def hide_poses(self, duration: float) -> None:
        """Relay no poses for a duration (s)."""
        self._hides = True
        try:
            self.run(duration)
        finally:
            # A flight that is ended now also lands by its poses.
            self._hides = False
        self.run(0.1)

    def emergency(self) -> None:
        """Stop the motors for good."""
        self._call("emergency", Empty, EmptyRequest())

    def close(self) -> None:
        """Land, if the vehicle flies, and end the launched processes and the node.

        A signal ends the wait for the landing: the nodes land the vehicle when their launch ends.
        """
        self._signals.clear()
        try:
            if self._landing is not None:
                self._landing()
        except Stop as reason:
            print(f"first_flight: the landing: {reason}", file=sys.stderr)
        finally:
            for launched in reversed(self._launched):
                _end_launch(launched)
            self._end_node()

    def _launch(self, name, *arguments):
        command = ["roslaunch", str(_package() / "launch" / name), f"uri:={self._uri}", *arguments]
        self._launched.append(_start(command, self._folder / f"{Path(name).stem}.log"))

    def _await_poses(self):
        self._is_connected = False
        before = len(self.samples)
        if not self._wait(
            lambda: self._is_connected and len(self.samples) > before + 10,
            _LIMIT,
            what=f"until poses come in the frame {self._frame}",
        ):
            raise Stop(
                f"no pose in the frame {self._frame} within {_LIMIT:g} s of the launch; does "
                "motion capture see the vehicle, and is it connected?"
            )

    def _call(self, name: str, service: Any, request: Any, ends_at_key: bool = True) -> None:
        full = name if name.startswith("/") else f"{PREFIX}/{name}"
        reply = self._handle.call_service(full, service, request, _LIMIT, _REACH_LIMIT)
        self._wait(reply.done, math.inf, ends_at_key)
        try:
            answer = reply.result()
        except ServiceError as error:
            raise Stop(f"{full}: {error}") from None
        if not getattr(answer, "success", True):
            raise Stop(f"{full}: {answer.message}")


def _line(limit: float) -> bytes | None:
    """Return the next line of the keyboard; None if none comes within a time (s)."""
    descriptor = sys.stdin.fileno()
    if not select.select([descriptor], [], [], limit)[0]:
        return None
    # Not by `sys.stdin`: select does not see what that has read ahead.
    line = b""
    while not line.endswith(b"\n") and (byte := os.read(descriptor, 1)):
        line += byte
    return line


def _start(command: list[str], log: Path) -> subprocess.Popen[str]:
    """Start a program, whose output goes to a log; only warnings are shown."""
    launched = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        # In a session of its own: Ctrl-C would end it before the landing.
        text=True, errors="replace", start_new_session=True,
    )  # fmt: skip
    threading.Thread(target=copy_output, args=(launched.stdout, log), daemon=True).start()
    return launched


def _end_launch(launched: subprocess.Popen[str]) -> None:
    """End a roslaunch, whose nodes land a vehicle that flies before they end."""
    launched.send_signal(signal.SIGINT)
    try:
        launched.wait(_LIMIT)
    except subprocess.TimeoutExpired:
        launched.kill()
        print(
            f"first_flight: roslaunch has not ended within {_LIMIT:g} s; its nodes may still run",
            file=sys.stderr,
        )


def _package() -> Path:
    return Path(rospkg.RosPack().get_path("crazyflie_examples"))


def main(arguments: list[str] | None = None) -> int:
    """Do the protocol; return 0 if every step has passed, otherwise 1."""
    given = sys.argv[1:] if arguments is None else arguments
    uri, rest = (given[0], given[1:]) if given and not given[0].startswith("-") else ("", given)
    options = parse_arguments(
        FirstFlightParameters,
        rest,
        "first_flight URI",
        "A first flight, one step at a time; Enter starts each step, any key and Enter end it. "
        "The last output is a report. Exit status: 0 all steps have passed, 1 a step has failed, "
        "2 wrong usage.",
    )
    try:
        Address.parse(uri)
    except CrazyflieError as error:
        print(f"first_flight: {error}", file=sys.stderr)
        return 1
    folder = Path(options.out) / datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
    folder.mkdir(parents=True)
    print(f"first_flight: all output of what is launched is in {folder}; warnings are shown")
    rig = LiveRig(uri, options, folder)
    for number in _SIGNALS:
        signal.signal(number, lambda number, _: rig.note(number))
    core = None
    verdicts = []
    try:
        if not rosgraph.is_master_online():
            port = urlsplit(rosgraph.get_master_uri()).port
            core = _start(["roscore", "-p", str(port)], folder / "roscore.log")
        rig.begin()
        for verdict in fly(rig, rig.ask):
            verdicts.append(verdict)
            print(f"{'passed' if verdict.passed else 'FAILED'}  {verdict.step}: {verdict.text}")
            sys.stdout.flush()
    except Stop as reason:
        print(f"first_flight: {reason}", file=sys.stderr)
    finally:
        try:
            rig.close()
        finally:
            if core is not None:
                core.terminate()
                core.wait()
            path = folder / "report.html"
            path.write_text(report(verdicts, f"First flight of {uri}", str(folder)))
            print(f"the report is in {path}")
    is_done = bool(verdicts) and verdicts[-1].passed and verdicts[-1].step == "emergency"
    return 0 if is_done else 1
