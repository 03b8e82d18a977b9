// Listens to the state of the vehicle, and tells its height by service.
#include <crazyflie_msgs/PositionVelocityYawStateStamped.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <string>

class Listener {
 public:
  explicit Listener(ros::NodeHandle& node)
      : subscriber_(node.subscribe("state", 1, &Listener::onState, this)),
        service_(node.advertiseService("height", &Listener::onCall, this)) {}

 private:
  void onState(const crazyflie_msgs::PositionVelocityYawStateStamped::ConstPtr& message) {
    height_ = message->state.z;
    has_state_ = true;
    ROS_INFO_THROTTLE(1.0, "the height is %.2f m", height_);
  }

  bool onCall(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    response.success = has_state_;
    response.message = has_state_ ? std::to_string(height_) + " m" : "no state has arrived";
    return true;
  }

  double height_ = 0.0;
  bool has_state_ = false;
  ros::Subscriber subscriber_;
  ros::ServiceServer service_;
};

int main(int argc, char** argv) {
  ros::init(argc, argv, "listener");
  ros::NodeHandle node;
  Listener listener(node);
  ros::spin();
  return 0;
}
