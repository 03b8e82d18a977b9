// The algorithm: a circle that is flown by velocity. It knows nothing about ROS.
#pragma once

#include <stdexcept>

namespace roscpp_circle {

/// A circle to the right.
class Circle {
 public:
  /// speed in m/s, radius in m; both must be positive.
  Circle(double speed, double radius) : speed_(speed), radius_(radius) {
    if (!(speed > 0.0) || !(radius > 0.0)) {
      throw std::invalid_argument("speed and radius: expected numbers > 0");
    }
  }

  double speed() const { return speed_; }

  /// Yaw rate in rad/s, negative to the right.
  double yawRate() const { return -speed_ / radius_; }

 private:
  double speed_;
  double radius_;
};

}  // namespace roscpp_circle
