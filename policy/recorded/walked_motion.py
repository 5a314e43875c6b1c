"""A recorded motion whose feet travel as a chunk that is walked: a way of the base, hands about it, and their pace.

The pelvis of a person sways and bobs with each step: the base is its way without that, and hands are about the base as
they were about the pelvis. A robot that walks is slower than most people: where base or hands are too fast for it the
motion is slowed, from frame to frame as much as it takes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import WALK
from policy.action_spec.slot_values import NOT_FOLLOWED
from policy.chunk import ActionChunk
from policy.errors import ChunkError
from policy.geometry.rotations import angle_between, rpy_to_matrix
from policy.geometry.se3 import interpolate, make_transform
from policy.kinematics.forward import kinematics
from policy.reading import STEPS_MAX
from policy.recorded.motion_csv import CHUNK_FPS, HANDS, Motion, frames_between, headings

SWAY = 0.4
"""Width of the Gaussian that takes a person's steps out of the way of the pelvis [s]; chosen: 4 % of a sway at 1 Hz,
two steps a second, are left, and a corner at 1 m/s is cut by 0.16 m."""
BEFORE = 2.0
"""Time for which the first pose is held before the walk [s]; chosen: hands that are 0.3 m away are there
before the weight is shifted."""
BEGINS = 0.1
"""Share of the fastest walk with which a motion may begin and end [no unit]; chosen: a robot begins and ends at rest,
and what is slower is none of its walks."""
EASY = 0.9
"""Share of its speeds and accelerations with which a robot follows a recorded way [no unit]; chosen: the rest is for
coming back to it."""
BENT, LEFT = 0.8, 0.1
"""Share of the acceleration that a bend of the way takes at most, and that is left to change the pace at least [no
unit]; chosen: a way is no rougher than a robot that walks can have it."""
PACE = 0.5
"""Time in which a pace changes by one at the fastest [s]; chosen: hands are slowed no more abruptly than a base."""
STARTS = 1.05 * WALK
"""Speed with which a walk is begun [m/s, rad/s]; derived: more than rest, and the base does not move yet."""
SLOWER = 1.01
"""Time factor from which a motion is said to be walked slower [no unit]; chosen: as verdicts have it."""
DRAWN = 0.002
"""Distance by which a hand is drawn in from which that is said [m]; chosen: palms of a robot that steps are as far
off."""
FAR_HANDS = "another motion of the hands: "
"""How a note begins that says that hands are elsewhere by more than what is done after repair."""


@dataclass(frozen=True, kw_only=True)
class WalkLimits:
    """What a robot can do that walks with a recorded motion.

    Attributes:
        share: From velocities (n, 3) to the share of its fastest walk that each is, shape (n,).
        acceleration: Of the base along its way [m/s^2] and about the vertical [rad/s^2].
        hands: Largest speed of a hand [m/s], and of its turn [rad/s].
        shift: Time in which the weight is shifted before the base begins to move [s].
        near, far: Distances by which a hand is elsewhere up to which it is where it was recorded, and from which its
            motion is another one [m].
        nearest: From wrists of the left and the right hand in the upright pelvis, shape (2, n, 3), to the nearest that
            a robot that walks can have, likewise [m].
    """

    share: Callable[[np.ndarray], np.ndarray]
    acceleration: tuple[float, float]
    hands: tuple[float, float]
    shift: float
    near: float
    far: float
    nearest: Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class WalkedWay:
    """A motion frame by frame as it is walked.

    Attributes:
        times: When each frame is due, shape (n,), from 0, [s].
        way: Base in each: x, y [m] and heading [rad], shape (n, 3).
        hands: Wrists about the pelvis of the base, shape (n, 4, 4), keys lhand and rhand.
        notes: What is changed in them.
    """

    times: np.ndarray
    way: np.ndarray
    hands: dict[str, np.ndarray]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, motion: Motion, limits: WalkLimits) -> WalkedWay:
        """A motion of two frames or more within the limits of a robot."""
        way = base_way(motion)
        recorded = hands_of(motion)
        hands, notes = _drawn_in(recorded, limits)
        notes += _of_pelvis(motion, recorded, limits)
        pace = _pace(_velocities(way, motion.fps), _haste(hands, motion.fps, limits), motion.fps, limits)
        times = np.concatenate([[0.0], np.cumsum(2.0 / (pace[1:] + pace[:-1]))]) / motion.fps
        return cls(times, way, hands, notes)


def walked_chunk(motion: Motion, limits: WalkLimits, *, fps: float = CHUNK_FPS) -> ActionChunk:
    """The whole motion as one long chunk of a robot that walks, in the frame between the soles of the nominal stance.

    ``base_velocity`` has the way of the base, and the hands are about that, drawn in to where a robot that walks can
    have them. The first pose is held for `BEFORE`; notes say by how much it is slower than recorded.

    Args:
        motion: What was recorded, two frames or more.
        limits: Of the robot.
        fps: Rate of the chunk [Hz].

    Raises:
        ChunkError: If that is more than `STEPS_MAX` steps.
    """
    from scipy.interpolate import CubicSpline  # too slow to come with the package

    walked = WalkedWay.of(motion, limits)
    times, anchor = walked.times, Anchor.nominal(robot=motion.robot)
    steps, before = int(np.ceil(times[-1] * fps - 1e-9)), int(np.ceil(BEFORE * fps))
    if steps + before >= STEPS_MAX:
        most = f"at most {STEPS_MAX / fps - BEFORE:.6g} s are taken: cut the file"
        raise ChunkError(f"the motion would be walked in {times[-1]:.6g} s; {most}")
    at, rows = np.arange(steps + 1) / fps, np.maximum(np.arange(-before, steps + 1), 0)
    base = CubicSpline(times, walked.way)(np.minimum(at, times[-1]))
    velocity = np.zeros((len(rows), 3))
    velocity[before:-1] = _between(base) * fps
    led = {hand: interpolate(T, times, at) for hand, T in walked.hands.items()}
    T_l, T_r = (anchor.T_world_base @ led[hand][rows] for hand in HANDS)
    q_l, q_r = (np.tile(q, (len(rows), 1)) for q in (anchor.q_lhand, anchor.q_rhand))
    notes = (*walked.notes, *_of_pace(motion, times, velocity), *frames_between(walked.hands, led, times, at))
    layout, said = builtin("wbc32", motion.robot).id, {"hands_in": "stance", "notes": notes}
    chunk = ActionChunk(layout, 0, 0.0, float(fps), T_l, T_r, q_l, q_r, base_velocity=velocity, **said)
    chunk.validate(robot=motion.robot)
    return chunk


def base_way(motion: Motion) -> np.ndarray:
    """Way of the base: x, y of the pelvis without its steps [m], and its heading [rad], shape (n, 3)."""
    rows = np.column_stack([motion.T_world_base[:, :2, 3], headings(motion)])
    reach = int(np.ceil(3.0 * SWAY * motion.fps))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (SWAY * motion.fps)) ** 2)
    weights /= weights.sum()
    # Mirrored in both ends, so that the way begins and ends where, and as fast as, the pelvis does.
    longer = np.pad(rows, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    return np.stack([np.convolve(column, weights, mode="valid") for column in longer.T], axis=1)


def hands_of(motion: Motion) -> dict[str, np.ndarray]:
    """Wrists about each frame's own pelvis, shape (n, 4, 4), keys lhand and rhand."""
    poses = kinematics(motion.robot).poses(motion.q_body)
    return {hand: poses[hand] for hand in HANDS}


def walked_along(velocity: np.ndarray, fps: float) -> tuple[np.ndarray, np.ndarray]:
    """Places ``x + iy`` [m] and headings [rad] of a base that goes with velocities (n, 3) at a rate [Hz], from 0."""
    turn = velocity[:, 2] / fps
    heading = np.concatenate([[0.0], np.cumsum(turn)[:-1]])
    step = (velocity[:, 0] + 1j * velocity[:, 1]) / fps * np.exp(1j * (heading + 0.5 * turn))
    return np.concatenate([[0j], np.cumsum(step)[:-1]]), heading


def begun_before(velocity: np.ndarray, steps: int) -> np.ndarray:
    """Velocities (n, 3) that are no rest already so many steps before they are none: just enough to begin a walk."""
    size = np.abs(velocity).max(axis=1)
    told, begins = velocity.copy(), np.flatnonzero((size[1:] > WALK) & (size[:-1] <= WALK)) + 1
    for k in begins:
        told[max(k - steps, 0) : k] = velocity[k] * (STARTS / size[k])
    return told


def _between(places: np.ndarray) -> np.ndarray:
    """Steps from each of places (n, 3) to the next, ahead, to the left [m], about the vertical [rad], (n - 1, 3)."""
    turn = np.diff(places[:, 2])
    step = np.diff(places[:, 0] + 1j * places[:, 1]) * np.exp(-1j * (places[:-1, 2] + 0.5 * turn))
    return np.column_stack([step.real, step.imag, turn])


def _velocities(places: np.ndarray, fps: float) -> np.ndarray:
    """Velocities at places (n, 3) along a way, in their own axes, shape (n, 3)."""
    steps = _between(places) * fps
    return 0.5 * (np.concatenate([steps[:1], steps]) + np.concatenate([steps, steps[-1:]]))


def _drawn_in(hands: dict[str, np.ndarray], limits: WalkLimits) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Hands where a robot that walks can have them, and a note on those that are elsewhere."""
    points = np.stack([hands[hand][:, :3, 3] for hand in HANDS])
    near = limits.nearest(points)
    found = {hand: make_transform(hands[hand][:, :3, :3], p) for hand, p in zip(HANDS, near, strict=True)}
    away = np.linalg.norm(near - points, axis=-1).max(axis=0)
    if away.max() <= DRAWN:
        return found, ()
    text = FAR_HANDS if away.max() > limits.far else ""
    text += (
        f"hands that are further from their shoulders than a robot walks with, in {np.mean(away > DRAWN):.0%} of the"
    )
    return found, (f"{text} rows, are drawn in by up to {away.max():.3f} m: their own way {NOT_FOLLOWED}",)


def _of_pelvis(motion: Motion, hands: dict[str, np.ndarray], limits: WalkLimits) -> tuple[str, ...]:
    """Note on a pelvis that bows or goes down, and hands with it: a robot that walks is upright and has one height."""
    upright = rpy_to_matrix(headings(motion)[:, None] * [0.0, 0.0, 1.0])
    rise = motion.T_world_base[:, 2, 3] - Anchor.nominal(robot=motion.robot).T_world_base[2, 3]
    turned = motion.T_world_base[:, :3, :3] - upright
    away = [turned @ T[:, :3, 3:] + rise[:, None, None] * [[0.0], [0.0], [1.0]] for T in hands.values()]
    off = np.linalg.norm(away, axis=2).max(axis=0)[:, 0]
    if off.max() <= limits.near:
        return ()
    tilt = np.rad2deg(np.arccos(np.clip(motion.T_world_base[:, 2, 2], -1.0, 1.0)).max())
    text = FAR_HANDS if off.max() > limits.far else ""
    text += f"the pelvis tilts by up to {tilt:.0f} deg and is up to {np.abs(rise).max():.2f} m off the robot's height"
    return (f"{text}, which {NOT_FOLLOWED}: hands are up to {off.max():.2f} m off, over the floor",)


def _haste(hands: dict[str, np.ndarray], fps: float, limits: WalkLimits) -> np.ndarray:
    """Share of their largest speeds that hands (n, 4, 4) have about the base, shape (n,)."""
    shares = []
    for T in hands.values():
        speed = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1) / limits.hands[0]
        turn = angle_between(T[:-1, :3, :3], T[1:, :3, :3]) / limits.hands[1]
        shares.append(np.maximum(speed, turn) * fps)
    most = np.maximum(*shares)
    return np.maximum(np.concatenate([most[:1], most]), np.concatenate([most, most[-1:]]))


def _pace(velocities: np.ndarray, haste: np.ndarray, fps: float, limits: WalkLimits) -> np.ndarray:
    """Frames a frame of time, shape (n,), at most 1: as fast as the robot walks, from rest to rest.

    Velocity ``v`` of the base at the recorded pace becomes ``r v`` at a pace ``r``, its acceleration
    ``r^2 v' + r r' v``: what of the limit the first part leaves is the second's, and so is the slope of ``r^2``.

    Args:
        velocities: Of the base at the recorded pace, shape (n, 3), [m/s, rad/s].
        haste: Share of their largest speeds that hands have then, shape (n,).
        fps: Frames per second [Hz].
        limits: Of the robot.
    """
    share = limits.share(velocities) / EASY
    bend = _against(np.gradient(velocities, axis=0) * fps, limits)
    square = 1.0 / np.maximum.reduce([share**2, haste**2, bend / BENT, np.ones(len(share))])
    square[[0, -1]] = np.minimum(square[[0, -1]], (BEGINS / np.maximum(share[[0, -1]], BEGINS)) ** 2)
    size = 2.0 / np.maximum(_against(velocities, limits), PACE) / fps
    for way in (range(1, len(square)), range(len(square) - 2, -1, -1)):
        before = way.start - way.step
        for k in way:
            square[k] = min(square[k], square[before] + size[before] * max(1.0 - bend[before] * square[before], LEFT))
            before = k
    return np.sqrt(square)


def _against(values: np.ndarray, limits: WalkLimits) -> np.ndarray:
    """Size of planar values (n, 3) over the largest acceleration, shape (n,)."""
    along, turn = limits.acceleration
    return np.maximum(np.hypot(values[:, 0], values[:, 1]) / along, np.abs(values[:, 2]) / turn) / EASY


def _of_pace(motion: Motion, times: np.ndarray, velocity: np.ndarray) -> tuple[str, ...]:
    """Note on how fast it is walked."""
    factor = times[-1] / motion.duration
    speed, turn = np.hypot(velocity[:, 0], velocity[:, 1]).max(), np.abs(velocity[:, 2]).max()
    text = f"this motion is walked at up to {speed:.2f} m/s and {turn:.2f} rad/s"
    if factor <= SLOWER:
        return (f"{text}, as fast as it was recorded",)
    slow = f"in {times[-1]:.1f} s in place of {motion.duration:.1f} s"
    return (f"{text}, {factor:.2f} x slower than it was recorded, {slow}: its own pace {NOT_FOLLOWED}",)
