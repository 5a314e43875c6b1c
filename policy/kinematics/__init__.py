"""Forward and inverse kinematics of the arms, numpy only."""
