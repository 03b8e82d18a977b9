"""What a process imports of rospy, and that nothing is missing."""

import subprocess
import sys

import pytest


def run(program):
    """Run a program in a Python of its own, which has imported nothing."""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_process_does_without_what_it_does_not_use():
    loaded = run(
        "import sys, crazyflie_utils.main, crazyflie_utils.parameters.reconfigure\n"
        "print(*sys.modules)"
    ).split()
    assert "rospy" in loaded
    for name in ("numpy", "_hashlib", "ssl", "yaml", "html", "roslib.packages", "catkin_pkg"):
        assert name not in loaded


def test_all_is_there_for_who_uses_it():
    run("""
import crazyflie_utils.main
import hashlib, html, http.server, roslib, ssl, urllib.request, yaml
import genpy, rospy
from dynamic_reconfigure.client import Client
from std_msgs.msg import String

hashlib.scrypt(b"", salt=b"", n=2, r=1, p=1)
http.client.HTTPSConnection("localhost").close()
urllib.request.HTTPSHandler(context=ssl.create_default_context())
assert http.server.html.escape("<") == html.escape("<")
assert roslib.stacks.list_stacks
import roslib.packages
assert roslib.packages.get_pkg_dir("rospy")
assert rospy.client.yaml.safe_load("[1]") == yaml.safe_load("[1]") == [1]
assert str(String("a: b")) == 'data: "a: b"'
""")


def test_what_was_imported_before_stays():
    run(
        "import hashlib, numpy, ssl, sys, yaml\n"
        "before = dict(sys.modules)\n"
        "import crazyflie_utils.main, genpy.message\n"
        "assert all(sys.modules[name] is module for name, module in before.items())\n"
        "assert numpy.float32 in genpy.message._valid_float_types"
    )


@pytest.mark.parametrize("before", ["import numpy", "pass"])
def test_messages_take_the_numbers_of_numpy(before):
    complaint = run(
        f"{before}\n"
        "import crazyflie_utils.main\n"
        "import genpy, io, numpy\n"
        "from geometry_msgs.msg import Vector3\n"
        "Vector3(numpy.float32(1), numpy.int8(2), numpy.uint64(3)).serialize(io.BytesIO())\n"
        "try:\n"
        "    Vector3(numpy.float32(1), numpy.int8(2), 'three')._check_types()\n"
        "except genpy.SerializationError as error:\n"
        "    print(error)"
    )
    assert complaint == "field z must be float type\n"
