"""How likely a chunk is to make the robot fall as given, or to be followed: from the fast check's numbers.

Begin with `wholebody.verdict.calibration.model.Calibration`; `docs/calibration.md` says what its numbers mean.
"""
