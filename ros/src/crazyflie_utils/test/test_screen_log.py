"""Logging with a disk that is full."""

import logging

import pytest

from crazyflie_utils.ros1.patches import ROSOUT, shield_screen_log


class FullDisk(logging.Handler):
    def __init__(self):
        super().__init__()
        self.count = 0

    def emit(self, record):
        self.count += 1
        raise OSError("no space left on device")


@pytest.fixture
def disk():
    handler = FullDisk()
    logger = logging.getLogger(ROSOUT)
    before, logger.handlers = logger.handlers, [handler]
    yield handler
    logger.handlers = before


def test_a_full_disk_fails_who_logs_without_a_shield(disk):
    with pytest.raises(OSError, match="no space"):
        logging.getLogger(ROSOUT).error("hello")


def test_a_full_disk_fails_no_write_behind_a_shield(disk):
    shield_screen_log()
    shield_screen_log()
    logging.getLogger(ROSOUT).error("hello")
    assert disk.count == 1
