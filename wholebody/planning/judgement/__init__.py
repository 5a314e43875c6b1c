"""What a chunk asks of the robot, held against every bound of a plan, without simulating it."""
