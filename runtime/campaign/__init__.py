"""From a design to a recorded log: drivers that run a motion under guards.

`driver` is the interface, `guards` decide on every sample whether the motion goes on, and
`drivers.virtual` is the robot that is always there. `campaign` designs, runs and identifies until a
target is reached; `gate` releases its stages.
"""
