"""Forward and inverse kinematics of arms and legs, numpy only."""
