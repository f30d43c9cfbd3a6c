"""What keeps the start of a command short: imports at first use."""
