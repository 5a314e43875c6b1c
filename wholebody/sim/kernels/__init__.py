"""Motors and state of the plant, compiled."""
