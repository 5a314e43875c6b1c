"""Recorded joints to wrist layouts by forward kinematics, and back by inverse kinematics, a frame at a time.

The pelvis of a frame is that frame's own. Where the legs were recorded they say where it was over the soles
(`policy.dataset.pelvis`), else it is taken to be the stance's. Joints that were not recorded but lie between pelvis and
wrist, the waist, are taken from a posture that the user states.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode, encode
from policy.action_spec.hands import closing_of, finger_closings
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.dataset.joint_layout import JointLayout
from policy.dataset.pelvis.rows import decode_rows, encode_rows
from policy.errors import ChunkError, DatasetError, SpecError, did_you_mean
from policy.geometry.rotations import angle_between
from policy.geometry.se3 import inverse
from policy.joints import joints_of
from policy.kinematics.forward import IK_TOLERANCE
from policy.kinematics.inverse import ARMS, reach, upper_body

SYNERGIES = ("dex3_open_close",)
"""Named maps between closing numbers and finger joints, a straight line from the robot description's open hand to its
closed hand: `policy.action_spec.hands.grasp_posture` of one number, `fingers_closed` of one a finger."""

Moving = Literal["arms", "upper_body"]
"""What inverse kinematics may move: the arms, or the waist too where the arms alone do not reach."""


@dataclass(frozen=True)
class JointConversion:
    """Between the joint-space vectors of a source and a wrist layout.

    Attributes:
        source: What the columns of the joint-space vector are.
        target: Wrist layout, every slot absolute and in the stance or the pelvis.
        waist: Joints of the waist [rad] where the source has none, yaw, roll, pitch of the G1; zero if None.
        synergy: Map between a closing number and fingers, a name of `SYNERGIES`; where only one side has fingers.
        moving: What inverse kinematics may move.

    Raises:
        SpecError: If the target is no such layout.
        DatasetError: If fingers would have to be made up, or dropped, without a named synergy.
    """

    source: JointLayout
    target: ActionSpec
    waist: tuple[float, ...] | None = None
    synergy: str | None = None
    moving: Moving = "arms"

    def __post_init__(self) -> None:
        _check_target(self.target)
        waist = joints_of(self.robot, "waist")
        if self.waist is None:
            object.__setattr__(self, "waist", (0.0,) * len(waist))
        if len(self.waist) != len(waist) or not np.isfinite(self.waist).all():
            raise DatasetError(f"waist is {self.waist}; the angles of {', '.join(waist)} in rad are expected")
        if self.moving not in get_args(Moving):
            raise SpecError(f"moving '{self.moving}' is unknown; it is {' or '.join(get_args(Moving))}")
        if self.moving == "upper_body" and not self.source.has_waist:
            raise SpecError("the waist can only move where the joint vector has a place for it; use moving='arms'")
        if self.synergy is not None and self.synergy not in SYNERGIES:
            near = did_you_mean(self.synergy, SYNERGIES)
            raise DatasetError(f"no synergy is called '{self.synergy}'; {near}there is {', '.join(SYNERGIES)}")
        fingers, hand = self.target.slot("left_hand") is not None, self.source.hand
        same = not hand or hand == ("own" if fingers else "dex1")
        if self.synergy is None and not same:
            have = {"dex1": "one Dex1 gripper number", "own": "Dex3 fingers"}.get(hand, f"six {hand} fingers")
            want = "seven Dex3 joints" if fingers else "one number"
            raise DatasetError(
                f"the source has {have} a hand, '{self.target.name}' has {want}: name the map between them with "
                f"--synergy {SYNERGIES[0]}, or keep the hands as they are with --to {'wbc27' if fingers else 'wbc32'}"
            )

    @property
    def robot(self) -> RobotSpec:
        """The robot of both layouts."""
        return self.source.robot

    @cached_property
    def assumptions(self) -> dict[str, float | str]:
        """What the result has in it that the source does not say."""
        assumed: dict[str, float | str] = {} if self.source.hand else {"fingers": "the stance's, none are recorded"}
        if not self.source.has_waist:
            waist = joints_of(self.robot, "waist")
            assumed |= {f"{name} [rad]": float(q) for name, q in zip(waist, self.waist, strict=True)}
        if (height := self.target.slot("base_height")) and height.frame != "stance":
            assumed["base_height [m]"] = float(Anchor.nominal(robot=self.robot).T_world_base[2, 3])
        if self.target.slot("base_velocity"):
            assumed["base_velocity [m/s, rad/s]"] = 0.0
        if self.synergy is not None:
            assumed["synergy"] = self.synergy
        return assumed

    @property
    def provenance(self) -> dict[str, Any]:
        """Description of the source for ``meta/conversion.json``."""
        source = self.source
        names = {"joints": list(source.names), "left_out": source.left_out, "names_in_source": list(source.given)}
        return names | {"unit_in_source": source.unit}

    def forward(self, joints: np.ndarray, anchors: Sequence[Anchor] | None = None) -> np.ndarray:
        """Wrist layout (n, A) of joint vectors (n, D).

        Args:
            joints: Numbers of the source.
            anchors: One a row, with the pelvis as it was then; None for the stance's in all.
        """
        chunk = self._chunk(joints)
        if anchors is None:
            return encode(self.target, chunk, self.anchor)
        T_base = self._in_base(chunk)
        moved = np.stack([anchor.T_world_base for anchor in anchors])
        T = {f"T_world_{hand}": moved @ T_base[hand] for hand in ARMS}
        return encode_rows(self.target, dataclasses.replace(chunk, **T), anchors)

    def backward(
        self, numbers: np.ndarray, start: np.ndarray | None = None, anchors: Sequence[Anchor] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Joint vectors of wrist-layout numbers, each frame from the one before; legs, if any, keep ``start``.

        Args:
            numbers: Shape (n, A).
            start: Joint vector (D,) to start from; it also says where the redundant elbows and the waist are.
            anchors: As of `forward`.

        Returns:
            Joint vectors (n, D), and the pose error of each frame [m and rad in one norm]; above
            `policy.kinematics.forward.IK_TOLERANCE` the nearest pose was taken.
        """
        numbers = np.asarray(numbers, dtype=float)
        if anchors is None:
            chunk = decode(self.target, numbers, self.anchor)
            T_base = self._in_base(chunk)
        else:
            chunk = decode_rows(self.target, numbers, anchors)
            inward = np.stack([anchor.T_base_world for anchor in anchors])
            T_base = {hand: inward @ getattr(chunk, f"T_world_{hand}") for hand in ARMS}
        first = self.anchor if start is None else self._anchor_at(start)
        q_body, errors = self._follow(T_base, chunk.q_waist, first.q_body)
        parts = {
            **{part: q_body[:, where] for part, where in self.robot.limbs.items()},
            "left_hand": chunk.q_lhand,
            "right_hand": chunk.q_rhand,
        }
        joints = np.tile(self._at_rest() if start is None else start, (len(chunk), 1)).astype(float)
        joints[:, self.source.columns] = _from_parts(self.source.spec, parts)
        return joints, errors

    @cached_property
    def anchor(self) -> Anchor:
        """The stance with the stated waist."""
        nominal = Anchor.nominal(robot=self.robot)
        q_body = nominal.q_body.copy()
        q_body[self.robot.limbs["waist"]] = self.waist
        return dataclasses.replace(nominal, q_body=q_body)

    def posture(self, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Body, left and right fingers of joint vectors (n, D) [rad], a row each; what is not in them is assumed."""
        chunk = self._chunk(joints)
        q_body = np.tile(self.anchor.q_body, (len(chunk), 1))
        limbs = self.robot.limbs
        q_body[:, limbs["left_arm"]], q_body[:, limbs["right_arm"]] = chunk.q_larm, chunk.q_rarm
        if chunk.q_waist is not None:
            q_body[:, limbs["waist"]] = chunk.q_waist
        return q_body, chunk.q_lhand, chunk.q_rhand

    def wrists(self, joints: np.ndarray) -> dict[str, np.ndarray]:
        """``T_base_lhand`` and ``T_base_rhand`` (n, 4, 4) of joint vectors (n, D), keys lhand and rhand."""
        return self._in_base(self._chunk(joints))

    def _chunk(self, joints: np.ndarray) -> ActionChunk:
        joints = np.asarray(joints, dtype=float)
        if joints.ndim != 2 or joints.shape[1] != self.source.dim:
            raise ChunkError(f"the joint vectors have shape {joints.shape}; (n, {self.source.dim}) is expected")
        return decode(self.source.spec, joints[:, self.source.columns], self.anchor)

    def _at_rest(self) -> np.ndarray:
        """Joint vector (D,) of the stance; hands 0, they are always given."""
        scale = 180.0 / np.pi if self.source.unit == "deg" else 1.0
        stance = dict(zip(self.robot.body_joints, scale * self.anchor.q_body, strict=True))
        return np.array([stance.get(name, 0.0) for name in self.source.names])

    def _in_base(self, chunk: ActionChunk) -> dict[str, np.ndarray]:
        T_base_world = inverse(self.anchor.T_world_base)
        return {hand: T_base_world @ getattr(chunk, f"T_world_{hand}") for hand in ARMS}

    def _anchor_at(self, start: np.ndarray) -> Anchor:
        q_body, q_l, q_r = self.posture(np.asarray(start, dtype=float)[None])
        return Anchor(self.anchor.T_world_base, q_body[0], q_l[0], q_r[0], self.robot)

    def _follow(
        self, T: dict[str, np.ndarray], q_waist: np.ndarray | None, q_first: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        steps, robot = len(T["lhand"]), self.robot
        q, solved, errors = q_first.copy(), np.empty((steps, len(q_first))), np.zeros(steps)
        for step in range(steps):
            if q_waist is not None:
                q[robot.limbs["waist"]] = q_waist[step]
            goals = {hand: T[hand][step] for hand in ARMS}
            before, worst = q, 0.0
            for hand, limb in ARMS.items():
                arm = robot.limbs[limb]
                # After a pose out of reach the next ones are likely so too: they are searched for in fewer places.
                thorough = not (step and errors[step - 1] > IK_TOLERANCE)
                q, error = reach({hand: goals[hand]}, arm, q, q_first, thorough=thorough, robot=robot)
                worst = max(worst, error)
            if not worst <= IK_TOLERANCE and self.moving == "upper_body" and q_waist is None:
                q, worst = reach(goals, upper_body(robot), before, q_first, robot=robot)
            solved[step], errors[step] = q, worst
        return solved, errors


@dataclass(frozen=True)
class RoundTrip:
    """How far joints are from themselves after wrist layout and inverse kinematics.

    Attributes:
        frames: Number of frames.
        position: Largest distance of a wrist from where it was [m].
        rotation: Largest angle of a wrist from how it was [rad].
        fingers: Largest difference of a finger [rad] or gripper [motor rad].
        joints: Largest difference of each recorded arm and waist joint [rad]. It is not an error: a wrist pose leaves
            the elbow free to swing, and the joints found are others that put the wrist in the same place.
        unreached: Frames whose pose inverse kinematics did not reach within `policy.kinematics.forward.IK_TOLERANCE`.
    """

    frames: int
    position: float
    rotation: float
    fingers: float
    joints: dict[str, float]
    unreached: int

    def merged(self, other: RoundTrip) -> RoundTrip:
        """Statistics of both sets of frames."""
        joints = {name: max(largest, other.joints[name]) for name, largest in self.joints.items()}
        return RoundTrip(
            self.frames + other.frames,
            max(self.position, other.position),
            max(self.rotation, other.rotation),
            max(self.fingers, other.fingers),
            joints,
            self.unreached + other.unreached,
        )


def round_trip(
    conversion: JointConversion, joints: np.ndarray, numbers: np.ndarray, anchors: Sequence[Anchor] | None = None
) -> RoundTrip:
    """Go back from the numbers (n, A) that were stored for joint vectors (n, D) of one episode, and compare."""
    back, errors = conversion.backward(numbers, joints[0], anchors)
    before, after = conversion.wrists(joints), conversion.wrists(back)
    position, rotation = 0.0, 0.0
    for hand in ARMS:
        gap = before[hand][:, :3, 3] - after[hand][:, :3, 3]
        position = max(position, float(np.linalg.norm(gap, axis=1).max()))
        rotation = max(rotation, float(angle_between(before[hand][:, :3, :3], after[hand][:, :3, :3]).max()))
    gaps = np.abs(np.asarray(back, dtype=float) - np.asarray(joints, dtype=float)).max(axis=0)
    is_hand = np.array([name not in conversion.robot.body_joints for name in conversion.source.names])
    scale = np.pi / 180.0 if conversion.source.unit == "deg" else 1.0
    gaps[np.array([name == "" for name in conversion.source.names])] = 0.0
    named = zip(conversion.source.names, scale * gaps, is_hand, strict=True)
    return RoundTrip(
        len(joints),
        position,
        rotation,
        float(gaps[is_hand].max(initial=0.0)),
        {name: float(gap) for name, gap, hand in named if not hand},
        int((errors > IK_TOLERANCE).sum()),
    )


def _check_target(target: ActionSpec) -> None:
    for slot in target.slots:
        if slot.mode != "absolute" or slot.frame not in ("pelvis", "stance") or slot.name.endswith("_arm"):
            raise SpecError(
                f"'{target.name}' cannot be filled frame by frame: slot '{slot.name}' is {slot.mode} in the frame "
                f"{slot.frame}; a layout of absolute wrist poses in stance or pelvis, such as wbc32 or wbc27, can"
            )
    if target.slot("left_wrist_rotation") is None or target.slot("right_wrist_rotation") is None:
        raise SpecError(f"'{target.name}' has no wrist rotations; wbc32 and wbc27 have")


def _from_parts(spec: ActionSpec, parts: dict[str, np.ndarray]) -> np.ndarray:
    """Numbers of a joint layout (n, A) from body parts in motor order."""
    columns = []
    for slot in spec.slots:
        side, names = slot.name.split("_", maxsplit=1)[0], joints_of(spec.robot, slot.name) if slot.joint_names else ()
        if slot.kind == "fingers":
            values = finger_closings(side, slot.joint_names, parts[slot.name], spec.robot)
        elif slot.kind == "scalar":
            values = closing_of(side, parts[f"{side}_hand"], spec.robot)[:, None]
        else:
            values = parts[slot.name][:, [names.index(name) for name in slot.joint_names]]
        columns.append(slot.from_si(values))
    return np.hstack(columns)
