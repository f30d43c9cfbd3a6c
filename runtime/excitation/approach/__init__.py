"""The way from one pose to another: collision-free, under the limits of a motion, certified."""
