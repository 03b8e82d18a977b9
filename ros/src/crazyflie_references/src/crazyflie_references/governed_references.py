"""References of a controller, as its node receives them, behind a `ReferenceGovernor`."""

from collections.abc import Callable, Sequence

import genpy

from crazyflie_model.limits import MAX_SPEED
from crazyflie_references.governor import Components, ReferenceGovernor
from crazyflie_utils import NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import Number
from crazyflie_utils.vectors import to_tuple

#: Turns the numbers of a reference message into a reference state, x_dim components.
Complete = Callable[[tuple[float, ...]], Sequence[float]]


class ReferenceLimits(Parameters):
    """Limits of references."""

    max_jump: float = parameter(
        Number("m", above=0.0),
        "a new reference that is further from the vehicle is travelled to, at up to 1 m/s; while "
        "several nodes send references, the vehicle flies this far in its direction",
        3.0,
        live=True,
    )
    max_speed: float = parameter(
        Number("m/s", above=0.0, maximum=MAX_SPEED),
        "largest velocity of a reference; a larger one is limited",
        2.0,
        live=True,
    )


class ReferenceParameters(Parameters):
    """Parameters of a controller that follows references, for its own to be derived from."""

    reference_topic: str = topic("reference", "where references come from")
    own_descent_topic: str | None = topic(
        "descent_reference",
        "references of a descent, which override all others; by default the name of reference + "
        "`_descent`",
        None,
    )
    limits: ReferenceLimits = group(ReferenceLimits, "reference")

    @property
    def descent_topic(self) -> str:
        """References of a descent."""
        return self.own_descent_topic or f"{self.reference_topic}_descent"

    def follow(
        self,
        handle: NodeHandle,
        message_type: type[genpy.Message],
        yaw_index: int,
        complete: Complete = tuple,
        on_reference: Callable[[], None] = lambda: None,
    ) -> "GovernedReferences":
        """Return the references of these topics; see `GovernedReferences`."""
        topics = self.reference_topic, self.descent_topic
        return GovernedReferences(
            handle, topics, message_type, yaw_index, self.limits, complete, on_reference
        )


class GovernedReferences:
    """Subscribes to references, and to those of descents.

    ``topics`` are the two; ``message_type`` is a stamped message with a field ``state``, all
    float64, that begins with position and velocity; ``complete`` adds what the state has beyond
    them, and ``yaw_index`` is the index of the yaw in it. ``on_reference()`` is called after each
    one that is accepted.
    """

    def __init__(
        self,
        handle: NodeHandle,
        topics: tuple[str, str],
        message_type: type[genpy.Message],
        yaw_index: int,
        limits: ReferenceLimits,
        complete: Complete = tuple,
        on_reference: Callable[[], None] = lambda: None,
    ):
        self._handle = handle
        self._complete = complete
        self._on_reference = on_reference
        self._governor = ReferenceGovernor(yaw_index, report=self._report)
        self.change(limits)
        self._topic = handle.resolve(topics[0])
        self._subscriber = handle.subscribe(
            topics[0],
            message_type,
            self._update,
            finite="state",
            on_invalid=lambda: self._governor.invalidate(handle.time()),
        )
        handle.subscribe(topics[1], message_type, self._descend, finite="state")

    def change(self, limits: ReferenceLimits) -> None:
        """Change the limits."""
        self._governor.max_jump, self._governor.max_speed = limits.max_jump, limits.max_speed

    def value(self, x: Components) -> Components | None:
        """Return the reference for a state now, x_dim components; None before the first one."""
        return self._governor.value(self._handle.time(), x)

    def stay(self, x: Components) -> None:
        """Keep the place and heading of a state until a reference comes."""
        self._governor.stay(x)

    def _update(self, message):
        now, time = self._handle.stamp().to_sec(), self._handle.time()
        x_ref, stamp = self._complete(to_tuple(message.state)), message.header.stamp.to_sec()
        source = self._subscriber.caller(message)
        if self._governor.update(x_ref, stamp, now, time, source):
            self._on_reference()
        else:
            self._report("order", "a reference is older than the present one, and ignored")

    def _descend(self, message):
        x_ref = self._complete(to_tuple(message.state))
        self._governor.descend(x_ref, self._handle.time())

    def _report(self, kind, text):
        self._handle.warn(f"{self._topic}: {text}", throttle=1.0, key=(self._topic, kind))
