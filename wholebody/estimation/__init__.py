"""From sensor readings to the state of the robot."""
