// Angles, as the nodes of this workspace calculate them.

#ifndef CRAZYFLIE_UTILS_ANGLES_H
#define CRAZYFLIE_UTILS_ANGLES_H

#include <crazyflie_utils/types.h>

#include <algorithm>
#include <cmath>

namespace crazyflie_utils {
namespace angles {

static constexpr double PI = 3.14159265358979323846;

static inline double DegreesToRadians(double degrees) { return degrees * (PI / 180.0); }

static inline double RadiansToDegrees(double radians) { return radians * (180.0 / PI); }

// The angle in [-180, 180) that points the same way.
static inline double WrapAngleDegrees(double degrees) {
  return degrees - 360.0 * std::floor((degrees + 180.0) / 360.0);
}

// The angle in [-pi, pi) that points the same way.
static inline double WrapAngleRadians(double radians) {
  return radians - 2.0 * PI * std::floor((radians + PI) / (2.0 * PI));
}

// Roll, pitch and yaw, rad, of a rotation matrix that is the product of rotations about x by roll,
// y by pitch and z by yaw: not the order of tf.
static inline Vector3d Matrix2RPY(const Matrix3d& R) {
  // Rounding may make a sine larger than 1.
  const double sine = std::max(-1.0, std::min(1.0, R(0, 2)));
  return Vector3d(std::atan2(-R(1, 2), R(2, 2)), std::asin(sine), std::atan2(-R(0, 1), R(0, 0)));
}

}  // namespace angles
}  // namespace crazyflie_utils

#endif
