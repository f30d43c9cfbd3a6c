"""Robot files as users have them → text of a URDF and a mechanism.

| source | module |
|---|---|
| URDF | read as it is |
| `package://PACKAGE/path` | `symgen.ros` finds the folder of the ROS package |
| `.xacro` | `symgen.ros` expands it |
| `.toml` of modified DH rows | `symgen.chain.dh` |
| MJCF | `mjcf` reads it with MuJoCo |
| SDF | `sdf`, with the frames of `sdf_frames` |
| springs of MJCF and SDF | `springs` |
| name of a published robot | `published` |
"""

from symgen.build.sources.published import published_urdf
from symgen.build.sources.source import Source, read_source
from symgen.build.sources.springs import split_by_use
from symgen.ros import Packages

__all__ = ["Packages", "Source", "published_urdf", "read_source", "split_by_use"]
