"""The robot at one instant: dynamics, frames, support polygon.

Begin with `wholebody.robot.state.Robot`.
"""
