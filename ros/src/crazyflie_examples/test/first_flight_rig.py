"""A virtual vehicle and the hover stack without sockets, in a clock moved by hand, as a `Rig`."""

import math
import struct
from collections import deque
from pathlib import Path
from tempfile import TemporaryDirectory

import rospkg
from geometry_msgs.msg import Quaternion as QuaternionMessage
from geometry_msgs.msg import Transform, TransformStamped, Twist, Vector3
from std_msgs.msg import Bool, Float32, Header
from std_srvs.srv import EmptyRequest
from tf2_msgs.msg import TFMessage

from crazyflie_doctor.vehicle import ALL_MOTORS, VehicleFacts
from crazyflie_examples.first_flight import HEIGHT, Sample, Stop
from crazyflie_model.angles import zyx_from_quaternion
from crazyflie_model.supervisor import SupervisorState
from crazyflie_msgs.msg import PositionVelocityStateStamped
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.parameters import vehicle_model
from crazyflie_utils.parameters.model_file import save_with_hover
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.testing.launch_files import composed_nodes, expand
from crazyflie_virtual.crtp import Packet, Port
from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle

PERIOD = 0.01


class FastRig:
    """Faults: ``measure(position, yaw)`` distorts a pose, ``delay`` (s) holds it back.

    ``weak`` is the motor, 1 to 4, whose thrust is 30 % less; further ones are `VehicleSettings`.
    """

    def __init__(self, measure=None, delay=0.0, weak=0, taken_for=None, **settings):
        self.samples = []
        self._measure = measure or (lambda position, yaw: (position, yaw))
        self._delay = delay
        own = VehicleSettings(positioning="none", **settings)
        self.vehicle = VirtualVehicle(own)
        self._type = taken_for or own.model
        self.model = vehicle_model.load(self._type)
        self._folder = TemporaryDirectory()
        self.model_file = None
        self._graph = None
        self._twist = None
        self._poses = deque()
        self._is_hidden = False
        if weak:
            self._weaken(weak)
        self.run(1.0)

    def _weaken(self, motor):
        step = self.vehicle.physics.step

        def weak_step(commands, voltage):
            step(commands._replace(**{f"m{motor}": 0.7 * getattr(commands, f"m{motor}")}), voltage)

        self.vehicle.physics.step = weak_step

    @property
    def _firmware(self):
        return self.vehicle.board.firmware

    def _send(self, port, channel, data):
        return self.vehicle.receive(Packet(port, channel, data).encode())

    # The world.

    def run(self, duration):
        for _ in range(round(duration / PERIOD)):
            self._tick()

    def _tick(self):
        vehicle = self.vehicle
        if self._twist is not None:
            linear = self._twist.linear
            thrust = round(min(max(linear.z, 0.0), 60000.0))
            attitude = (linear.y, -linear.x, self._twist.angular.z, thrust)
            self._send(Port.SETPOINT, 0, struct.pack("<fffH", *attitude))
        vehicle.advance_to(vehicle.time + PERIOD + 1e-9)
        physics, firmware = vehicle.physics, self._firmware
        roll, pitch, yaw = zyx_from_quaternion(physics.quaternion)
        position, measured = self._measure(physics.position, yaw)
        self._poses.append((vehicle.time, position, (roll, pitch, measured)))
        if self._graph is not None:
            self._graph.advance(PERIOD)
            if round(vehicle.time / PERIOD) % 50 == 0:
                self._graph.publish("/crazyflie/connected", Bool(True))
                self._graph.publish("/crazyflie/battery", Float32(firmware.power.voltage))
        while self._poses and vehicle.time - self._poses[0][0] >= self._delay - 1e-9:
            self._see(*self._poses.popleft()[1:])

    def _see(self, position, angles):
        firmware = self._firmware
        motors = tuple(map(float, firmware.stabilizer.commands))
        rate = math.radians(firmware.sensors.gyro_z)
        if self._is_hidden and self.samples:
            position, yaw = self.samples[-1][1:4], self.samples[-1].yaw
        else:
            yaw = angles[2]
        self.samples.append(
            Sample(
                self.vehicle.time,
                *position,
                yaw,
                rate,
                firmware.power.voltage,
                motors,
                firmware.stabilizer.thrust,
            )
        )
        if self._is_hidden:
            return
        half = [0.5 * angle for angle in angles]
        quaternion = _quaternion(*half)
        self._send(Port.LOCALIZATION, 1, struct.pack("<B7f", 8, *position, *quaternion))
        if self._graph is not None:
            header = Header(stamp=self._graph.stamp(), frame_id="world")
            transform = Transform(Vector3(*position), QuaternionMessage(*quaternion))
            message = TransformStamped(header, "crazyflie", transform)
            self._graph.publish("/tf", TFMessage([message]))

    # The actions of a person and of the driver.

    def examine(self):
        deviation = math.sqrt(self._firmware.variance_velocity)
        return VehicleFacts(
            voltage=self._firmware.power.voltage,
            quality=1.0,
            latency=0.004,
            firmware="2026.08",
            deviations=(deviation,) * 3,
            changes=(0.0,) * 3,
            motors=ALL_MOTORS,
            battery_passed=True,
        )

    def spin(self, motor, pwm):
        override, supervisor = self._firmware.stabilizer.override, self._firmware.supervisor
        self._arm()
        setattr(override, f"m{motor}", pwm)
        override.enable = 1
        self.run(1.0)
        override.enable = 0
        setattr(override, f"m{motor}", 0)
        supervisor.arm(supervisor.auto_arm)

    def carry(self, x, y, z, yaw):
        hand = self.vehicle.physics.hand
        hand.x, hand.y, hand.z, hand.yaw = x, y, z, yaw
        self.run(4.0)

    def _command(self, number, form, *values):
        (answer,) = self._send(Port.HIGH_LEVEL, 0, struct.pack("<B" + form, number, *values))
        assert answer[-1] == 0

    def driver_takeoff(self, height):
        self._arm()
        z = self.vehicle.physics.position[2] + height
        self._command(7, "Bff?f", 0, z, 0.0, True, 2.0)
        self.run(2.0)

    def _arm(self):
        supervisor = self._firmware.supervisor
        if supervisor.auto_arm:
            return
        supervisor.arm(False)
        self._wait_for(SupervisorState.CAN_BE_ARMED)
        assert supervisor.arm(True)
        self._wait_for(SupervisorState.CAN_FLY)

    def _wait_for(self, flag):
        for _ in range(500):
            self._tick()
            if flag in self._firmware.supervisor.flags:
                return
        raise AssertionError(f"not {flag.words()} within {500 * PERIOD:g} s")

    def driver_turn(self, yaw):
        self._command(12, "B??5f", 0, True, False, 0.0, 0.0, 0.0, math.radians(yaw), 2.0)
        self.run(2.0)

    def driver_land(self):
        self._command(8, "Bff?f", 0, 0.0, 0.0, True, 2.0)
        self.run(5.0)

    # The hover stack.

    def note_hover(self, pwm):
        self.model_file = Path(self._folder.name) / "model.yaml"
        save_with_hover(self.model_file, self._type, pwm)
        return str(self.model_file)

    def _launch(self):
        launch = Path(rospkg.RosPack().get_path("crazyflie_examples")) / "launch/hw_hover.launch"
        hover = {"takeoff_hover_z": HEIGHT, "model": self.model_file}
        _, parameters = expand(launch, composed=True, rviz=False, **hover)
        self._graph = FakeGraph(parameters, start=1000.0)
        self._graph.listen("/crazyflie/cmd_vel", self._on_twist)
        for name, node in NODE_CLASSES(composed_nodes(parameters)).items():
            self._graph.start(f"/{name}", node())

    def _on_twist(self, message: Twist):
        self._twist = message

    def _call(self, service):
        answer = self._graph.call(service, EmptyRequest())
        for _ in range(3000):
            if answer.done():
                break
            self._tick()
        if (error := answer.exception(timeout=0)) is not None:
            raise Stop(str(error))

    def take_off(self):
        self.lqr_begin = len(self.samples)
        self._launch()
        self.run(2.0)
        self._arm()
        self._call("/takeoff")

    def refer(self, x, y, z):
        message = PositionVelocityStateStamped()
        message.header.stamp = self._graph.stamp()
        message.state.x, message.state.y, message.state.z = x, y, z
        self._graph.publish("/ref", message)

    def land(self):
        self._call("/land")
        self.run(1.0)

    def hide_poses(self, duration):
        self._is_hidden = True
        self.run(duration)
        self._is_hidden = False

    def emergency(self):
        self._firmware.supervisor.stop()


def _quaternion(roll, pitch, yaw):
    """Return (x, y, z, w) of half angles."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
