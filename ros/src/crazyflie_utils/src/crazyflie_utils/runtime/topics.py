"""Topics within a process: messages go from hand to hand.

A message that is published goes to the subscribers in this process as the very
object, by a call, and to those outside only when there are any. Subscribers
must therefore not change what they receive.
"""


class Topic:
    """One topic as this process sees it."""

    def __init__(self, name: str, message_type: type):
        self.name = name
        self.message_type = message_type
        self.receivers = []
        self.latched = None

    def deliver(self, message) -> None:
        """Hand a message to every subscriber in this process."""
        for receiver in self.receivers:
            receiver(message)


class Publisher:
    """The right to publish on a topic."""

    def __init__(self, topic: Topic, external, latch: bool):
        self._topic = topic
        self._external = external
        self._latch = latch
        self._is_closed = False

    @property
    def topic(self) -> str:
        """Name of the topic, absolute."""
        return self._topic.name

    def publish(self, message) -> None:
        """Send a message; it must not be changed afterwards.

        Raises
        ------
        TypeError
            The message is not of the topic's type.
        """
        if not isinstance(message, self._topic.message_type):
            raise TypeError(
                f"topic {self.topic} carries {self._topic.message_type._type}, "
                f"not {type(message).__name__}"
            )
        if self._is_closed:
            return
        if self._latch:
            self._topic.latched = message
        if self._latch or self._external.has_subscribers():
            self._external.publish(message)
        self._topic.deliver(message)

    def close(self) -> None:
        """Publish no more; what is published later, and what was latched, is lost."""
        self._is_closed = True
        if self._latch:
            self._topic.latched = None
        self._external.close()


class Topics:
    """All topics of a process.

    Parameters
    ----------
    transport : Transport
    """

    def __init__(self, transport):
        self._transport = transport
        self._topics = {}

    def publisher(self, name: str, message_type: type, latch: bool) -> Publisher:
        """Return a publisher; a latched one repeats its last message to late subscribers.

        Raises
        ------
        TypeError
            The topic has another type in this process.
        """
        topic = self._topic(name, message_type)
        return Publisher(topic, self._transport.advertise(name, message_type, latch), latch)

    def subscribe(self, name: str, message_type: type, receiver):
        """Have ``receiver(message)`` called for every message on a topic.

        Returns
        -------
        callable
            Ends it.

        Raises
        ------
        TypeError
            The topic has another type in this process.
        """
        topic = self._topic(name, message_type)
        topic.receivers.append(receiver)
        if topic.latched is not None:
            receiver(topic.latched)
        # Each receiver for itself, so that one that comes late is sent what an
        # outside publisher has latched; the connection is shared all the same.
        unsubscribe_outside = self._transport.subscribe(name, message_type, receiver)

        def unsubscribe():
            # Not in place: a message may be on its way to the others.
            topic.receivers = [each for each in topic.receivers if each is not receiver]
            unsubscribe_outside()

        return unsubscribe

    def _topic(self, name, message_type):
        topic = self._topics.setdefault(name, Topic(name, message_type))
        if topic.message_type is not message_type:
            raise TypeError(
                f"topic {name} carries {topic.message_type._type}, not {message_type._type}"
            )
        return topic
