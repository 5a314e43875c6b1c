"""What to follow at a tick, compiled."""
