"""What a column is, from the name that a dataset or a robot gives it and the part of the vector that it is in.

Unitree writes ``kLeftShoulderPitch``, a URDF ``left_shoulder_pitch_joint``, LeRobot robots ``left_shoulder_pitch.pos``
or ``.q``, others ``dof_pos.left_hip_pitch_joint``, or ``shoulder_pitch`` within a part
``left_arm``. What is known not to be a joint position is left out for a reason that is said; anything else is refused
by its caller.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from models import g1
from models.spec import RobotSpec
from policy.action_spec.slot import FOREIGN_HANDS

GRASPS = ("left_grasp", "right_grasp")
"""Canonical names of the two gripper columns."""
SIDES = ("left", "right")
_UNITREE_ARM = ("ShoulderPitch", "ShoulderRoll", "ShoulderYaw", "Elbow", "WristRoll", "WristPitch", "WristYaw")
_UNITREE_ARMS = tuple(f"k{side}{joint}" for side in ("Left", "Right") for joint in _UNITREE_ARM)
_UNITREE_LEFT_HAND = ("Thumb0", "Thumb1", "Thumb2", "Middle0", "Middle1", "Index0", "Index1")
_UNITREE_RIGHT_HAND = ("Thumb0", "Thumb1", "Thumb2", "Index0", "Index1", "Middle0", "Middle1")
UNITREE_DEX3 = (
    *_UNITREE_ARMS,
    *(f"kLeftHand{joint}" for joint in _UNITREE_LEFT_HAND),
    *(f"kRightHand{joint}" for joint in _UNITREE_RIGHT_HAND),
)
"""The 28 columns of the datasets ``unitreerobotics/G1_Dex3_*``: the layout joint28."""
UNITREE_DEX1 = (*_UNITREE_ARMS, "kLeftGripper", "kRightGripper")
"""The 16 columns of the datasets ``unitreerobotics/G1_Dex1_*``: the layout joint16."""

FOREIGN_FINGERS = tuple(f"{side}_hand_{finger}" for side in SIDES for hand in FOREIGN_HANDS.values() for finger in hand)
"""Canonical names of the fingers of other hands."""

_KNOWN: dict[str, str] = {
    **{f"{side}{word}": f"{side}_grasp" for side in SIDES for word in ("gripper", "grasp", "gripper0")},
    **{name.replace("_", ""): name for name in FOREIGN_FINGERS},
    **{f"{side}hand{word}": f"{side}_hand_{finger}" for side in SIDES for word, finger in {
        "little": "pinky", "thumbrotate": "thumb_rotation", "thumbrot": "thumb_rotation"}.items()},
}  # fmt: skip
DOUBLED = "doubled"
"""Part of a column whose joint another feature has too."""
_LEFT_OUT = {
    r"^doubled$": "another feature has it too",
    r"^unnamed_\d+$": "no part of modality.json has it",
    r"^(left|right)_?hand_?\d$": "of a hand that is not named",
    r"(^|[._/ ])(eef?|end_?effector|tcp|wrist_?pose|hand_?pose)([._/ ]|$)|^k?(left|right)ee[a-z]": "a pose of the "
    "hand, and joints are read",
    r"(^|[._/ ])(dof_?vel|q?vel|dq|velocity|joint_?vel)([._/ ]|$)": "a velocity",
    r"(^|[._/ ])(tau|torques?|efforts?|currents?|dof_?tau)([._/ ]|$)": "a torque",
}
"""Names of what is no joint position, with what is said of it."""
_OF_BASE = r"(^|[._/ ])(root|base|pelvis|torso|navigate|nav|cmd|height|imu|chassis)([._/ 0-9]|$)"
"""Names of what is of the base, where they are no joint."""
_BESIDE = frozenset(
    re.findall(
        r"\w+",
        "joint joints arm arms leg legs body motor dex3 pos position positions q qpos angle rad target cmd command "
        "goal desired state action robot robot0 g1 unitree main follower leader",
    )
)
"""Words beside a joint's name that say nothing of which joint it is."""


@dataclass(frozen=True)
class Meaning:
    """What a column is.

    Attributes:
        name: Canonical name: a joint of the G1, ``left_grasp``, a finger such as ``left_hand_pinky``; empty if it is
            left out, or not known.
        reason: Why it is left out; empty if it is not.
    """

    name: str = ""
    reason: str = ""


def meaning(name: str, part: str = "", robot: RobotSpec | None = None) -> Meaning:
    """Meaning of a column by its name, else by its name within a part of the vector that names its side.

    Args:
        name: Of the column.
        part: Of the vector; empty if there are none.
        robot: Whose joints; the G1's with Dex3 hands if None.
    """
    return _meaning(name, part, (robot or g1()).joint_names)


@lru_cache(maxsize=4096)
def _meaning(name: str, part: str, joints: tuple[str, ...]) -> Meaning:
    known = _known(joints)
    for pattern, reason in _LEFT_OUT.items():
        if any(re.search(pattern, _words(text)) for text in (name, part) if text):
            return Meaning(reason=reason)
    stem = re.sub(r"\.(pos|q|qpos|position)$", "", name)
    for text in (stem, re.split(r"[./]", stem)[-1]):
        if found := known.get(_key(text)):
            return Meaning(found)
    last, side = _key(re.split(r"[./]", stem)[-1]), _side(part)
    if side:
        for text in (f"{side}{last}", f"{side}hand{last}"):
            if found := known.get(text):
                return Meaning(found)
    if found := _among_words(name, known):
        return Meaning(found)
    if any(re.search(_OF_BASE, _words(text)) for text in (name, part) if text):
        return Meaning(reason="of the base, which stands")
    return Meaning()


def _among_words(name: str, known: Mapping[str, str]) -> str:
    """Canonical name of what words among others say, in any order of side and joint; empty if they say nothing."""
    words = [word for word in re.findall(r"[a-z0-9]+", _words(name)) if word not in _BESIDE]
    sides = [{"l": "left", "r": "right"}.get(word, word) for word in words if word in (*SIDES, "l", "r")]
    if len(sides) > 1:
        return ""
    rest = "".join(word for word in words if word not in (*SIDES, "l", "r"))
    return next((known[key] for key in (f"{''.join(sides)}{way}{rest}" for way in ("", "hand")) if key in known), "")


@lru_cache(maxsize=16)
def _known(joints: tuple[str, ...]) -> dict[str, str]:
    """Canonical names by their letters."""
    return {_key(joint): joint for joint in joints} | _KNOWN


def flat_names(names: object) -> tuple[str, ...]:
    """Names of columns in any of the forms that LeRobot datasets have; empty if there are none.

    A list, a list in a list, an object with one list, an object of lists (a part each), or of the columns' numbers.
    """
    return tuple(name for _, name in parted_names(names))


def parted_names(names: object) -> tuple[tuple[str, str], ...]:
    """Part and name of each column; empty if there are none, and where there are parts of equal names."""
    while isinstance(names, Mapping) and len(names) == 1 and not isinstance(next(iter(names.values())), int):
        names = next(iter(names.values()))
    if isinstance(names, Mapping):
        return _of_object(names)
    if isinstance(names, Sequence) and len(names) == 1 and not isinstance(names[0], str):
        return parted_names(names[0])
    if isinstance(names, Sequence) and not isinstance(names, str) and all(isinstance(name, str) for name in names):
        return tuple(("", name) for name in names)
    return ()


def says_nothing(names: Sequence[str], dim: int) -> bool:
    """Whether names are only numbers behind one word, as ``action_0``, or one word for all columns."""
    if not names or (len(names) == 1 and dim > 1):
        return True
    stems = {re.sub(r"\d+$", "", name) for name in names}
    return len(names) > 1 and len(stems) == 1 and all(re.search(r"\d$", name) for name in names)


def _of_object(names: Mapping) -> tuple[tuple[str, str], ...]:
    if all(str(key).isdecimal() and isinstance(value, str) for key, value in names.items()):
        names = {value: int(key) for key, value in names.items()}
    if all(type(value) is int for value in names.values()):
        by_number = sorted(names, key=lambda name: names[name])
        in_order = [names[name] for name in by_number] == list(range(len(names)))
        return tuple(("", str(name)) for name in by_number) if in_order else ()
    parts = [(str(part), flat_names(value)) for part, value in names.items()]
    if not all(inner for _, inner in parts):
        return ()
    found = tuple((part, name) for part, inner in parts for name in inner)
    # Parts that repeat each other's names, and do not name a side, do not say which is which.
    sided = all(_side(part) for part, _ in found) or len({name for _, name in found}) == len(found)
    return found if sided and len(set(found)) == len(found) else ()


def _words(text: str) -> str:
    """Text in lower case, words of camel case apart."""
    return re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", "_", text).lower() if not text.startswith("k") else text.lower()


def _side(part: str) -> str:
    words = re.split(r"[^a-z0-9]+", _words(part))
    sides = [side for side in SIDES if side in words or side[0] in words]
    return sides[0] if len(sides) == 1 else ""


def _key(name: str) -> str:
    """Letters and digits in lower case, without ``k`` in front and ``_joint`` behind, the side written out."""
    if re.match(r"k[A-Z]", name):
        name = name[1:]
    name = re.sub(r"^([LlRr])_", lambda found: {"l": "left", "r": "right"}[found[1].lower()] + "_", name)
    return re.sub(r"[^a-z0-9]", "", name.lower()).removesuffix("joint")
