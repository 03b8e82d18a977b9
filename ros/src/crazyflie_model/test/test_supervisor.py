"""The supervisor's flags."""

from crazyflie_model.supervisor import SupervisorState


def test_flags_by_name():
    state = SupervisorState.of(armed=True, can_fly=False, trajectory_finished=True)
    assert state == SupervisorState.ARMED | SupervisorState.TRAJECTORY_FINISHED == 1 << 1 | 1 << 9


def test_words():
    assert SupervisorState(0).words() == "nothing"
    assert SupervisorState.of(locked=True, can_be_armed=True).words() == "can be armed, locked"


def test_faults_are_what_a_takeoff_cannot_end():
    faults = SupervisorState.of(tumbled=True, locked=True, crashed=True, deck_fault=True)
    assert SupervisorState(0xFFFF).faults == faults == 0x8E0
    assert SupervisorState(0x0800).words() == "deck fault"
    assert "decks" in SupervisorState(0x0840).remedy
    assert SupervisorState(0x40).remedy == "restart the vehicle"


def test_firmware_before_protocol_12_does_not_report_its_planner():
    # As recorded of both, at rest, in flight, and after a touchdown.
    assert all(SupervisorState(bits).reports_planner for bits in (0x20E, 0x11E, 0x31E, 0x21E))
    assert not any(SupervisorState(bits).reports_planner for bits in (0x0E, 0x1E, 0x44))
