"""Recordings in other forms than LeRobot's: JSON episodes of xr_teleoperate, HDF5, retargeted motions as ``.npz``."""

import json

import numpy as np

from models import g1
from policy import Anchor
from policy.geometry.rotations import matrix_to_quaternion
from policy.suspicion.orders import ISAAC

ROBOT, ANCHOR = g1(), Anchor.nominal()
ARMS = [f"{side}_{name}_joint" for side in ("left", "right") for name in (
    "shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")]  # fmt: skip
LEFT_HAND, RIGHT_HAND = (list(ROBOT.tool(side).finger_joints) for side in ("left", "right"))
JOINT28 = [*ARMS, *LEFT_HAND, *RIGHT_HAND]


def posture(k):
    """Angles of every joint by name at a frame: the stance, with arms that move and fingers that do not."""
    found = dict(zip(ROBOT.body_joints, ANCHOR.q_body, strict=True))
    found |= dict(zip((*LEFT_HAND, *RIGHT_HAND), ROBOT.hand_neutral, strict=True))
    rng = np.random.default_rng(6)
    for name in ARMS:
        found[name] += 0.15 * rng.uniform(-1.0, 1.0) * np.sin(0.1 * k)
    return found


def rows(names, frames):
    """Angles of joints (frames, n)."""
    return np.array([[posture(k)[name] for name in names] for k in range(frames)])


def write_xr(folder, *, episodes=2, frames=8, fps=30, hands=None):
    """Episodes as xr_teleoperate writes them; hands are Dex3's unless numbers (frames, n) of each are given."""
    left, right = (rows(LEFT_HAND, frames), rows(RIGHT_HAND, frames)) if hands is None else hands
    arms, body = rows(ARMS, frames), rows(ROBOT.body_joints, frames)

    def part(values):
        return {"qpos": values.tolist(), "qvel": [], "torque": []}

    for number in range(episodes):
        steps = []
        for k in range(frames):
            parts = {"left_arm": part(arms[k, :7]), "right_arm": part(arms[k, 7:]), "left_ee": part(left[k]),
                     "right_ee": part(right[k])}  # fmt: skip
            steps.append({"idx": k, "colors": {"color_0": f"colors/{k:06d}_color_0.jpg"}, "depths": {},
                          "states": parts | {"body": {"qpos": body[k].tolist()}},
                          "actions": parts | {"body": {"qpos": [0.0, 0.0, 0.0]}}, "tactiles": {}})  # fmt: skip
        names = {key: [] for key in ("left_arm", "left_ee", "right_arm", "right_ee", "body")}
        image = {"width": 640, "height": 480, "fps": fps}
        about = {"version": "1.0.0", "author": "unitree", "image": image, "joint_names": names}
        file = folder / f"episode_{number:04d}" / "data.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps({"info": about, "text": {"goal": "reach"}, "data": steps}, indent=4))
    return folder


def write_robomimic(file, *, demonstrations=2, frames=8, names=JOINT28, env=None):
    """A file of demonstrations with the names of their columns and the rate of their environment."""
    import h5py

    with h5py.File(file, "w") as out:
        data = out.create_group("data")
        data.attrs["env_args"] = json.dumps(env or {"env_name": "reach", "env_kwargs": {"control_freq": 20}})
        for number in range(demonstrations):
            demo = data.create_group(f"demo_{number}")
            demo.create_dataset("actions", data=rows(JOINT28, frames), compression="gzip")
            demo.create_dataset("obs/joint_pos", data=rows(JOINT28, frames))
            demo.create_dataset("obs/table_cam", data=np.zeros((frames, 4, 4, 3), np.uint8))
            for key in ("actions", "obs/joint_pos"):
                demo[key].attrs["joint_names"] = names
    return file


def write_aloha(folder, *, episodes=2, frames=8, fps=None):
    """A file an episode, without names; without a rate, too, as ALOHA writes them."""
    import h5py

    folder.mkdir(parents=True, exist_ok=True)
    for number in range(episodes):
        with h5py.File(folder / f"episode_{number}.hdf5", "w") as out:
            out["action"], out["observations/qpos"] = rows(JOINT28, frames), rows(JOINT28, frames)
            if fps:
                out.attrs["fps"] = fps
    return folder


def motion_arrays(frames=20):
    """Arrays of the same motion as GMR, PHC, Isaac Lab and BeyondMimic name them, and a table of 36 columns."""
    q, T = rows(ROBOT.body_joints, frames), ANCHOR.T_world_base
    p = np.tile(T[:3, 3], (frames, 1))
    xyzw, wxyz = (np.tile(matrix_to_quaternion(T[:3, :3], order), (frames, 1)) for order in ("xyzw", "wxyz"))
    far = p + 9.0
    return {
        "gmr": {"root_pos": p, "root_rot": xyzw, "dof_pos": q, "fps": 60, "local_body_pos": np.zeros((frames, 3))},
        "phc": {"root_trans_offset": p, "root_rot": xyzw, "dof": q, "pose_aa": np.zeros((frames, 30, 3))},
        "isaac": {"dof_positions": q[:, ::-1], "dof_names": np.array(ROBOT.body_joints[::-1]), "fps": 60,
                  "body_names": np.array(["torso_link", "pelvis"]), "body_positions": np.stack([far, p], 1),
                  "body_rotations": np.stack([wxyz, wxyz], 1)},
        "beyondmimic": {"joint_pos": q[:, list(ISAAC)], "joint_vel": 0.0 * q, "fps": np.array([60]),
                        "body_pos_w": np.stack([p, far], 1), "body_quat_w": np.stack([wxyz, wxyz], 1)},
    }, np.hstack([p, xyzw, q])  # fmt: skip
