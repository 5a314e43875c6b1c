"""Exports of other tools that are not read, and the line that makes of each what is: nothing in them is opened."""

from __future__ import annotations

from pathlib import Path

MOTION = (
    "python -c \"import numpy as np; d = {load}; np.savetxt('motion.csv', np.hstack([d['root_pos'], d['root_rot'], "
    "d['dof_pos']]), fmt='%.6f', delimiter=',')\""
)
"""Writes a motion of GMR's names (root position, quaternion x y z w, joints in motor order) as 36 columns."""
PICKLES = (".pkl", ".pickle", ".pt", ".pth", ".joblib")
HDF5 = (".h5", ".hdf5")
RETARGETED = ("root_pos", "root_rot", "dof_pos", "root_trans_offset", "dof", "poses", "trans")
"""Arrays of retargeted motions: GMR's, PHC's, AMASS's."""


def advice(path: str | Path) -> str:
    """What makes an input of a file or folder of another tool; empty where it is none that is known."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in PICKLES:
        load = f"__import__('pickle').load(open('{path.name}', 'rb'))"
        return (
            "a pickle runs whatever is in it when it is opened, so it is not; if you trust it, where it was written: "
            + MOTION.replace("{load}", load)
            + ", then --csv-fps with its rate"
        )
    if suffix in HDF5:
        return "HDF5 is not read: LeRobot's porting scripts write such episodes as a dataset folder, which is"
    if suffix == ".json" or (path / "data.json").is_file() or any(path.glob("episode_*/data.json")):
        return (
            "JSON episodes of xr_teleoperate are not read: unitree_lerobot's converter writes them as a dataset folder "
            "(python unitree_lerobot/utils/convert_unitree_json_to_lerobot.py --raw-dir FOLDER --robot_type "
            "Unitree_G1_Dex3), which is"
        )
    return ""


def retargeted(names: object, file: str) -> str:
    """What makes a motion of an archive whose arrays have these names; empty where they are no motion's."""
    found = sorted({name for name in RETARGETED if name in str(names)})
    if not found:
        return ""
    load = f"np.load('{file}')"
    return f"it looks like a retargeted motion ({', '.join(found)}): {MOTION.replace('{load}', load)}"
