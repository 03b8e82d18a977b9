"""The headers for C++ packages on top of this workspace: a program that uses all of them."""

import math
import shutil
import subprocess

import numpy as np
import pytest

PROGRAM = """
#include <crazyflie_msgs/ControlStamped.h>
#include <crazyflie_utils/angles.h>
#include <crazyflie_utils/pwm.h>
#include <crazyflie_utils/types.h>

#include <iostream>

int main() {
  using namespace crazyflie_utils;
  crazyflie_msgs::ControlStamped message;
  message.control.thrust = constants::G;
  const Quaterniond rotation = Eigen::AngleAxisd(0.3, Vector3d::UnitX()) *
      Eigen::AngleAxisd(-0.4, Vector3d::UnitY()) * Eigen::AngleAxisd(1.1, Vector3d::UnitZ());
  const Vector3d rpy = angles::Matrix2RPY(rotation.toRotationMatrix());
  VectorXd numbers(12);
  numbers << rpy, message.control.thrust, angles::DegreesToRadians(90.0),
      angles::RadiansToDegrees(1.0), angles::WrapAngleDegrees(-190.0),
      angles::WrapAngleDegrees(720.5), angles::WrapAngleRadians(4.0),
      pwm::ThrustToPwmDouble(constants::G), pwm::ThrustToPwmUnsignedShort(100.0),
      pwm::ThrustToPwmUnsignedShort(-1.0);
  std::cout.precision(17);
  for (int i = 0; i < numbers.size(); ++i) std::cout << numbers(i) << std::endl;
}
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler")
def test_a_program_is_compiled_and_calculates_as_the_nodes_do(tmp_path):
    source, program = tmp_path / "program.cpp", tmp_path / "program"
    source.write_text(PROGRAM)
    packages = ("crazyflie_utils", "crazyflie_msgs", "eigen3")
    command = ["pkg-config", "--cflags", *packages]
    flags = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
    # C++14 is what newer versions of Eigen need.
    compiler = ["g++", "-std=c++14", *flags.stdout.split(), str(source), "-o", str(program)]
    subprocess.run(compiler, check=True, timeout=300)
    output = subprocess.run([program], check=True, capture_output=True, text=True, timeout=60)
    expected = [
        *(0.3, -0.4, 1.1, 9.81, math.pi / 2.0, 180.0 / math.pi),
        *(170.0, 0.5, 4.0 - 2.0 * math.pi, 42000.0, 65535.0, 0.0),
    ]
    np.testing.assert_allclose(list(map(float, output.stdout.split())), expected, atol=1e-12)
