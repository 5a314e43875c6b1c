"""Chunks of many kinds, each by its number: hostile, past the edge of reach, scripts, noise, motions of joints, hands
that swing to and fro."""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from models import g1
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.chunk import ActionChunk
from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix
from policy.kinematics.forward import kinematics
from policy.recorded.replay import open_recording
from policy.scripted.library import scripted_policy
from policy.scripted.policy import palm_offset, stance_pose, to_chunk
from tests.support.hostile_chunks import EdgeEpisode, hostile_chunk
from tests.support.lissajous_variants import variant
from tests.support.verdict_agreement import HOSTILE, sent

KINDS = ("hostile", "script", "noise", "recorded", "sent", "hostile", "script", "noise", "recorded", "edge")
"""Of ten cases in a row."""
JOINTS, MOVING, SWINGING = 100_000, 200_000, 300_000
"""From these numbers on hands move as they do when the joints of arms and waist move at random, chunks come while the
one before is being followed, and hands swing to and fro."""
SCRIPTS = ("lissajous", "reach", "two_hand_lift", "pick_low", "pick_high", "wave", "grasp")
STEPS = (20, 75)
FASTER = (0.6, 1.8)
"""Steps of a chunk, and how much faster than as scripted or recorded it is."""
NOISE, NOISE_TURN, NOISE_TIME = (1e-3, 0.1), (3e-3, 0.5), (0.03, 0.5)
"""Standard deviations of what is added [m], [rad], and the time over which it stays alike [s]."""

ANEW = (1e-3, 0.05)
"""Standard deviation of what a chunk that is sampled anew differs by from the one before it [m]."""
SWING, SWING_TIME = (0.2, 1.2), (0.1, 0.6)
"""Of joints at random: how much of their range they use, and the time over which they go one way [s]."""

BEATS, WIDE, SWAY = (0.3, 4.0), (3e-3, 0.15), 0.4
"""Of hands that swing: how often [Hz], how far to each side [m], and how far they turn at most [rad]."""


@dataclass(frozen=True)
class Case:
    """A chunk; the kind of it, what must not be split, where it begins: ``first`` or ``stance``, and in which world.

    It comes ``begins`` [s] after the first step of the one ``before``, if there is one.
    """

    number: int
    family: str
    group: str
    start: str
    world: str
    chunk: ActionChunk
    before: ActionChunk | None = None
    begins: float = 0.0


def outcome_case(number, motions=""):
    """The case of a number; where no folder of motions is named, another random place takes a motion's place."""
    rng = np.random.default_rng((18, number))
    kind = KINDS[number % len(KINDS)]
    for first, other in ((JOINTS, "joints"), (MOVING, "moving"), (SWINGING, "swinging")):
        kind = other if number >= first else kind
    kind = "sent" if kind == "recorded" and not motions else kind
    world = ("true", "realistic")[int(rng.integers(2))]
    stands = rng.random() < {"hostile": 0.7, "sent": 1.0}.get(kind, 0.25)
    family, group, *chunks = MAKERS[kind](rng, number, motions)
    chunks = [replace(one, spec_id=builtin("wbc32").id, seq=k, t_obs=0.0, notes=()) for k, one in enumerate(chunks)]
    case = Case(number, family, group, "stance" if stands else "first", world, chunks[-1])
    if len(chunks) == 1:
        return case
    begins = (len(chunks[0]) - len(chunks[1])) / chunks[0].fps
    return replace(case, before=chunks[0], chunk=replace(chunks[1], t_obs=begins), begins=begins)


def _hostile(rng, number, motions):
    """As they are, or a share of the way there from the stance."""
    family = HOSTILE[int(rng.integers(len(HOSTILE)))]
    chunk, share = hostile_chunk(family, rng, 0, 0.0), 1.0 if rng.random() < 0.4 else rng.uniform(0.05, 0.8)
    stance, hands = stance_pose(), {}
    for name, R, p, side in (
        ("T_world_lhand", stance.R_world_lhand, stance.p_world_lpalm, "left"),
        ("T_world_rhand", stance.R_world_rhand, stance.p_world_rpalm, "right"),
    ):
        T, home = getattr(chunk, name).copy(), p - R @ palm_offset(side)
        T[:, :3, :3] = R @ rotvec_to_matrix(share * matrix_to_rotvec(R.T @ T[:, :3, :3]))
        T[:, :3, 3] = home + share * (T[:, :3, 3] - home)
        hands[name] = T
    return family, f"hostile {number}", replace(chunk, **hands)


def _script(rng, number, motions):
    """A part of a script at a speed of its own."""
    name, faster = SCRIPTS[int(rng.integers(len(SCRIPTS)))], rng.uniform(*FASTER)
    if name == "lissajous":
        seed = int(rng.integers(10_000))
        policy, group = variant(seed), f"lissajous {seed}"
    elif name == "reach":
        x, z, y = rng.uniform(0.2, 0.55), rng.uniform(0.4, 1.5), rng.uniform(0.05, 0.35)
        policy, group = scripted_policy(name, x=x, z=z, y=y), f"reach {number}"
    elif name == "two_hand_lift":
        x, z, lift = rng.uniform(0.25, 0.45), rng.uniform(0.55, 1.0), rng.uniform(0.1, 0.4)
        policy, group = scripted_policy(name, x=x, z=z, lift=lift), f"lift {number}"
    elif name == "grasp":
        at = tuple(rng.uniform([0.3, 0.05, 0.65], [0.5, 0.3, 1.05]).tolist())
        policy, group = scripted_policy(name, p_world_object=at), f"grasp {number}"
    else:
        side = ("left", "right")[int(rng.integers(2))]
        policy, group = scripted_policy(name, side=side), f"{name} {number}"
    t = rng.uniform(0.0, 0.9 * policy.duration) + faster * np.arange(int(rng.integers(*STEPS))) / 30.0
    return name, group, to_chunk(policy.script(t), "wbc32", 0, 0.0, 30.0, len(t))


def _edge(rng, number, motions):
    """A part of a slow path past the limit of reach."""
    path, draw = SimpleNamespace(seq=0), np.random.default_rng(10_000_000 + number)
    path.swing = draw.uniform(0.1, 0.35, (2, 3)) * draw.choice([-1.0, 1.0], (2, 3))
    path.turn = draw.uniform(-0.3, 0.3, (2, 3))
    path.rates, path.phases = draw.uniform(0.4, 2.0, (2, 2, 3)), draw.uniform(0.0, 2.0 * np.pi, (2, 2, 3))
    return "edge", f"edge {number}", EdgeEpisode.chunk(path, rng.uniform(0.0, 6.0))


def _sent(rng, number, motions):
    return "sent", f"sent {number}", sent(rng)


def _noise(rng, number, motions):
    """What a learned policy's samples scatter like: a feasible kind of chunk and errors that are alike for a while."""
    _, group, chunk = (_script, _edge, _sent)[int(rng.integers(3))](rng, number, motions)
    deviation, turn, time = (float(np.exp(rng.uniform(*np.log(two)))) for two in (NOISE, NOISE_TURN, NOISE_TIME))
    hands = {}
    for name in ("T_world_lhand", "T_world_rhand"):
        T = getattr(chunk, name).copy()
        T[:, :3, 3] += deviation * alike(rng, len(chunk), time * chunk.fps)
        T[:, :3, :3] = T[:, :3, :3] @ rotvec_to_matrix(turn * alike(rng, len(chunk), time * chunk.fps))
        hands[name] = T
    return "noise", group, replace(chunk, **hands)


def _joints(rng, number, motions):
    """Within reach as the motions of people are, and as fast: arms and waist swing at random, the pelvis stays."""
    fps, steps = float(rng.choice([30.0, 60.0])), int(rng.integers(*STEPS))
    time, share = float(np.exp(rng.uniform(*np.log(SWING_TIME)))), float(np.exp(rng.uniform(*np.log(SWING))))
    anchor, low, high = Anchor.nominal(), g1().position_min[:29], g1().position_max[:29]
    q = np.tile(anchor.observation().q_body, (steps, 1))
    limbs = g1().limbs
    for joints, scale in ((limbs["left_arm"], 1.0), (limbs["right_arm"], 1.0), (limbs["waist"], 0.2)):
        n, middle = len(joints), 0.5 * (low + high)[joints]
        swing = np.concatenate([alike(rng, steps, time * fps) for _ in range(3)], axis=1)[:, :n]
        centre = q[0, joints] + 0.5 * scale * rng.random() * share * (middle - q[0, joints])
        q[:, joints] = centre + 0.25 * scale * share * (high - low)[joints] * swing
    poses = kinematics().poses(np.clip(q, low, high))
    hands = {name: anchor.T_world_base @ poses[name] for name in ("lhand", "rhand")}
    fingers = [np.tile(value, (steps, 1)) for value in (anchor.q_lhand, anchor.q_rhand)]
    return "joints", f"joints {number}", ActionChunk("wbc32", 0, 0.0, fps, hands["lhand"], hands["rhand"], *fingers)


def _moving(rng, number, motions):
    """A chunk, and another one that comes in the midst of it: the rest of it, or what a policy sampled anew of that."""
    kind = (_script, _noise, _joints, _sent)[int(rng.choice(4, p=(0.4, 0.2, 0.3, 0.1)))]
    _, group, chunk = kind(rng, number, motions)
    first = int(rng.integers(len(chunk) // 5, len(chunk) // 2 + 1))
    rest = replace(chunk, **{name: value[first:] for name, value in chunk.arrays().items()})
    if rng.random() < 0.5:
        deviation, time = np.exp(rng.uniform(*np.log(ANEW))), np.exp(rng.uniform(*np.log(NOISE_TIME)))
        for name in ("T_world_lhand", "T_world_rhand"):
            getattr(rest, name)[:, :3, 3] += deviation * alike(rng, len(rest), time * rest.fps)
    return "moving", group, chunk, rest


def _swinging(rng, number, motions):
    """Waving, stirring, shaking: one hand or both go to and fro, or round, in the stance or beside it."""
    fps, steps = float(rng.choice([15.0, 30.0, 50.0])), int(rng.integers(30, 75))
    beat, wide = (float(np.exp(rng.uniform(*np.log(two)))) for two in (BEATS, WIDE))
    t = np.arange(steps) / fps
    starts = np.clip(t * rng.uniform(0.5, 3.0), 0.0, 1.0) if rng.random() < 0.5 else np.ones(steps)
    stance, hands, both = stance_pose(), {}, rng.random() < 0.6
    for name, R, p, side in (
        ("T_world_lhand", stance.R_world_lhand, stance.p_world_lpalm, "left"),
        ("T_world_rhand", stance.R_world_rhand, stance.p_world_rpalm, "right"),
    ):
        moves = 1.0 if both or (side == "left") == (number % 2 == 0) else 0.0
        axes, phases = rng.normal(size=(2, 3)), rng.uniform(0.0, 2.0 * np.pi, 2)
        axes *= wide / np.linalg.norm(axes, axis=1, keepdims=True)
        round_about = rng.random() < 0.4
        swing = np.sin(2.0 * np.pi * beat * t + phases[0])[:, None] * axes[0]
        swing = swing + round_about * np.sin(2.0 * np.pi * beat * t + phases[1])[:, None] * axes[1]
        beside = rng.normal(size=3) * np.array([0.04, 0.04, 0.08]) * (rng.random() < 0.6)
        turn = rng.normal(size=3) * rng.uniform(0.0, SWAY / 3.0) * np.sin(2.0 * np.pi * beat * t)[:, None]
        T = np.tile(np.eye(4), (steps, 1, 1))
        T[:, :3, :3] = rotvec_to_matrix(moves * turn * starts[:, None]) @ R
        T[:, :3, 3] = p + beside + moves * swing * starts[:, None] - T[:, :3, :3] @ palm_offset(side)
        hands[name] = T
    fingers = [np.tile(q, (steps, 1)) for q in (stance.q_lhand, stance.q_rhand)]
    chunk = ActionChunk("wbc32", 0, 0.0, fps, hands["T_world_lhand"], hands["T_world_rhand"], *fingers)
    return "swinging", f"swinging {number}", chunk


def alike(rng, n, steps):
    """Noise of variance 1 that is smooth over so many steps: white noise through a Gaussian window, (n, 3)."""
    reach = int(np.ceil(3.0 * steps))
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / steps) ** 2)
    window /= np.linalg.norm(window)
    white = rng.normal(size=(n + 2 * reach, 3))
    return np.stack([np.convolve(white[:, i], window, "valid") for i in range(3)], axis=1)


def _recorded(rng, number, motions):
    """A chunk from anywhere in a recorded motion, at its own speed or another one."""
    files = recordings(motions)
    name = sorted(files)[int(rng.integers(len(files)))]
    episode, steps = files[name], int(rng.integers(*STEPS))
    first = int(rng.integers(0, len(episode) - steps))
    window = {key: value[first : first + steps] for key, value in episode.arrays().items()}
    faster = 1.0 if rng.random() < 0.5 else rng.uniform(*FASTER)
    return "recorded", name, replace(episode, fps=episode.fps * faster, **window)


@lru_cache(maxsize=1)
def recordings(motions):
    """Recorded motions of a folder, by name."""
    return {path.stem: open_recording(str(path)).episode for path in sorted(Path(motions).glob("*.csv"))}


MAKERS = {
    "hostile": _hostile, "script": _script, "edge": _edge, "sent": _sent, "noise": _noise, "recorded": _recorded,
    "joints": _joints, "moving": _moving, "swinging": _swinging,
}  # fmt: skip
