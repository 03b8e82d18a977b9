// Vectors, matrices and constants, for C++ packages on top of this workspace.

#ifndef CRAZYFLIE_UTILS_TYPES_H
#define CRAZYFLIE_UTILS_TYPES_H

#include <Eigen/Dense>

typedef Eigen::Matrix<double, 3, 4> Matrix34d;
using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace crazyflie_utils {
namespace constants {

// Acceleration of free fall, m/s^2; also the mass-normalised thrust of hover.
static constexpr double G = 9.81;

}  // namespace constants
}  // namespace crazyflie_utils

#endif
