// The part of pluginlib that the generated ROS 2 package uses.
#pragma once
#include <memory>
#include <string>
namespace pluginlib
{
template<typename Base>
struct ClassLoader
{
  ClassLoader(const std::string &, const std::string &) {}
  std::shared_ptr<Base> createSharedInstance(const std::string &) {return nullptr;}
};
}  // namespace pluginlib
