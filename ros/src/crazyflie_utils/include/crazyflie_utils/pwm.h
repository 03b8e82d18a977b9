// From mass-normalised thrust to the command of the radio link.

#ifndef CRAZYFLIE_UTILS_PWM_H
#define CRAZYFLIE_UTILS_PWM_H

#include <crazyflie_utils/types.h>

#include <algorithm>
#include <cstdint>

namespace crazyflie_utils {
namespace pwm {

// The command at which the vehicle hovers, of 0 to 65535.
static constexpr double HOVER_PWM = 42000.0;

// The command for a thrust in m/s^2, linear through zero, not limited.
static inline double ThrustToPwmDouble(double thrust) {
  return thrust * (HOVER_PWM / constants::G);
}

// The same, limited to what the link can carry.
static inline uint16_t ThrustToPwmUnsignedShort(double thrust) {
  return static_cast<uint16_t>(std::max(0.0, std::min(65535.0, ThrustToPwmDouble(thrust))));
}

}  // namespace pwm
}  // namespace crazyflie_utils

#endif
