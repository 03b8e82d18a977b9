"""The supervisor's flags."""

from crazyflie_model.supervisor import SupervisorState


def test_flags_by_name():
    state = SupervisorState.of(armed=True, can_fly=False, trajectory_finished=True)
    assert state == SupervisorState.ARMED | SupervisorState.TRAJECTORY_FINISHED == 1 << 1 | 1 << 9


def test_words():
    assert SupervisorState(0).words() == "nothing"
    assert SupervisorState.of(locked=True, can_be_armed=True).words() == "can be armed, locked"
