"""Good documents as text."""

PRIOR = """trust = "cad"
total_mass = [1.0, 30.0]

[link.{link}]
mass = [0.5, 2.5]
com_box = [[-0.3, -0.3, -0.3], [0.3, 0.3, 0.3]]
com_hull = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]
symmetry = ["xz"]
"""
RECIPE = """joints = {joints}
[time]
file = "log.csv"
column = "t"
unit = "s"
[position]
file = "log.csv"
columns = {q}
unit = "rad"
[torque]
file = "log.csv"
columns = {tau}
unit = "N*m"
sign = 1
[gear]
matrix = {gear}
[preparation]
filter = "butterworth"
cutoff_hz = 10.0
rate_hz = 50.0
[friction]
columns = ["viscous", "coulomb", "offset"]
[split]
train = [0.0, 0.48]
validation = [0.48, 0.6]
test = [0.6, 1.0]
"""
BOX = 'mass = 1.5\ncom = [0.01, 0.02, 0.1]\nsize = [0.1, 0.1, 0.2]\nlink = "{link}"\n'
MJCF = """<mujoco model="arm">
 <compiler angle="radian" autolimits="true"/>
 <option gravity="0 0 -9.81"/>
 <default><joint damping="0.1"/><geom type="capsule" density="900"/></default>
 <asset><material name="grey" rgba="0.5 0.5 0.5 1"/></asset>
 <worldbody>
  <body name="upper" pos="0 0 0.3">
   <joint name="j1" axis="0 0 1" range="-2 2" armature="0.01" frictionloss="0.2"/>
   <inertial pos="0 0 0.1" mass="2" diaginertia="0.02 0.02 0.004"/>
   <geom name="g1" size="0.04" fromto="0 0 0 0 0 0.3" material="grey"/>
   <body name="lower" pos="0 0 0.3" quat="0.7071 0.7071 0 0">
    <joint name="j2" type="hinge" axis="0 1 0" range="-1.5 1.5"/>
    <inertial pos="0.02 0 0.1" mass="1" fullinertia="0.01 0.01 0.002 0 0.0001 0"/>
    <geom name="g2" type="box" size="0.03 0.03 0.1"/>
    <body name="rail" pos="0 0 0.2"><joint name="j3" type="slide"/><geom size="0.02 0.05"/></body>
   </body>
  </body>
 </worldbody>
 <actuator><motor name="m1" joint="j1" gear="100"/></actuator>
 <sensor><jointpos joint="j1"/></sensor>
</mujoco>
"""
MECHANISM = """independent = []
[[spring]]
name = "one"
joint = "{joint}"
rest = 0.1
stiffness = 5.0
[[spring]]
name = "unknown"
of = {"{joint}" = 1.0}
[[known_torque]]
joint = "{joint}"
x = [-1.0, 0.0, 1.0]
torque = [0.5, 0.0, -0.5]
[[friction]]
name = "motor"
of = {"{joint}" = 100.0}
"""
XACRO = """<?xml version="1.0"?>
<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="1.5"/>
<xacro:property name="length" value="${0.2 + 0.1}"/>
<xacro:property name="box" value="${dict(x=0.01, y=0.02, z=0.02)}"/>
<xacro:macro name="rod" params="name parent mass:=1.0 *origin">
<joint name="${name}_joint" type="revolute"><xacro:insert_block name="origin"/>
<parent link="${parent}"/><child link="${name}"/><axis xyz="0 1 0"/>
<limit lower="${-pi/2}" upper="${pi/2}" velocity="3" effort="10"/></joint>
<link name="${name}"><inertial><origin xyz="0 0 ${length/2}"/><mass value="${mass}"/>
<inertia ixx="${box['x']}" ixy="0" ixz="0" iyy="${box['y']}" iyz="0" izz="${box['z']}"/></inertial>
</link></xacro:macro>
<link name="base"/>
<xacro:rod name="upper" parent="base" mass="$(arg mass)"><origin xyz="0 0 0.5"/></xacro:rod>
<xacro:if value="${length > 0.1}">
<xacro:rod name="lower" parent="upper"><origin xyz="0 0 ${length}"/></xacro:rod></xacro:if>
<xacro:unless value="true"><link name="none"/></xacro:unless>
</robot>"""
"""Macros, blocks, conditions and expressions of xacro."""
