"""State of a vehicle by the firmware's supervisor."""

import enum


class SupervisorState(enum.IntFlag):
    """State of the vehicle; also the log variable supervisor.info.

    Three of the last four are the high-level commander's (supervisor.c of the firmware).
    """

    CAN_BE_ARMED = 1 << 0
    ARMED = 1 << 1
    AUTO_ARMED = 1 << 2
    CAN_FLY = 1 << 3
    FLYING = 1 << 4
    TUMBLED = 1 << 5
    LOCKED = 1 << 6
    CRASHED = 1 << 7
    HIGH_LEVEL_ACTIVE = 1 << 8
    TRAJECTORY_FINISHED = 1 << 9
    HIGH_LEVEL_DISABLED = 1 << 10
    DECK_FAULT = 1 << 11  #: A deck reports a fault of its hardware (firmware 2026.08).

    @classmethod
    def of(cls, **flags: bool) -> "SupervisorState":
        """Return the state with the flags that are true; names in small letters."""
        return cls(sum(cls[name.upper()] for name, holds in flags.items() if holds))

    @property
    def reports_planner(self) -> bool:
        """Whether the firmware reports its high-level commander; before protocol 12 it does not.

        In all recordings of such firmware, one of its flags is always set, except while a stream
        overrides a plan whose time has not run out.
        """
        cls = SupervisorState
        reported = cls.HIGH_LEVEL_ACTIVE | cls.TRAJECTORY_FINISHED | cls.HIGH_LEVEL_DISABLED
        return bool(self & reported)

    @property
    def faults(self) -> "SupervisorState":
        """Flags with which the vehicle cannot take off before it is put upright or restarted."""
        return self & (self.TUMBLED | self.LOCKED | self.CRASHED | self.DECK_FAULT)

    @property
    def remedy(self) -> str:
        """What a person does about `faults`."""
        if self.DECK_FAULT in self:
            return "switch the vehicle off, and see that its decks sit right"
        return "restart the vehicle"

    def words(self) -> str:
        """Return the state in words, such as "armed, flying"."""
        names = [name for name, flag in SupervisorState.__members__.items() if flag in self]
        return ", ".join(names).lower().replace("_", " ") or "nothing"
