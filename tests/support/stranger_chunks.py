"""Chunks of families that nothing was fitted to: hands straight down, beside the body, that end in motion, and loaded.

Numbers are drawn before anything is tried on them; another thousand of numbers is another draw of the same families.
"""

from dataclasses import dataclass, replace

import numpy as np

from policy.action_spec.builtin import builtin
from policy.chunk import ActionChunk
from policy.geometry.rotations import rotvec_to_matrix
from policy.scripted.policy import minimum_jerk, palm_offset, stance_pose
from wholebody.config import ControllerConfig, LoadConfig

FAMILIES = ("down", "beside", "moving_end", "loaded")
LOAD = 1.5
"""Mass in the hands of loaded chunks, both together [kg]."""
SHOULDER = np.array([0.0, 0.13, 1.08])
"""Near the left shoulder of the stance [m]; the right one is mirrored."""
SIDES = (("left", 1.0), ("right", -1.0))
SPEC = builtin("wbc32")


@dataclass(frozen=True)
class Stranger:
    """A chunk of a family, begun in the stance, and what the left and the right hand carry [kg]."""

    number: int
    family: str
    chunk: ActionChunk
    loads: tuple[float, float] = (0.0, 0.0)


def stranger(number):
    """The chunk of a number, families in turn."""
    family, rng = FAMILIES[number % len(FAMILIES)], np.random.default_rng((37, number))
    steps, fps = int(rng.integers(30, 76)), float(rng.choice([15.0, 30.0, 50.0]))
    chunk = MAKERS[family](rng, steps, fps)
    loads = (0.0, 0.0)
    if family == "loaded":
        left = LOAD * rng.choice([0.0, 0.5, 1.0])
        loads = (float(left), float(LOAD - left))
    return Stranger(number, family, chunk, loads)


def told_of(loads):
    """Settings that tell of what the hands carry."""
    return ControllerConfig(loads=LoadConfig(source="told", left=loads[0], right=loads[1])) if any(loads) else None


def sent(goals, turns, share, fps):
    """Palms from the stance towards goals (2, 3) [m], turned by rotation vectors (2, 3), by shares (H,) of the way."""
    stance, T, steps = stance_pose(), [], len(share)
    share = share[:, None]
    starts = (stance.p_world_lpalm, stance.R_world_lhand), (stance.p_world_rpalm, stance.R_world_rhand)
    for (side, _), (p, R), goal, turn in zip(SIDES, starts, goals, turns, strict=True):
        poses = np.tile(np.eye(4), (steps, 1, 1))
        poses[:, :3, :3] = rotvec_to_matrix(share * turn) @ R
        poses[:, :3, 3] = p + share * (goal - p) - poses[:, :3, :3] @ palm_offset(side)
        T.append(poses)
    fingers = [np.tile(q, (steps, 1)) for q in (stance.q_lhand, stance.q_rhand)]
    return ActionChunk(SPEC.id, 0, 0.0, fps, *T, *fingers)


def _goals(one):
    """A goal of the left palm and its mirror image."""
    return np.array([one * [1.0, sign, 1.0] for _, sign in SIDES])


def _share(rng, steps, fps, low, high):
    return minimum_jerk(np.arange(steps) / fps / rng.uniform(low, high))


def _down(rng, steps, fps):
    """Both hands straight down from the shoulders and slightly out, fingers ahead or down."""
    out, ahead, reach = rng.uniform(0.0, 0.45), rng.uniform(-0.25, 0.35), rng.uniform(0.40, 0.80)
    way = np.array([ahead, out, -1.0])
    turn = np.array([0.0, rng.uniform(0.0, 1.5), 0.0])
    goals = _goals(SHOULDER + reach * way / np.linalg.norm(way))
    return sent(goals, [turn, turn], _share(rng, steps, fps, 0.6, 1.6), fps)


def _beside(rng, steps, fps):
    """Hands beside the body or a little behind it, each somewhere else, low or as high as the shoulders."""
    goals, turns = [], []
    for _, sign in SIDES:
        goals.append([rng.uniform(-0.35, 0.2), sign * rng.uniform(0.12, 0.7), rng.uniform(0.35, 1.3)])
        turns.append(rng.normal(size=3) * 0.6)
    return sent(np.array(goals), turns, _share(rng, steps, fps, 0.5, 2.0), fps)


def _moving_end(rng, steps, fps):
    """What a policy answers: a part of a longer motion, whose last step is no rest."""
    goals, turns = [], []
    for _, sign in SIDES:
        goals.append([rng.uniform(0.1, 0.75), sign * rng.uniform(-0.05, 0.6), rng.uniform(0.3, 1.6)])
        turns.append(rng.normal(size=3) * 0.6)
    end = rng.uniform(0.4, 0.9)
    share = minimum_jerk(end * np.arange(steps) / (steps - 1))
    if rng.random() < 0.3:
        share = end * np.arange(steps) / (steps - 1)
    return sent(np.array(goals), turns, share, fps)


def _loaded(rng, steps, fps):
    """A mass is carried somewhere ahead, low, high or far."""
    goals, turns = [], []
    for _, sign in SIDES:
        goals.append([rng.uniform(0.1, 0.55), sign * rng.uniform(0.0, 0.4), rng.uniform(0.4, 1.35)])
        turns.append(rng.normal(size=3) * 0.3)
    return sent(np.array(goals), turns, _share(rng, steps, fps, 0.8, 2.0), fps)


MAKERS = {"down": _down, "beside": _beside, "moving_end": _moving_end, "loaded": _loaded}


def at_rest_after(chunk, time):
    """A chunk whose last step is held for a time more [s]."""
    steps = np.minimum(np.arange(len(chunk) + int(np.ceil(time * chunk.fps))), len(chunk) - 1)
    return replace(chunk, **{name: value[steps] for name, value in chunk.arrays().items()})
