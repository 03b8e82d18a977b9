"""The firmware: its parts and the order in which they run."""

from types import SimpleNamespace

from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.body import OFF, STEP, MotorCommands, Physics, RangingSensors, Sensors
from crazyflie_virtual.crtp import Console, LinkStatistics
from crazyflie_virtual.firmware.decks import PositioningDeck
from crazyflie_virtual.firmware.estimator import Estimator, Localization
from crazyflie_virtual.firmware.planner import ACTIVE, Planner, TrajectoryState
from crazyflie_virtual.firmware.setpoints import AttitudeDecoder, Commander
from crazyflie_virtual.firmware.stabilizer import IDLE_THRUST, Stabilizer
from crazyflie_virtual.firmware.states import Estimate, Setpoint
from crazyflie_virtual.firmware.supervisor import Health, PowerMonitor, State, Supervisor
from crazyflie_virtual.memory import MemoryTester
from crazyflie_virtual.settings import VehicleSettings

#: First version of the protocol in which the supervisor has a port and reports the high-level
#: commander.
SUPERVISOR_PROTOCOL = 12
#: Steps between two updates of position controller and high-level commander: 100 Hz.
POSITION_STEPS = 5

_SUPERVISOR_STEPS = 20
_STARTING_UPDATES = 4
_POWER_STEPS = 50
_POSITION_PERIOD = POSITION_STEPS * STEP

#: Speed that the telemetry of an idling motor reports: the middle of what the supervisor expects.
#: The rotors of the model `brushless` turn faster than real ones, as their thrust constant is less.
_IDLE_RPM = 2250


class Firmware:
    """The firmware, from packets to motor commands.

    The sensors measure ``physics``; ``faults`` are also firmware parameters of the group
    ``virtual``. ``failure`` is the assertion that has caused this restart: the firmware then does
    not pass its self test; it answers the client and does not fly (system.c of the firmware) until
    the power is switched off and on.
    """

    def __init__(
        self,
        physics: Physics,
        faults: SimpleNamespace,
        settings: VehicleSettings,
        failure: str = "",
    ):
        self._physics = physics
        self.faults = faults
        self.hand = physics.hand
        self.has_color_leds = settings.color_leds
        self.has_led_ring = not settings.color_leds
        self.protocol = settings.protocol
        self.address = settings.address  #: Last byte of the radio's address.
        self._steps = 0
        self.time = 0.0  #: Time since the start (s).
        self.console = Console(lambda: self.time)
        self.warn = self.console.warn
        self.estimate = Estimate()
        self.sensors = Sensors(settings.sensor_noise, settings.seed)
        self.estimator = Estimator(self.estimate, settings.estimator)
        self.deck = PositioningDeck(settings, faults, self.estimator, physics)
        self.ranging = RangingSensors(physics, settings.multiranger, self.deck.has_flow)
        self.localization = Localization(self.estimator)
        self.planner = Planner(self.console.write_line)
        self.commander = Commander(self.planner)
        self.attitude_decoder = AttitudeDecoder()
        self.supervisor = Supervisor(self.console.write_line, settings.auto_arm)
        idle_thrust = 0 if settings.auto_arm else IDLE_THRUST
        # Whether the motors report their speeds (bidirectional DSHOT).
        self._has_telemetry = settings.model == "brushless" and not settings.auto_arm
        self.stabilizer = Stabilizer(idle_thrust, has_attitude_loops=not physics.has_lags)
        self.power = PowerMonitor()
        self.health = Health(faults)
        self.link_statistics = LinkStatistics()
        self.memory_tester = MemoryTester()
        self.setpoint = Setpoint()  #: Input of the controllers.
        self.reset_estimation = 0
        #: State of supervisor and high-level commander at the supervisor's last update, as clients
        #: see it.
        self.info = SupervisorState(0)
        self._warned_state: State | None = None
        self.console.write_line("SYS: ----------------------------")
        self.console.write_line("SYS: Virtual Crazyflie 2.1 is up and running!")
        self.is_started = not failure  #: Whether the self test has passed.
        if failure:
            self.console.write_line("SYS: The system resumed after a failed assert [WARNING]")
            self.console.write_line(f"SYS: {failure}; no flight before power is off and on")
            return
        # The pre-flight checks pass before a client can connect.
        for _ in range(_STARTING_UPDATES):
            self._supervise()
        self.console.write_line("STAB: Ready to fly.")

    @property
    def variance_velocity(self) -> float:
        """Variance of the velocity along each horizontal axis, m^2/s^2."""
        return self.estimator.variance_velocity + self.deck.unmeasured

    @property
    def milliseconds(self) -> int:
        """Time since the start, ms."""
        return round(1000.0 * self.time)

    def step(self, voltage: float) -> MotorCommands:
        """Advance by `STEP` at a voltage of the battery (V); return the motor commands."""
        physics, sensors, estimate = self._physics, self.sensors, self.estimate
        self._steps += 1
        self.time = self._steps * STEP
        if self._steps % _POWER_STEPS == 0:
            self.link_statistics.update(self.time)
            self._watch_power(voltage)
            self.health.update()
        if not self.is_started:
            return OFF
        with_position = self._steps % POSITION_STEPS == 0
        sensors.sample_inertial(physics.rates, physics.specific_force)
        self.estimator.sample(sensors)
        if with_position:
            self.estimator.predict(_POSITION_PERIOD)
            self._correct_estimate()
            self.commander.update_from_planner(self.time, estimate)
        if self._steps % _SUPERVISOR_STEPS == 0:
            self._supervise()
        if self._steps % _POWER_STEPS == 0:
            sensors.sample_slow(physics.position[2], physics.quaternion)
        setpoint = self.setpoint = self.supervisor.override(self.commander.setpoint)
        return self.stabilizer.update(
            setpoint, estimate, sensors, with_position, self.supervisor.motors_may_run
        )

    def stream(self, setpoint: Setpoint) -> None:
        """Process a setpoint of the client."""
        self.commander.stream(setpoint)
        state = self.supervisor.state
        if not self.supervisor.can_fly and self._warned_state is not state:
            self._warned_state = state
            self.console.write_line(f"CMD: setpoints have no effect: {state.value}")
        if not setpoint.is_finite:
            self.warn("setpoint", "CMD: flying by a setpoint that is not a number")

    def client_state(self) -> SupervisorState:
        """Return the present state of supervisor and high-level commander as clients see it."""
        if self.protocol < SUPERVISOR_PROTOCOL:
            return self.supervisor.flags
        return self.supervisor.flags | SupervisorState.of(
            high_level_active=self.planner.state in ACTIVE,
            trajectory_finished=self.planner.is_finished(self.time),
            high_level_disabled=self.planner.state is TrajectoryState.DISABLED,
        )

    def _correct_estimate(self):
        if not self.estimate.is_finite:
            self.warn("estimate", "ESTKALMAN: the state is not a number, resetting")
            self.reset_estimation = 1
        if self.reset_estimation:
            self.reset_estimation = 0
            self.estimator.reset()
            self.deck.forget_drift()
        self.estimator.grow_variances(_POSITION_PERIOD)
        if self.deck.is_there and not self.localization.is_fed(self.time):
            self.deck.measure(_POSITION_PERIOD)
        if not any(self.stabilizer.commands) and not self.supervisor.is_flying:
            self.estimator.correct_on_ground(_POSITION_PERIOD)

    def _supervise(self):
        physics = self._physics
        motors_run = max(self.stabilizer.commands) > self.stabilizer.idle_thrust
        age = self.time - self.commander.setpoint.time
        self.supervisor.has_deck_fault = bool(self.faults.deck)
        if self._has_telemetry:
            idle = physics.model.rotor_speed(IDLE_THRUST)
            speeds = (round(_IDLE_RPM * speed / idle) for speed in physics.rotor_speeds)
            self.supervisor.motor_speeds = tuple(speeds)
        self.supervisor.update(self.time, self.sensors, age, motors_run)
        if self.supervisor.can_fly:
            self._warned_state = None
        self.info = self.client_state()
        if self.planner.state is TrajectoryState.DISABLED:
            self.warn("planner", "HLC: no setpoints: a requested value is not a number")
        self.planner.block(not self.supervisor.can_fly)

    def _watch_power(self, voltage):
        was_low = self.power.state
        self.power.update(self.time, voltage)
        if self.power.state and not was_low:
            self.console.write_line(f"PM: battery low, {voltage:.2f} V")
