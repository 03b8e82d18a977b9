// The circle, without ROS.
#include <gtest/gtest.h>

#include <stdexcept>

#include "roscpp_circle/circle.hpp"

using roscpp_circle::Circle;

TEST(Circle, TurnsToTheRightWithSpeedDividedByRadius) {
  EXPECT_DOUBLE_EQ(Circle(0.3, 0.5).yawRate(), -0.6);
}

TEST(Circle, RefusesNumbersThatAreNotPositive) {
  EXPECT_THROW(Circle(0.3, 0.0), std::invalid_argument);
  EXPECT_THROW(Circle(-0.3, 0.5), std::invalid_argument);
}

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
