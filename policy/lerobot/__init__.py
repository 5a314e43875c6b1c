"""LeRobot's checkpoints as policies; the only place that imports torch and lerobot."""
