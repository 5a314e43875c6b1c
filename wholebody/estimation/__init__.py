"""From sensor readings to the state of the robot.

Begin with `wholebody.estimation.state_estimator.StateEstimator`.
"""
