"""What can be made to go wrong."""

from dataclasses import dataclass


@dataclass
class FaultSwitches:
    """Switches, which may be changed at any time.

    Attributes
    ----------
    loss : float
        Probability in [0, 1] with which a packet, either way, is lost.
    delay : float
        What each packet takes, each way, s.
    silence : float
        For how long the link is to be silent from now on, s; counts down. The
        vehicle's port stays open, and the vehicle flies on.
    low_battery : int
        Not 0: the battery is nearly empty. Emptying cannot be undone.
    motor_failure : int
        Number of the failed motor, 1 to 4; 0 for none.
    """

    loss: float = 0.0
    delay: float = 0.0
    silence: float = 0.0
    low_battery: int = 0
    motor_failure: int = 0

    def pass_time(self, dt: float) -> None:
        """Let ``dt`` (s) of the silence pass."""
        if self.silence > 0.0:
            self.silence = max(0.0, self.silence - dt)
