"""Inverse kinematics alone: velocities with hard feet, the centre of mass over the soles, and joint limits."""
