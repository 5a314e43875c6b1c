"""The action chunk: where both wrists and all fingers should be over the next second or two, in world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.errors import ChunkError, did_you_mean
from policy.geometry.rotations import rotation_residual
from policy.reading import FPS_MAX, FPS_MIN

ROTATION_TOLERANCE = 1e-6
"""Largest residual of a pose's rotation: decoding orthonormalises, so more than rounding is a mistake."""

MAGNITUDE_MAX = 1e6
"""Largest number of a target that is taken at all [m, rad, m/s]; beyond it no arithmetic is safe."""
HANDS_IN = ("pelvis", "pelvis_yaw", "torso", "stance", "world", "soles")
"""Frames in which a layout may have the hands: those of `policy.action_spec.slot.Frame`, and ``soles``."""
BASE_SPEED_MAX = 10.0
"""Fastest base that is taken at all [m/s, rad/s]; chosen: people sprint so, and what is faster is in another unit."""
_POSES = ("T_world_lhand", "T_world_rhand")
_LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])
_FORCES = {"f_world_lpalm": (3,), "f_world_rpalm": (3,), "force_max": (2,), "stiffness": (2,)}
_BY_HAND = ("force_max", "stiffness")
_OPTIONAL = ("q_larm", "q_rarm", "q_waist", "q_legs", "base_height", "base_velocity", *_FORCES)


@dataclass(frozen=True)
class ActionChunk:
    """``H`` steps of targets at ``times``, anchored in time and in world.

    Legend: lhand and rhand are the wrist frames of the robot's tools (``left_wrist_yaw_link`` and
    ``right_wrist_yaw_link`` of the G1; a tool offset of the spec is already taken off), joints are in motor order, H is
    the number of steps, m the number of fingers of a hand (7 of a Dex3), n the joints of an arm (7 of the G1).

    Attributes:
        spec_id: `ActionSpec.id` of the layout that it was decoded from.
        seq: Number of the chunk within the episode, from 0.
        t_obs: Time of the observation that it answers; step 0 is meant for this time [s].
        fps: Steps per second [Hz].
        T_world_lhand, T_world_rhand: Wrist poses, shape (H, 4, 4).
        q_lhand, q_rhand: Finger joints, shape (H, m), [rad]; a right Dex3 hand lists index before middle.
        q_larm, q_rarm: Arm joints that the source had in mind, shape (H, n), [rad]; a hint, the poses rule.
        q_waist: Waist joints, shape (H, 3) of the G1 (yaw, roll, pitch), [rad]; a hint.
        q_legs: Left and right leg joints that the source had in mind, shape (H, 12) of the G1, [rad]; a hint.
        base_height: Pelvis height above the floor, shape (H,), [m]; a hint.
        base_velocity: Planar velocity of the pelvis x, y [m/s] and yaw rate [rad/s], shape (H, 3).
        f_world_lpalm, f_world_rpalm: Force that the world is expected to put on each palm, shape (H, 3), [N]: where it
            touches, the hand pushes against it, and the body leans.
        force_max: Largest force with which left and right hand push, shape (H, 2), or along each axis of the stance
            (ahead, to the left, up), (H, 2, 3), [N]; the controller's if None.
        stiffness: Of each hand while it touches, shape (H, 2), or along these axes, (H, 2, 3), [N/m]; likewise.
        hands_in: Frame in which the layout has the hands, a `policy.action_spec.slot.Frame`, or ``soles`` where its
            legs put the pelvis over these: a robot that walks meanwhile carries them in it. Poses that a program makes
            in world stay there.
        notes: What decoding changed, one sentence each (values clipped to the spec's limits).
    """

    spec_id: str
    seq: int
    t_obs: float
    fps: float
    T_world_lhand: np.ndarray
    T_world_rhand: np.ndarray
    q_lhand: np.ndarray
    q_rhand: np.ndarray
    q_larm: np.ndarray | None = None
    q_rarm: np.ndarray | None = None
    q_waist: np.ndarray | None = None
    q_legs: np.ndarray | None = None
    base_height: np.ndarray | None = None
    base_velocity: np.ndarray | None = None
    f_world_lpalm: np.ndarray | None = None
    f_world_rpalm: np.ndarray | None = None
    force_max: np.ndarray | None = None
    stiffness: np.ndarray | None = None
    hands_in: str = "world"
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number of steps H."""
        return len(self.T_world_lhand)

    @property
    def times(self) -> np.ndarray:
        """Time of each step, shape (H,), [s]."""
        return self.t_obs + np.arange(len(self)) / self.fps

    @property
    def end(self) -> float:
        """Time of the last step [s]."""
        return self.t_obs + (len(self) - 1) / self.fps

    @property
    def pushes(self) -> tuple[bool, bool]:
        """Whether the left and the right hand are expected to touch something: to feel a force at some step."""
        left, right = (f is not None and bool(np.any(f)) for f in (self.f_world_lpalm, self.f_world_rpalm))
        return left, right

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything that has one entry a step, by name; optional parts only where they are there."""
        names = (*_POSES, "q_lhand", "q_rhand", *_OPTIONAL)
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

    def validate(
        self, *, after: ActionChunk | None = None, rotations: bool = True, robot: RobotSpec | None = None
    ) -> None:
        """Check everything that can be checked without knowing what the robot does.

        Args:
            after: The chunk before it in the same episode: number and time must increase from it.
            rotations: Check the poses too; they need it unless they were just made from rotations.
            robot: Says how many joints each part has; the G1 with Dex3 hands if None.

        Raises:
            ChunkError: With the offending step and field.
        """
        self._check_clock()
        steps = np.asarray(self.T_world_lhand).shape[0] if np.ndim(self.T_world_lhand) else 0
        if steps < 1:
            raise ChunkError("the chunk has no step; at least one is expected", slot="T_world_lhand")
        for name in _POSES:
            self._check_array(name, (steps, 4, 4))
        if rotations:
            self._check_poses()
        for name, shape in _shapes(robot or g1()).items():
            if name not in _OPTIONAL or getattr(self, name) is not None:
                by_axis = name in _BY_HAND and np.ndim(getattr(self, name)) == 3
                self._check_array(name, (steps, *shape, 3) if by_axis else (steps, *shape))
        self._check_base()
        for name in _BY_HAND:
            value = getattr(self, name)
            if value is not None and not (np.asarray(value) >= 0.0).all():
                raise ChunkError(f"{name} is {np.min(value):g}; it must not be negative", slot=name)
        if after is not None:
            self._check_order(after)

    def _check_clock(self) -> None:
        if not np.isfinite(self.t_obs):
            raise ChunkError(f"t_obs is {self.t_obs}; a finite time in seconds is expected", slot="t_obs")
        if not FPS_MIN <= self.fps <= FPS_MAX:
            text = f"fps is {self.fps}; a positive rate in Hz is expected, so that time increases"
            raise ChunkError(f"{text}: {FPS_MIN:g} to {FPS_MAX:g}", slot="fps")
        times = self.times
        if not (times[1:] > times[:-1]).all():
            raise ChunkError(f"times do not increase at t_obs {self.t_obs} s and {self.fps} Hz", slot="t_obs")

    def _check_array(self, name: str, shape: tuple[int, ...]) -> None:
        value = np.asarray(getattr(self, name))
        if value.shape != shape:
            raise ChunkError(f"{name} has shape {value.shape}; {shape} is expected", slot=name)
        if value.dtype.kind != "f":
            raise ChunkError(f"{name} has the type {value.dtype}; floating point is expected", slot=name)
        bad = ~(np.abs(value) <= MAGNITUDE_MAX)
        if bad.any():
            index = [int(i) for i in np.argwhere(bad)[0]]
            text = (
                f"{name} is {value[tuple(index)]} at step {index[0]}; finite numbers up to {MAGNITUDE_MAX:g} are taken"
            )
            raise ChunkError(text, step=index[0], slot=name)

    def _check_base(self) -> None:
        if self.hands_in not in HANDS_IN:
            near, given = did_you_mean(self.hands_in, HANDS_IN), str(self.hands_in)[:40]
            text = f"hands_in is '{given}', and hands are in no such frame; {near}there are: {', '.join(HANDS_IN)}"
            raise ChunkError(text, slot="hands_in")
        if self.base_velocity is None:
            return
        speed = np.abs(self.base_velocity).max(axis=1)
        if (fast := speed > BASE_SPEED_MAX).any():
            step = int(np.argmax(fast))
            raise ChunkError(
                f"base_velocity is {speed[step]:g} at step {step}; up to {BASE_SPEED_MAX:g} m/s and rad/s are taken, "
                "and a robot that walks is slower still: is it in mm/s or degrees/s?",
                step=step,
                slot="base_velocity",
            )

    def _check_poses(self) -> None:
        T = np.stack([self.T_world_lhand, self.T_world_rhand])
        residual = rotation_residual(T[..., :3, :3])
        bad = ~(residual <= ROTATION_TOLERANCE) | (np.abs(T[..., 3, :] - _LAST_ROW) > ROTATION_TOLERANCE).any(-1)
        if bad.any():
            hand, step = (int(i) for i in np.argwhere(bad)[0])
            raise ChunkError(
                f"{_POSES[hand]} is no rigid transform at step {step}: rotation residual {residual[hand, step]:.2g}, "
                f"allowed {ROTATION_TOLERANCE}, last row {T[hand, step, 3].tolist()}",
                step=step,
                slot=_POSES[hand],
            )

    def _check_order(self, before: ActionChunk) -> None:
        if self.t_obs <= before.t_obs:
            raise ChunkError(
                f"t_obs {self.t_obs:.4f} s is not after that of the chunk before it, {before.t_obs:.4f} s: "
                "a repeated or late chunk",
                slot="t_obs",
            )
        if self.seq <= before.seq:
            raise ChunkError(f"seq {self.seq} is not after {before.seq}: a chunk from before a reset?", slot="seq")


def _shapes(robot: RobotSpec) -> dict[str, tuple[int, ...]]:
    """Shape of a step of each array of joints and of the base, by name."""
    left, right = robot.fingers
    arms = {f"q_{side[0]}arm": (len(robot.limbs[f"{side}_arm"]),) for side in ("left", "right")}
    joints = {"q_lhand": (left,), "q_rhand": (right,), **arms, "q_waist": (len(robot.limbs["waist"]),)}
    joints["q_legs"] = (len(robot.limbs["left_leg"]) + len(robot.limbs["right_leg"]),)
    return {**joints, "base_height": (), "base_velocity": (3,), **_FORCES}
