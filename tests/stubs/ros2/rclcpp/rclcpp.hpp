// The part of rclcpp that the generated ROS 2 package uses.
#pragma once
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>
namespace rclcpp
{
class Parameter
{
public:
  Parameter() = default;
  explicit Parameter(std::vector<double> values) : values_(std::move(values)) {}
  std::vector<double> as_double_array() const {return values_;}

private:
  std::vector<double> values_;
};
namespace node_interfaces
{
class NodeParametersInterface
{
public:
  using ConstSharedPtr = std::shared_ptr<const NodeParametersInterface>;
  using SharedPtr = std::shared_ptr<NodeParametersInterface>;
  std::map<std::string, std::vector<double>> values;
  bool has_parameter(const std::string & name) const {return values.count(name) > 0;}
  bool get_parameter(const std::string & name, Parameter & parameter) const
  {
    parameter = Parameter(values.at(name));
    return true;
  }
};
}  // namespace node_interfaces
template<typename Message>
struct Publisher
{
  using SharedPtr = std::shared_ptr<Publisher>;
  void publish(const Message &) {}
};
template<typename Message>
struct Subscription
{
  using SharedPtr = std::shared_ptr<Subscription>;
};
class Node
{
public:
  explicit Node(const std::string &) {}
  template<typename Value>
  Value declare_parameter(const std::string &, const Value & value) {return value;}
  node_interfaces::NodeParametersInterface::SharedPtr get_node_parameters_interface()
  {
    return std::make_shared<node_interfaces::NodeParametersInterface>();
  }
  template<typename Message>
  typename Publisher<Message>::SharedPtr create_publisher(const std::string &, int)
  {
    return std::make_shared<Publisher<Message>>();
  }
  template<typename Message, typename Callback>
  typename Subscription<Message>::SharedPtr create_subscription(
    const std::string &, int, Callback callback)
  {
    (void)std::function<void(const Message &)>(callback);
    return std::make_shared<Subscription<Message>>();
  }
};
inline void init(int, char **) {}
inline void spin(std::shared_ptr<Node>) {}
inline void shutdown() {}
}  // namespace rclcpp
