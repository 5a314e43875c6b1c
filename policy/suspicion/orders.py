"""Other orders that joint columns come in: for each, where the numbers of a column would have to go.

An order is told by how well the numbers fit what joints do: their ranges, and the side and the bend of a person's
joints (elbows and knees bend one way, arms hang outward). A permutation that fits much better than the names is a
hypothesis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from models.spec import RobotSpec

TYPICAL: dict[str, tuple[float, float]] = {
    "hip_pitch": (-0.2, 0.4), "hip_roll": (0.2, 0.3), "hip_yaw": (0.1, 0.3), "knee": (0.4, 0.4),
    "ankle_pitch": (-0.1, 0.3), "ankle_roll": (-0.1, 0.15), "waist_yaw": (0.0, 0.3), "waist_roll": (0.0, 0.2),
    "waist_pitch": (0.0, 0.2), "shoulder_pitch": (-0.2, 0.6), "shoulder_roll": (0.5, 0.5),
    "shoulder_yaw": (-0.2, 0.5), "elbow": (0.5, 0.7), "wrist_roll": (0.0, 0.5), "wrist_pitch": (0.0, 0.4),
    "wrist_yaw": (0.0, 0.4),
}  # fmt: skip
"""Middle and spread of joints of people's motions on the G1 [rad], of the left side; measured: means and deviations of
nine recorded motions (karate, dances; `tests/studies/suspicion.py` has which), rounded, wrists widened."""
MIRRORED = ("hip_roll", "hip_yaw", "ankle_roll", "waist_yaw", "waist_roll", "shoulder_roll", "shoulder_yaw",
            "wrist_roll", "wrist_yaw")  # fmt: skip
"""Joints whose sign is the other one on the right side."""
FINGER = 0.8
"""Spread of a finger around the middle of its range [rad]; chosen: half of a range."""
PAST_RANGE, WEIGHT = 0.1, 6.0
"""How far past its range a joint counts as out of it [rad], and what that counts for; chosen: as `ORDER_MARGIN` with a
third of it, and twice the largest share of a column that is in range."""
CAP = 3.0
"""Largest share of a single number in the misfit; chosen, so that one wild joint does not decide."""
ISAAC = (0, 6, 12, 1, 7, 13, 2, 8, 14, 3, 9, 15, 22, 4, 10, 16, 23, 5, 11, 17, 24, 18, 25, 19, 26, 20, 27, 21, 28)
"""Motor number of each of the 29 joints in breadth-first order, as Isaac Lab lists them."""


def candidates(names: Sequence[str], robot: RobotSpec) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Other names for the columns: code of the hypothesis, what it says, and the name of each column.

    Args:
        names: Canonical name of each column; empty where it is no joint.
        robot: The robot.
    """
    body = robot.body_joints
    there = [name for name in names if name]
    if len(body) == len(ISAAC) and all(name in there for name in body):
        in_motor_order = [name for name in names if name in body]
        isaac = iter([body[i] for i in ISAAC])
        if in_motor_order == list(body):
            yield "isaac_order", "the joints are in breadth-first order, Isaac's", _with(names, body, isaac)
        elif in_motor_order == [body[i] for i in ISAAC]:
            yield "motor_order", "the joints are in motor order, not in Isaac's", _with(names, body, iter(body))
    if fingers := [name for name in there if "_hand_" in name and name in robot.joint_names]:
        yield from _of_fingers(names, fingers)
        if len(there) > len(fingers):
            yield from _pinocchio(names, robot)
    swap = {name: _other(name) for name in there if name.startswith(("left_", "right_"))}
    if swap and all(other in there for other in swap.values()):
        swapped = tuple(swap.get(name, name) for name in names)
        yield "left_right", "left and right are exchanged", swapped
    if len(there) == len(names) > 2:
        yield "columns_rolled", "the columns are rolled by one", (*names[1:], names[0])
        yield "columns_rolled_back", "the columns are rolled back by one", (names[-1], *names[:-1])


def _with(names: Sequence[str], group: Sequence[str], replaced: Iterator[str]) -> tuple[str, ...]:
    return tuple(next(replaced) if name in group else name for name in names)


def _of_fingers(names: Sequence[str], fingers: list[str]) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Fingers in Pinocchio's order where they are called in the motors', hand by hand."""
    renamed = list(names)
    for side in ("left", "right"):
        hand = [name for name in fingers if name.startswith(f"{side}_")]
        for name, other in zip(hand, sorted(hand), strict=True):
            renamed[names.index(name)] = other
    if renamed != list(names):
        yield "finger_order", "fingers are in Pinocchio's order: index, middle, thumb", tuple(renamed)


def _pinocchio(names: Sequence[str], robot: RobotSpec) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """All joints in Pinocchio's order, each hand behind its arm."""
    order = []
    for part in ("left_leg", "right_leg", "waist"):
        order += [robot.joint_names[i] for i in robot.limbs[part]]
    for side in ("left", "right"):
        order += [robot.joint_names[i] for i in robot.limbs[f"{side}_arm"]]
        order += sorted(robot.tool(side).finger_joints)
    order = [name for name in order if name in names]
    if len(order) == len(names) and order != list(names):
        yield "pinocchio_order", "the joints are in Pinocchio's order, each hand behind its arm", tuple(order)


def _other(name: str) -> str:
    side, _, rest = name.partition("_")
    return f"{'right' if side == 'left' else 'left'}_{rest}"


def misfit(names: Sequence[str], values: np.ndarray, robot: RobotSpec) -> np.ndarray:
    """How ill numbers (n, D) fit the joints that they are called, a number a column; 0 for one without a name."""
    found = np.zeros(len(names))
    for column, name in enumerate(names):
        if name not in robot.joint_names:
            continue
        index, q = robot.index(name), values[:, column]
        low, high = robot.position_min[index], robot.position_max[index]
        middle, spread = _typical(name, low, high)
        beyond = np.maximum(low - q, q - high) > PAST_RANGE
        found[column] = np.mean(np.minimum(((q - middle) / spread) ** 2, CAP) + WEIGHT * beyond)
    return found


def _typical(name: str, low: float, high: float) -> tuple[float, float]:
    side, _, rest = name.removesuffix("_joint").partition("_")
    if side not in ("left", "right"):
        side, rest = "left", name.removesuffix("_joint")
    if rest not in TYPICAL:
        return 0.5 * (low + high), FINGER
    middle, spread = TYPICAL[rest]
    return (-middle if side == "right" and rest in MIRRORED else middle), spread
