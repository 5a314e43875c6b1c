"""Headers of public G1 datasets, and others of their kinds, written as folders; sources in the comment of each."""

import json

import numpy as np

from models import g1
from policy import Anchor
from tests.support.written_datasets import write_dataset

BODY_JOINTS = g1().body_joints
LEFT_HAND_JOINTS, RIGHT_HAND_JOINTS = (g1().tool(side).finger_joints for side in ("left", "right"))
ARM = ["shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw"]
LEG = ["hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll"]
UNITREE_ARM = ["ShoulderPitch", "ShoulderRoll", "ShoulderYaw", "Elbow", "WristRoll", "WristPitch", "WristYaw"]
UNITREE_LEG = ["HipPitch", "HipRoll", "HipYaw", "Knee", "AnklePitch", "AnkleRoll"]
SIX = ["Pinky", "Ring", "Middle", "Index", "ThumbBend", "ThumbRotation"]
LEFT_DEX, RIGHT_DEX = list(LEFT_HAND_JOINTS), list(RIGHT_HAND_JOINTS)
UNITREE_DEX = {joint: "".join(["k", *(word.capitalize() for word in joint.removesuffix("_joint").split("_"))])
               for joint in (*LEFT_DEX, *RIGHT_DEX)}  # fmt: skip
WAIST = ["waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint"]
ISAAC = [0, 6, 12, 1, 7, 13, 2, 8, 14, 3, 9, 15, 22, 4, 10, 16, 23, 5, 11, 17, 24, 18, 25, 19, 26, 20, 27, 21, 28]
ANCHOR = Anchor.nominal()
NEUTRAL = dict(zip((*LEFT_HAND_JOINTS, *RIGHT_HAND_JOINTS), g1().hand_neutral, strict=True))
STANCE = dict(zip(BODY_JOINTS, ANCHOR.q_body, strict=True))


def joints(side, part):
    return [f"{side}_{name}_joint" for name in part]


LARM, RARM, LLEG, RLEG = joints("left", ARM), joints("right", ARM), joints("left", LEG), joints("right", LEG)
KL, KR = [f"kLeft{name}" for name in UNITREE_ARM], [f"kRight{name}" for name in UNITREE_ARM]
KBODY = [f"k{s}{n}" for s in ("Left", "Right") for n in UNITREE_LEG] + [
    "kWaistYaw",
    "kWaistRoll",
    "kWaistPitch",
    *KL,
    *KR,
]
BODY = [*LLEG, *RLEG, *WAIST, *LARM, *RARM]
KDEX = [UNITREE_DEX[name] for name in (*LEFT_DEX, *RIGHT_DEX)]
FINGERS6 = [f"{side}_hand_{n}" for side in ("left", "right") for n in ("pinky", "ring", "middle", "index", "thumb_bend",
            "thumb_rotation")]  # fmt: skip
SIX12 = [[f"k{side}Hand{name}" for name in SIX] for side in ("Left", "Right")]
REVERSED = [name for hand in (LEFT_DEX, RIGHT_DEX) for name in sorted(hand, reverse=False)[::-1]]
PIN43 = [*LLEG, *RLEG, *WAIST, *LARM, *sorted(LEFT_DEX), *RARM, *sorted(RIGHT_DEX)]
EE = ["kLeftEEX", "kLeftEEY", "kLeftEEZ", "kLeftEER", "kLeftEEP", "kLeftEEY"]
YAW_FIRST = [*ARM[:4], "wrist_yaw", "wrist_roll", "wrist_pitch"]
MODALITY = {"left_leg": (0, 6), "right_leg": (6, 12), "waist": (12, 15), "left_arm": (15, 22), "left_hand": (22, 29),
            "right_arm": (29, 36), "right_hand": (36, 43)}  # fmt: skip

# name: (features of the action as key -> (what each column is, names as meta/info.json has them), settings)
HEADERS = {
    "dex3, nested": ({"action": ([*LARM, *RARM, *LEFT_DEX, *RIGHT_DEX], [[*KL, *KR, *KDEX]])}, {"fps": 30.0}),
    "dex3, motors": (
        {"action": ([*LARM, *RARM, *LEFT_DEX, *RIGHT_DEX], {"motors": [*KL, *KR, *KDEX]})},
        {"version": "v2.1"},
    ),
    "dex3, fingers reversed": (
        {"action": ([*LARM, *RARM, *REVERSED], [*KL, *KR, *(UNITREE_DEX[name] for name in REVERSED)])},
        {"version": "v2.0", "precision": "float64"},
    ),
    "43 in Pinocchio's order": ({"action": (PIN43, PIN43)}, {"fps": 20}),
    "inspire, hands last": ({"action": ([*LARM, *RARM, *FINGERS6], [*KL, *KR, *SIX12[0], *SIX12[1]])}, {}),
    "inspire, by side": (
        {"action": ([*LARM, *FINGERS6[:6], *RARM, *FINGERS6[6:]], [*KL, *SIX12[0], *KR, *SIX12[1]])},
        {},
    ),
    "dex1, split, no side, yaw first": (
        {
            "action.left_arm": (joints("left", YAW_FIRST), YAW_FIRST),
            "action.left_gripper": (["left_grasp"], ["gripper"]),
            "action.right_arm": (joints("right", YAW_FIRST), YAW_FIRST),
            "action.right_gripper": (["right_grasp"], ["gripper"]),
        },
        {},
    ),
    "all split, names twice": (
        {
            "action.left_arm": (LARM, KL),
            "action.right_arm": (RARM, KR),
            "action.left_gripper": (["left_grasp"], ["kLeftGripper"]),
            "action.right_gripper": (["right_grasp"], ["kRightGripper"]),
            "action.left_ee": ([None] * 6, EE),
            "action.body": (BODY, KBODY),
        },
        {"version": "v2.1"},
    ),
    "43 without names, modality.json": (
        {"action": (PIN43, None), "action.eef": ([None] * 14, None)},
        {
            "fps": 50,
            "files": {
                "modality.json": json.dumps(
                    {"action": {part: {"start": start, "end": end} for part, (start, end) in MODALITY.items()}}
                )
            },
        },
    ),
    "an object of four lists": (
        {
            "action": (
                [*LARM, *RARM, *LEFT_DEX, *RIGHT_DEX],
                {"left_arm": LARM, "right_arm": RARM, "left_hand": LEFT_DEX, "right_hand": RIGHT_DEX},
            )
        },
        {},
    ),
    "an object of lists without sides": (
        {
            "action": (
                [*LARM, *RARM, "left_grasp", "right_grasp"],
                {"left_arm": ARM, "right_arm": ARM, "left_hand": ["gripper"], "right_hand": ["gripper"]},
            )
        },
        {},
    ),
    "an object of numbers": ({"action": ([*RARM, *LARM], {name: i for i, name in enumerate([*RARM, *LARM])})}, {}),
    "prefixes, Isaac's order": (
        {"action": ([BODY[i] for i in ISAAC], [f"dof_pos.{BODY[i]}" for i in ISAAC])},
        {"fps": 50},
    ),
    "prefix of the feature": ({"action": ([*LARM, *RARM], [f"action.{name}" for name in (*LARM, *RARM)])}, {}),
    "lerobot's own": ({"action": ([*LARM, *RARM], [f"{n.removesuffix('_joint')}.pos" for n in (*LARM, *RARM)])}, {}),
    "brainco": (
        {
            "action": (
                [
                    *LARM,
                    *RARM,
                    *(
                        f"{side}_hand_{n}"
                        for side in ("left", "right")
                        for n in ("thumb", "thumb_aux", "index", "middle", "ring", "pinky")
                    ),
                ],
                [
                    *KL,
                    *KR,
                    *(
                        f"k{side}Hand{n}"
                        for side in ("Left", "Right")
                        for n in ("Thumb", "ThumbAux", "Index", "Middle", "Ring", "Pinky")
                    ),
                ],
            )
        },
        {},
    ),
    "23 joints": (
        {"action": ([*LLEG, *RLEG, WAIST[0], *LARM[:5], *RARM[:5]], [*LLEG, *RLEG, WAIST[0], *LARM[:5], *RARM[:5]])},
        {},
    ),
    "split, L_ and R_, a velocity beside": (
        {
            "action.arms": ([*LARM, *RARM], [f"{s}_{n}" for s in "LR" for n in ARM]),
            "action.base": ([None] * 3, ["vx", "vy", "yaw_rate"]),
        },
        {},
    ),
    "openpi's key": ({"actions": ([*LARM, *RARM], [*LARM, *RARM])}, {}),
}


def angles(k, names):
    """Joint angles by name at a frame: the stance, arms that move a little, fingers and grippers half closed."""
    rng = np.random.default_rng(6)
    found = dict(STANCE)
    for name in sorted({*LARM, *RARM}):
        found[name] += 0.15 * rng.uniform(-1.0, 1.0) * np.sin(0.1 * k)
    if "left_wrist_pitch_joint" not in names and "left_arm" not in names:
        for side in ("left", "right"):
            found |= {f"{side}_wrist_pitch_joint": 0.0, f"{side}_wrist_yaw_joint": 0.0}
    return found


def column(name, posture):
    if name is None:
        return 0.7
    if name in posture:
        return posture[name]
    return 2.0 if name.endswith("_grasp") else NEUTRAL.get(name, 0.5)


def written(folder, header, frames=8):
    features, settings = HEADERS[header]
    every = [name for columns, _ in features.values() for name in columns]
    postures = [angles(k, every) for k in range(frames)]
    episode = {}
    for key, (columns, _) in features.items():
        values = np.array([[column(name, posture) for name in columns] for posture in postures])
        episode[key] = values
        state = key.replace("actions", "state") if key == "actions" else key.replace("action", "observation.state")
        episode[state] = values
    names = {key: said for key, (_, said) in features.items()}
    names |= {key.replace("actions", "state") if key == "actions" else key.replace("action", "observation.state"): said
              for key, said in names.items()}  # fmt: skip
    settings = dict(settings)
    if files := settings.get("files"):
        said = json.loads(files["modality.json"])
        settings["files"] = {"modality.json": json.dumps(said | {"state": said["action"]})}
    return write_dataset(folder, [episode, episode], names, **settings), postures
