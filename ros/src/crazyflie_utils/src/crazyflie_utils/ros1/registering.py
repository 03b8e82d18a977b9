"""Registration with the master of all that a process announces, in one request."""

import http.client
import xmlrpc.client
from typing import Any

import rosgraph
import rospy
from rospy.impl import registration

_METHODS = {
    registration.Registration.PUB: "registerPublisher",
    registration.Registration.SUB: "registerSubscriber",
    registration.Registration.SRV: "registerService",
}


def register() -> None:
    """Register all topics and services of this process with the master."""
    listeners = registration.get_registration_listeners()
    topics, services = registration.get_topic_manager(), registration.get_service_manager()
    # Of publishers that come first, the master need not tell the subscribers that come then.
    registered = [
        *(("pub", *each) for each in topics.get_publications()),
        *(("sub", *each) for each in topics.get_subscriptions()),
        *(("srv", *each) for each in services.get_services()),
    ]
    request: Any = xmlrpc.client.MultiCall(rospy.core.xmlrpcapi(rosgraph.get_master_uri()))
    for kind, name, type_or_uri in registered:
        getattr(request, _METHODS[kind])(rospy.get_name(), name, type_or_uri, rospy.get_node_uri())
    try:
        outcome: Any = request()
        answers = [outcome[k] for k in range(len(registered))]
    except (OSError, http.client.HTTPException, xmlrpc.client.Error):
        # One by one, and each until the master is there.
        for kind, name, type_or_uri in registered:
            listeners.notify_added(name, type_or_uri, kind)
        return
    for (kind, name, _), (code, text, uris) in zip(registered, answers, strict=True):
        if code != 1:
            rospy.logfatal(f"unable to register {name} with master: {text}")
        elif kind == "sub":
            update_publishers(name, uris)


def update_publishers(topic: str, uris: list[str]) -> None:
    """Have rospy connect the subscribers of a topic to publishers, in its own thread."""
    for listener in registration.get_registration_listeners().listeners:
        listener.publisher_update(topic, uris)
