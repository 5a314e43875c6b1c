"""Where the robot will be when a plan takes over, and hands that do not wait for one."""
