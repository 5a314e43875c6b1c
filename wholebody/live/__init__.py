"""The closed loop on the wall clock: plant, control loop, planner and policy, each for itself."""
