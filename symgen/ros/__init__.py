"""ROS packages and xacro: folders of packages, and xacro files expanded in a limited process.

| module | content |
|---|---|
| `packages` | the folder of a ROS package; xacro file → text of a URDF, in a child process |
| `xacro_child` | that process: limits, files that may be read, expressions that only compute |
"""
