"""The services of a driver, which only record their calls."""

from concurrent.futures import Future

from std_srvs.srv import Empty

from crazyflie_driver import srv
from crazyflie_utils import Node, ServiceError

SERVICES = {
    "emergency": Empty,
    "update_params": srv.UpdateParams,
    "takeoff": srv.Takeoff,
    "land": srv.Land,
    "stop": srv.Stop,
    "go_to": srv.GoTo,
    "upload_trajectory": srv.UploadTrajectory,
    "start_trajectory": srv.StartTrajectory,
}


class FakeDriver(Node):
    """Services of a vehicle /cf.

    Attributes
    ----------
    calls : list of tuple
        Time (s), name and request of every call.
    refused : dict
        Name -> why it is refused; None for a service that does not answer before `answer`.
    """

    def __init__(self):
        self.calls = []
        self.refused = {}
        self._late = []

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        for name, service_type in SERVICES.items():
            handle.advertise_service(f"/cf/{name}", service_type, self._answer(name, service_type))

    def names(self):
        """Return the names of the services that were called."""
        return [name for _, name, _ in self.calls]

    def _answer(self, name, service_type):
        def answer(request):
            self.calls.append((self._handle.time(), name, request))
            response = service_type._response_class()
            if name not in self.refused:
                return response
            if self.refused[name] is not None:
                raise ServiceError(self.refused[name])
            later = Future()
            self._late.append((later, response))
            return later

        return answer

    def answer(self):
        """Answer what waits for it."""
        for later, response in self._late:
            later.set_result(response)
        self._late.clear()
