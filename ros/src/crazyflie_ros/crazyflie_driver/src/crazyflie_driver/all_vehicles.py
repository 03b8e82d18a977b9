"""Services that command all vehicles of the server at the same moment."""

import threading
from collections.abc import Mapping
from concurrent.futures import Future, wait
from functools import partial
from typing import Any

from crazyflie_driver.channel import Channel
from crazyflie_driver.command import SERVICE_TYPES, Command, requested
from crazyflie_driver.flight_commands import Need
from crazyflie_driver.vehicle import DriverVehicle
from crazyflie_utils import NodeHandle, ServiceError

_GO_TO = ("go_to", "go_to_linear")

LIMIT = 5.0  #: Time in which vehicles answer, s; their own limits are shorter.


class AllVehicles:
    """Offers a service for all vehicles for each high-level command.

    What is checked for a single vehicle is checked for each, before any is sent the command; a
    landing or stop is sent to all others when it fails for one. A radio channel gets one
    packet for all if each of its vehicles needs just that; otherwise each vehicle gets its own.
    Every vehicle has to answer; one that has not received the broadcast is sent its own command.
    """

    def __init__(self, handle: NodeHandle, channels: Mapping[str, Channel]):
        self._handle = handle
        self._channels = channels

    def advertise(self) -> None:
        """Offer the services, ``~all/NAME``."""
        for name, service_type in SERVICE_TYPES.items():
            callback = partial(self._on_command, name, service_type._response_class())
            self._handle.advertise_service(f"~all/{name}", service_type, callback)

    def _on_command(self, name, response, request):
        if name in _GO_TO and not request.relative:
            raise ServiceError(
                f"{name} of all vehicles: relative is False, and they cannot go to one place; "
                "expected True"
            )
        command = requested(name, request)
        channels = list(self._channels.values())
        ready = [each for channel in channels for each in channel.vehicles if each.is_ready]
        if not ready:
            raise ServiceError(f"{name} of all vehicles: none is connected; expected one or more")
        # Begun here, in the order of the calls.
        checks = {vehicle: vehicle.commands.check(command) for vehicle in ready}
        answer: Future[Any] = Future()

        def work():
            try:
                self._send(command, channels, checks)
            except Exception as error:
                answer.set_exception(error)
            else:
                answer.set_result(response)

        threading.Thread(target=work, name=f"all-{name}", daemon=True).start()
        return answer

    def _send(
        self,
        command: Command,
        channels: list[Channel],
        checks: Mapping[DriverVehicle, Future[Need]],
    ) -> None:
        needs, refusals = _results(checks, not command.ends_flight)
        if refusals and not command.ends_flight:
            raise ServiceError(
                f"{command.name} was sent to no vehicle: {_text(refusals, len(checks))}"
            )
        sent = {}
        for channel in channels:
            shared = channel.share(needs)
            for vehicle in channel.vehicles:
                if vehicle in needs:
                    is_shared = shared is not None and needs[vehicle] is Need.COMMAND
                    own = command.by(shared if is_shared else None)
                    sent[vehicle] = vehicle.commands.send(own, None)
        refusals.update(_results(sent, not command.ends_flight)[1])
        if refusals:
            raise ServiceError(f"{command.name}: {_text(refusals, len(checks))}")


def _results(
    futures: Mapping[DriverVehicle, Future[Any]], may_withdraw: bool
) -> tuple[dict[DriverVehicle, Any], dict[DriverVehicle, str]]:
    # Results and errors.
    wait(futures.values(), LIMIT)
    results: dict[DriverVehicle, Any] = {}
    errors: dict[DriverVehicle, str] = {}
    for vehicle, future in futures.items():
        # What is refused must not be carried out later.
        if future.cancel() if may_withdraw else not future.done():
            errors[vehicle] = f"no answer within {LIMIT:g} s"
        elif (error := future.exception()) is not None:
            errors[vehicle] = str(error)
        else:
            results[vehicle] = future.result()
    return results, errors


def _text(refusals: Mapping[DriverVehicle, str], count: int) -> str:
    texts = sorted(f"{vehicle.parameters.name}: {text}" for vehicle, text in refusals.items())
    return f"{len(texts)} of {count} vehicles: " + "; ".join(texts)
