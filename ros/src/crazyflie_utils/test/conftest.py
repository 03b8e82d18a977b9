"""Fixtures of the tests: a fake process, and what nodes in it have."""

import pytest

from crazyflie_utils.testing import FakeProcess


@pytest.fixture
def process():
    return FakeProcess()


@pytest.fixture
def handle(process):
    return process.handle("/ns/node")


@pytest.fixture
def lookup(process):
    return process.handle("/node").listen_to_transforms()
