"""References: from the poses of a chunk, at its rate, to a C2 motion at the control rate.

`HandPath` goes through the knots and continues what is being commanded; at the control tick the kernels of
`wholebody.reference.kernels` look it up, slow down along it (`path_clock`) and keep to the limits whatever comes
(`smoother`), from the state of a `ReferenceSmoother`.
"""

from wholebody.reference.hand_limits import HandLimits, MotionLimits
from wholebody.reference.hand_path import HandPath
from wholebody.reference.join import Join
from wholebody.reference.layout import HandMotion, rest_row, time_scaled
from wholebody.reference.smoother import ReferenceSmoother

__all__ = [
    "HandLimits",
    "HandMotion",
    "HandPath",
    "Join",
    "MotionLimits",
    "ReferenceSmoother",
    "rest_row",
    "time_scaled",
]
