"""ROS interface of the dashboard."""

import contextlib
from importlib.util import find_spec
from pathlib import Path

import rospkg
from typing_extensions import override

from crazyflie_dashboard.access import Access, AccessError, expect_free_port, is_loopback, token_in
from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.emergency import EmergencyLane
from crazyflie_dashboard.master import Master
from crazyflie_utils import Node, NodeHandle, ParameterError, Parameters, parameter
from crazyflie_utils.parameters.types import PORT, Number, Text

_NOT_INSTALLED = "NiceGUI, which the page is made with, is not installed: ./run install dashboard"

_TOKEN_FILE = "crazyflie_dashboard_token"


class DashboardParameters(Parameters):
    """Parameters of `DashboardNode`."""

    host: str = parameter(Text(), "address that the page listens on", "127.0.0.1")
    port: int = parameter(PORT, "port of the page", 8642)
    token_file: str = parameter(
        Text(may_be_empty=True),
        "file with the token that a page must present; by default `crazyflie_dashboard_token` in "
        "ROS's folder, if `host` is not this computer's own. It is created if it is missing",
        "",
    )
    folders: str = parameter(
        Text(may_be_empty=True),
        "folders with missions and trajectories (CSV), separated by colons; empty for the examples",
        "",
    )
    goal_limit: float = parameter(
        Number("m", above=0.0),
        "where there is neither a room (crazyflie_world) nor a geofence: largest height of goals, "
        "and distance from the origin along x and y",
        10.0,
    )


class DashboardNode(Node):
    """Show vehicles in a browser, and command them."""

    sources = "browsers, files and the master"

    def __init__(self) -> None:
        # Closes what has been opened, also if the page cannot be opened.
        self._open = contextlib.ExitStack()

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        parameters = self._parameters = handle.load(DashboardParameters)
        path = Path(parameters.token_file or Path(rospkg.get_ros_home(), _TOKEN_FILE)).expanduser()
        is_needed = parameters.token_file or not is_loopback(parameters.host)
        try:
            token = token_in(path) if is_needed else ""
            self._access = Access(parameters.host, parameters.port, token)
            expect_free_port(parameters.host, parameters.port)
        except AccessError as error:
            raise ParameterError(f"{handle.name}: {error}") from None
        if find_spec("nicegui") is None:
            raise ParameterError(f"{handle.name}: {_NOT_INSTALLED}")

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        folders = [path for path in self._parameters.folders.split(":") if path]
        folders = folders or example_folders()
        master = Master(handle.name)
        lane = EmergencyLane(master, handle.warn)
        reach = self._parameters.goal_limit
        dashboard = Dashboard(handle, master, lane, folders, reach=reach)
        self._open.callback(dashboard.close)
        # NiceGUI takes a second to import, which programs that only read the parameters'
        # declaration do not need.
        from crazyflie_dashboard.page import Page

        self._open.callback(Page(dashboard, self._access).close)
        # Printed and not logged: only those who see this terminal may have the token.
        print(f"the dashboard is at {self._access.url}", flush=True)

    @override
    def shutdown(self) -> None:
        self._open.close()


def example_folders() -> list[str]:
    """Return the folders of this workspace's missions and trajectories that are installed."""
    packages = rospkg.RosPack()
    folders = []
    for package, folder in (("crazyflie_mission_api", "examples"), ("crazyflie_demo", "data")):
        with contextlib.suppress(rospkg.ResourceNotFound):
            folders.append(str(Path(packages.get_path(package)) / folder))
    return folders
