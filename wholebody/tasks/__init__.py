"""Tasks: what the robot should do, as weighted rows on the acceleration."""
