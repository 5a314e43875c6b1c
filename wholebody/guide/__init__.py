"""Costs of action chunks with gradients, for policies that are guided or trained by what the robot can do.

Begin with `wholebody.guide.guide.Guide`.
"""
