"""An arm with every trap of an export, and a model that is not the URDF's."""

from xml.etree.ElementTree import Element

import numpy as np
from defusedxml.ElementTree import fromstring

from runtime.library import Library

# Every trap at once: a continuous and a prismatic joint, a moving link without an inertial of its
# own, a rotated inertial, fixed bodies in a row on a moving link, a fixed body on the base, a
# moving joint behind a fixed body, joints in no alphabetic order; gravity is tilted as well. For
# SDF and MJCF a root called world, fixed joints named as their links, a flange without mass.
ARM = """<robot name="arm"><link name="world"/>
  <joint name="base" type="fixed"><parent link="world"/><child link="base"/>
    <origin xyz="0 0 .4" rpy="0 .3 0"/></joint>
  <link name="base"><inertial><mass value="3"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="pedestal"><inertial><origin xyz="0 0 1" rpy="0 0 0"/><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="stand" type="fixed"><parent link="base"/><child link="pedestal"/></joint>
  <link name="upper"><visual><geometry><box size="1 2 3"/></geometry></visual>
    <inertial><origin xyz=".1 .2 .3" rpy=".3 .2 .1"/><mass value="4"/>
    <inertia ixx=".05" iyy=".06" izz=".07" ixy=".01" ixz="0" iyz="0"/></inertial></link>
  <joint name="z_turn" type="continuous"><parent link="pedestal"/><child link="upper"/>
    <origin xyz="0 0 .2" rpy=".5 0 0"/><axis xyz="0 1 1"/></joint>
  <link name="bracket"><inertial><origin xyz="0 .1 0" rpy="0 0 1"/><mass value=".5"/>
    <inertia ixx=".01" iyy=".02" izz=".015" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="screw" type="fixed"><parent link="upper"/><child link="bracket"/>
    <origin xyz=".3 0 0" rpy="0 .7 0"/></joint>
  <link name="camera"><inertial><mass value=".2"/>
    <inertia ixx=".001" iyy=".001" izz=".001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="glue" type="fixed"><parent link="bracket"/><child link="camera"/>
    <origin xyz="0 .2 0" rpy="1 0 0"/></joint>
  <link name="slider"/>
  <joint name="m_slide" type="prismatic"><parent link="bracket"/><child link="slider"/>
    <origin xyz=".1 0 .3"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
  <link name="tool"><inertial><mass value="1"/>
    <inertia ixx=".02" iyy=".02" izz=".03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="flange"/>
  <joint name="flange" type="fixed"><parent link="slider"/><child link="flange"/>
    <origin xyz="0 0 .2" rpy="0 0 1"/></joint>
  <joint name="tool_mount" type="fixed"><parent link="flange"/><child link="tool"/>
    <origin xyz="0 .1 0" rpy="1 0 0"/></joint>
  <link name="wrist"><inertial><mass value="1"/>
    <inertia ixx=".02" iyy=".02" izz=".03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="a_roll" type="revolute"><parent link="upper"/><child link="wrist"/>
    <origin xyz="0 0 .5"/><axis xyz="1 0 0"/><limit effort="5" velocity="2"/></joint>
</robot>"""


def perturbed(lib: Library, seed: int = 1, size: float = 0.1) -> np.ndarray:
    """A consistent π that is not the URDF's: λ moved at random."""
    lam = lib.lam_from_pi(lib.nearest_realisable(lib.pi0))
    noise = np.random.default_rng(seed).normal(size=lam.size)
    return lib.pi_from_lam(lam + size * noise)


def link(text: str, name: str) -> Element:
    return next(x for x in fromstring(text).findall("link") if x.get("name") == name)
