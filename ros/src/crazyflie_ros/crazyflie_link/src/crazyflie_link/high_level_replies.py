"""What a vehicle's state says of a high-level command whose reply is missing or late."""

import time
from dataclasses import replace

from cflib.crazyflie.high_level_commander import HighLevelCommander

from crazyflie_link.errors import NoReplyError
from crazyflie_link.link import Link
from crazyflie_link.request_reply import RESEND_PERIOD, Request
from crazyflie_link.supervisor import read_state
from crazyflie_link.transmit_queue import Send
from crazyflie_model.supervisor import SupervisorState

REPORT_LAG = 0.1  #: Time in which the supervisor, at 25 Hz, has taken note of a takeoff, s.


def request_after_broadcast(link: Link, transmit: Send, request: Request) -> bytes:
    """Request what must not be done twice, first by a broadcast; see `Link.request`.

    The vehicle gets a command of its own only if the planner's last plan has ended, which it has
    not once this one is carried out.
    """
    try:
        return link.request(transmit, replace(request, limit=RESEND_PERIOD))
    except NoReplyError:
        state = read_state(link)
        if state is None or SupervisorState.TRAJECTORY_FINISHED not in state:
            raise
        return link.request(transmit, request)


def is_carried_out(link: Link, number: int) -> bool:
    """Return whether a repeated command (its number) was refused because the first is obeyed."""
    if number != HighLevelCommander.COMMAND_TAKEOFF_2:
        return number == HighLevelCommander.COMMAND_LAND_2
    end = time.monotonic() + REPORT_LAG
    while True:
        state = read_state(link)
        if state is None or not state.reports_planner:
            return True
        if SupervisorState.HIGH_LEVEL_ACTIVE in state or time.monotonic() > end:
            return SupervisorState.HIGH_LEVEL_ACTIVE in state
        time.sleep(REPORT_LAG / 4)
