"""What keeps the start of a command short: no compilation of classes, imports at first use."""
