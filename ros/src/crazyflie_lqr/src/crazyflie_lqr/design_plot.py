"""Step response and Bode diagram of a design, as a picture."""

import math

import control
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from crazyflie_lqr.design import Design
from crazyflie_lqr.margins import loop_response
from crazyflie_lqr.models import CONTROLS, LinearModel
from crazyflie_utils.text_file import user_path

#: State in which a reference may step, and the control that responds.
_OUTPUTS = {"x": "pitch", "y": "roll", "z": "thrust", "yaw": "yaw_dot"}

_UNITS = {"roll": "rad", "pitch": "rad", "yaw_dot": "rad/s", "thrust": "m/s²"}


Responses = dict[str, NDArray[np.float64]]  #: Responses by name of an output, shape (n,).


def step_responses(
    model: LinearModel, design: Design
) -> tuple[NDArray[np.float64], Responses, Responses]:
    """Return the responses to unit steps of the reference in x, y, z and yaw, each alone.

    These are the times (s), the motion of each output (m or rad), and its control.
    """
    slowest = -design.poles.real.max()
    duration = min(8.0 / slowest, 60.0)
    if design.sample_time:
        time = np.arange(0.0, duration, design.sample_time)
    else:
        time = np.linspace(0.0, duration, 1000)
    A = design.A + design.B @ design.feedback
    states: Responses = {}
    controls: Responses = {}
    for output, answer in _OUTPUTS.items():
        index = model.states.index(output)
        B = -design.B @ design.K[:, [index]]
        rows = np.vstack([np.eye(A.shape[0])[index], design.feedback[CONTROLS.index(answer)]])
        direct = np.array([[0.0], [-design.K[CONTROLS.index(answer), index]]])
        system = control.ss(A, B, rows, direct, design.sample_time)
        states[output], controls[output] = control.forced_response(system, time, 1.0).outputs
    return time, states, controls


def save_plot(path: str, model: LinearModel, design: Design) -> None:
    """Draw step responses and Bode diagrams into a file whose name ends in a picture format."""
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    (position, magnitude), (effort, phase) = figure.subplots(2, 2)
    time, states, controls = step_responses(model, design)
    _draw_steps(position, effort, time, states, controls, design.sample_time > 0.0)
    _draw_bode(magnitude, phase, design)
    figure.suptitle(f"{model.name}: closed loop, and loops broken at the plant's input")
    figure.savefig(user_path(path), dpi=120)


def _draw_steps(position, effort, time, states, controls, is_sampled):
    draw = {"drawstyle": "steps-post"} if is_sampled else {}
    for (output, answer), style in zip(_OUTPUTS.items(), ("-", "--", "-", "-"), strict=True):
        position.plot(time, states[output], style, label=output)
        label = f"{answer} ({_UNITS[answer]}) for {output}"
        effort.plot(time, controls[output], style, label=label, **draw)
    position.set_title("step of the reference by 1 m, 1 rad")
    position.set_ylabel("m, rad")
    effort.set_ylabel("control, difference from hover")
    effort.set_yscale("symlog", linthresh=0.1)
    for axes in (position, effort):
        axes.set_xlabel("time (s)")
        axes.grid(alpha=0.4)
        axes.legend()


def _draw_bode(magnitude, phase, design):
    for loop, style in zip(range(len(CONTROLS)), ("-", "--", "-", "-"), strict=True):
        frequency, response = loop_response(design, loop)
        if not response.any():
            continue
        magnitude.loglog(frequency, np.abs(response), style, label=CONTROLS[loop])
        degrees = np.degrees(np.unwrap(np.angle(response)))
        # Phases are known up to whole turns; those of integrators begin below zero.
        degrees -= 360.0 * math.ceil(degrees[0] / 360.0 - 1e-9)
        phase.semilogx(frequency, degrees, style, label=CONTROLS[loop])
    magnitude.set_title("loop transfer functions")
    magnitude.set_ylabel("magnitude")
    magnitude.axhline(1.0, color="black", linewidth=0.8)
    phase.set_ylabel("phase (deg)")
    phase.axhline(-180.0, color="black", linewidth=0.8)
    for axes in (magnitude, phase):
        axes.set_xlabel("rad/s")
        axes.grid(alpha=0.4, which="both")
        axes.legend()
