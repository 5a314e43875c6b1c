"""Controllers by name: ours, placo's dynamics, inverse kinematics alone."""
