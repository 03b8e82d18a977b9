"""The launch file of a fleet on several computers."""

from xml.etree import ElementTree

from crazyflie_fleet.launch_text import launch_text


def test_a_launch_file_for_several_computers(tmp_path):
    path = tmp_path / "fleet.yaml"
    path.write_text(
        "robots:\n  cf1: {initial_position: [0, 0, 0]}\n"
        "  cf2: {initial_position: [0, 1, 0], machine: far}\n"
        "machines:\n  far: {address: 10.0.0.2, env_loader: /env.sh}\n"
    )
    launch = ElementTree.fromstring(launch_text(path))
    (machine,) = launch.findall("machine")
    assert machine.attrib == {"name": "far", "address": "10.0.0.2", "env-loader": "/env.sh"}
    arguments = [
        {each.attrib["name"]: each.attrib["value"] for each in include.findall("arg")}
        for include in launch.findall("include")
    ]
    assert [each["machine"] for each in arguments] == ["local", "far"]
    assert [each["name"] for each in arguments] == ["fleet", "fleet_far"]
    assert [each["host"] for each in arguments] == ["", "far"]
