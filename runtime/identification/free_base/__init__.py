"""Identification of a robot with a free base from motion, torques and contact wrenches."""
