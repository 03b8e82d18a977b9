"""Pictures and videos of --sim."""

import sys

import matplotlib
import numpy as np
import pytest
from PIL import Image
from sim import PAIR

import crazyflie_py
from crazyflie_py.swarm import NullVisualizer
from crazyflie_py.visualizer import MatplotlibVisualizer


@pytest.fixture(autouse=True)
def no_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    # Whether this machine has it does not matter.
    monkeypatch.setattr("matplotlib.animation.FFMpegWriter.isAvailable", lambda: False)


def swarm_with(options):
    return crazyflie_py.Crazyswarm(crazyflies_yaml=PAIR, args=f"--sim {options}")


def test_without_a_display_nothing_is_drawn():
    swarm = swarm_with("")
    swarm.timeHelper.visualizer.setGraph([(0, 1)])
    swarm.timeHelper.visualizer.showEllipsoids([0.1, 0.1, 0.3])
    swarm.allcfs.takeoff(1.0, 2.0)
    swarm.timeHelper.sleep(2.0)
    assert isinstance(swarm.timeHelper.visualizer, MatplotlibVisualizer)
    assert swarm.timeHelper.time() == pytest.approx(2.0)


@pytest.mark.parametrize("has_toolkit", [False, True])
def test_a_display_that_does_not_answer_is_reported(monkeypatch, caplog, has_toolkit):
    monkeypatch.setenv("DISPLAY", ":9999")
    if has_toolkit:
        # The backend that matplotlib then chooses.
        matplotlib.use("agg")
    else:
        monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    swarm = swarm_with("--vis mpl")
    swarm.timeHelper.sleep(0.2)
    assert "no window can be opened" in caplog.text


def test_without_ffmpeg_a_video_is_an_animation(tmp_path, caplog):
    swarm = swarm_with(f"--vis null --dt 0.25 --video {tmp_path}/flight.mp4")
    swarm.timeHelper.visualizer.showEllipsoids([0.1, 0.1, 0.3])
    one, _ = swarm.allcfs.crazyflies
    one.setLEDColor(1.0, 0.0, 0.0)
    assert one.ledRGB == (1.0, 0.0, 0.0)
    swarm.timeHelper.sleep(1.0)
    swarm.timeHelper.visualizer.finishVideoOutput()
    assert "ffmpeg is not installed" in caplog.text
    with Image.open(tmp_path / "flight.gif") as video:
        colors = np.array(video.convert("RGB")).reshape(-1, 3).astype(int)
    # Red where nothing else is.
    assert np.any((colors[:, 0] > 200) & (colors[:, 1] < 60) & (colors[:, 2] < 60))


def test_a_color_is_that_of_color_led_decks_too():
    one, two = swarm_with("--dt 0.5").allcfs.crazyflies
    one.setParam("deck.bcColorLedTop", 1)
    for each in (one, two):
        each.setLEDColor(1.0, 0.5, 0.0)
    assert one.getParam("colorLedTop.wrgb8888") == 0xFF8000
    assert one.getParam("colorLedBot.wrgb8888") == two.getParam("colorLedTop.wrgb8888") == 0


def test_a_script_writes_a_video_between_two_moments(tmp_path):
    swarm = swarm_with("--dt 0.5")
    swarm.timeHelper.sleep(1.0)
    visualizer = swarm.timeHelper.visualizer
    visualizer.startVideoOutput(str(tmp_path / "part.gif"), 0.5)
    swarm.allcfs.takeoff(1.0, 1.0)
    swarm.timeHelper.sleep(1.5)
    visualizer.finishVideoOutput()
    swarm.timeHelper.sleep(1.0)
    with Image.open(tmp_path / "part.gif") as video:
        assert video.n_frames == 3


def test_a_video_that_cannot_be_written_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="the folder .*/nowhere does not exist"):
        swarm_with(f"--video {tmp_path}/nowhere/flight.mp4")


def test_null_draws_nothing():
    assert type(swarm_with("--vis null").timeHelper.visualizer) is NullVisualizer
