// Publishes the velocity of a circle ten times per second.
#include <geometry_msgs/Twist.h>
#include <ros/ros.h>

#include <stdexcept>

#include "roscpp_circle/circle.hpp"

int main(int argc, char** argv) {
  ros::init(argc, argv, "talker");
  ros::NodeHandle node;
  ros::NodeHandle private_node("~");
  const double speed = private_node.param("speed", 0.3);    // m/s
  const double radius = private_node.param("radius", 0.5);  // m
  try {
    const roscpp_circle::Circle circle(speed, radius);
    ros::Publisher publisher = node.advertise<geometry_msgs::Twist>("cmd_vel", 1);
    geometry_msgs::Twist twist;
    twist.linear.x = circle.speed();
    twist.angular.z = circle.yawRate();
    ROS_INFO("a circle of %.1f m at %.1f m/s", radius, speed);
    ros::Rate rate(10.0);
    while (ros::ok()) {
      publisher.publish(twist);
      ros::spinOnce();
      rate.sleep();
    }
  } catch (const std::invalid_argument& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
