"""Fleet: many units of one type of robot, from compressed statistics to one hierarchical prior."""
