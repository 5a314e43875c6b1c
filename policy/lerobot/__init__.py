"""LeRobot's checkpoints as policies; the only place that imports torch and lerobot.

Begin with `policy.lerobot.policy.LeRobotPolicy`; what a checkpoint may name is in `policy.lerobot.trust`.
"""
