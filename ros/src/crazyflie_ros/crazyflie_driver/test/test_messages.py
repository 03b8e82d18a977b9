"""Messages and services are those of the C++ driver, to the last byte of their layout."""

import pytest

from crazyflie_driver import msg, srv

MESSAGES = {
    "FullState": "710c46575863b90cc689d2b26fefeb38",
    "GenericLogData": "bfa79f36371fee74e53d96afde61049b",
    "Hover": "3d4f46e9fa4dcfdc0516eb081fef369e",
    "LogBlock": "d9325f33ff3a1ffc6b6c0323a9f9b181",
    "Position": "fb9bb23ad995963ed72488318d105adf",
    "TrajectoryPolynomialPiece": "9099d336831f8a28304456aacb0d75e8",
    "VelocityWorld": "5c7894b98f86c9f4dc7d7cb4971ec39d",
    "crtpPacket": "211163da2417112110f499fc3a0bedf0",
}

SERVICES = {
    "AddCrazyflie": "532d9ac6ee37f1d90ac3223857b70779",
    "GoTo": "82856b48a972d6af023d961a655bcf75",
    "Land": "b665b6c83a196e4774268cc26329b159",
    "NotifySetpointsStop": "5e1e40fcf516d3883bc228627d3e1e43",
    "RemoveCrazyflie": "636fe5e07550f026d28388e95c38a9f4",
    "SetGroupMask": "d44d7e9aa94d069ed5834dbd7329e1bb",
    "StartTrajectory": "74e2cf5224bc82fcc8d9c7dd3865d912",
    "Stop": "d44d7e9aa94d069ed5834dbd7329e1bb",
    "Takeoff": "b665b6c83a196e4774268cc26329b159",
    "UpdateParams": "279e0627eb574ffe8968384218434f5f",
    "UploadTrajectory": "becd7733dfdc3d0c93a9064ba651cf17",
    "sendPacket": "e3f946ce194c915d34d0f5ddedef0de7",
}


@pytest.mark.parametrize("name", MESSAGES)
def test_messages(name):
    assert getattr(msg, name)._md5sum == MESSAGES[name]


@pytest.mark.parametrize("name", SERVICES)
def test_services_with_an_empty_response(name):
    assert getattr(srv, name)._md5sum == SERVICES[name]
    assert getattr(srv, name + "Response").__slots__ == []
