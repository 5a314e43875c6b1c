"""References: from the poses of a chunk, at its rate, to a C2 motion at the control rate.

`HandPath` goes through the knots and continues what is being commanded, `PathClock` slows down along it,
`ReferenceSmoother` guarantees the caps whatever it is given, `seam` measures where pieces meet.
"""

from wholebody.reference.hand_limits import HandLimits, MotionLimits
from wholebody.reference.hand_path import HandPath
from wholebody.reference.join import Join
from wholebody.reference.layout import HandMotion, rest_row
from wholebody.reference.path_clock import PathClock, time_scaled
from wholebody.reference.seam import Seam, path_seam, seam
from wholebody.reference.smoother import ReferenceSmoother
from wholebody.reference.warm_up import warm_up

__all__ = [
    "HandLimits",
    "HandMotion",
    "HandPath",
    "Join",
    "MotionLimits",
    "PathClock",
    "ReferenceSmoother",
    "Seam",
    "path_seam",
    "rest_row",
    "seam",
    "time_scaled",
    "warm_up",
]
