"""What can be made to go wrong."""

from dataclasses import dataclass


@dataclass
class FaultSwitches:
    """Switches, which may be changed at any time."""

    loss: float = 0.0  #: Probability in [0, 1] with which a packet, either way, is lost.
    delay: float = 0.0  #: What each packet takes, each way, s.
    #: For how long the link is to be silent from now on, s; counts down. The vehicle's port stays
    #: open, and the vehicle flies on.
    silence: float = 0.0
    low_battery: int = 0  #: Not 0: the battery is nearly empty. Emptying cannot be undone.
    motor_failure: int = 0  #: Number of the failed motor, 1 to 4; 0 for none.

    def pass_time(self, dt: float) -> None:
        """Let ``dt`` (s) of the silence pass."""
        if self.silence > 0.0:
            self.silence = max(0.0, self.silence - dt)
