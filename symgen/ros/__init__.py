"""ROS packages and xacro: folders of packages, and xacro files expanded in a limited process."""
