"""Joint friction, linear in its coefficients: columns of the motion times φ."""
