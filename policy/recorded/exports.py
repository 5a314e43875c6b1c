"""Exports of other tools that are not read, each with the command that converts it; no pickle is opened."""

from __future__ import annotations

from pathlib import Path

from policy.archive import array_names
from policy.reading import ReadingError

MOTION = (
    "python -c \"import numpy as np; d = {load}; np.savetxt('motion.csv', np.hstack([d['root_pos'], d['root_rot'], "
    "d['dof_pos']]), fmt='%.6f', delimiter=',')\""
)
"""Writes a motion of GMR's names (root position, quaternion x y z w, joints in motor order) as 36 columns."""
PICKLES = (".pkl", ".pickle", ".pt", ".pth", ".joblib")
HUMAN = ("poses", "trans")
"""Arrays of a person's motion: AMASS's, SMPL's."""


def advice(path: str | Path) -> str:
    """Command that converts a file or folder of another tool; empty if the tool is unknown."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in PICKLES:
        load = f"__import__('pickle').load(open('{path.name}', 'rb'))"
        return (
            "a pickle runs whatever is in it when it is opened, so it is not; if you trust it, where it was written: "
            + MOTION.replace("{load}", load)
            + ", then --csv-fps with its rate"
        )
    if suffix == ".json" and path.name == "data.json":
        return f"an episode of xr_teleoperate is read by its folder, {path.parent.absolute()}"
    return ""


def of_a_person(path: Path) -> str:
    """What makes a motion of the G1 of an archive that has a person's; empty of any other."""
    try:
        names = array_names(path)
    except (OSError, ReadingError):
        return ""
    if not set(HUMAN) <= set(names):
        return ""
    return (
        "it is the motion of a person (SMPL), not of a G1: retarget it first, with GMR "
        "(python scripts/smplx_to_robot.py --smplx_file FILE --robot unitree_g1 --save_path motion.pkl)"
    )
