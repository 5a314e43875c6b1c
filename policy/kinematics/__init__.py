"""Forward and inverse kinematics of arms and legs, numpy only.

Begin with `policy.kinematics.forward.Kinematics`.
"""
