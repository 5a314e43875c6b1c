"""The robot at one instant: dynamics, frames, support polygon."""
