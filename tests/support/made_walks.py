"""Walks and turns of a person as motion files have them, made from sines: another gait than the robot's own.

Steps of 0.45 to 0.6 s, hips and knees that swing, a pelvis that sways, bobs and turns with each step, arms that swing
against the legs: carried bent, loose, or hanging. Nothing of it is balanced.
"""

from dataclasses import dataclass

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.geometry.rotations import rpy_to_matrix
from policy.geometry.se3 import make_transform
from policy.recorded.motion_csv import Motion

ELBOWS = {"carried": 0.0, "loose": 0.25, "hanging": 0.75}
"""How far elbows are stretched beyond the stance's [rad]."""


@dataclass(frozen=True)
class MadeWalk:
    """A walk: its speeds, one after the other, and how it is walked.

    Attributes:
        parts: Time [s] and velocity of each part: ahead, to the left [m/s], about the vertical [rad/s].
        fps: Frames per second [Hz].
        step: Time of a step [s].
        arms: How the arms are: carried, loose or hanging.
        swing: How far arms swing to each side [rad].
    """

    parts: tuple[tuple[float, tuple[float, float, float]], ...]
    fps: float = 60.0
    step: float = 0.5
    arms: str = "carried"
    swing: float = 0.2


def along(seconds, *velocity):
    """One part."""
    return (seconds, velocity)


WALKS = {
    "stroll_0.3": MadeWalk((along(7.0, 0.3, 0.0, 0.0),), fps=30.0, step=0.6),
    "walk_0.4": MadeWalk((along(6.0, 0.4, 0.0, 0.0),), fps=50.0, step=0.58, arms="loose"),
    "walk_0.55": MadeWalk((along(6.0, 0.55, 0.0, 0.0),), step=0.55, swing=0.25),
    "walk_0.7_hanging": MadeWalk((along(5.0, 0.7, 0.0, 0.0),), step=0.52, arms="hanging", swing=0.3),
    "walk_0.9": MadeWalk((along(5.0, 0.9, 0.0, 0.0),), fps=30.0, step=0.5, arms="loose", swing=0.3),
    "walk_1.2": MadeWalk((along(4.0, 1.2, 0.0, 0.0),), step=0.47, swing=0.35),
    "curve_0.45": MadeWalk((along(8.0, 0.45, 0.0, 0.35),), fps=50.0, step=0.55, arms="loose"),
    "two_curves_0.5": MadeWalk((along(4.0, 0.5, 0.0, 0.4), along(4.0, 0.5, 0.0, -0.4)), step=0.55),
    "turn_0.6": MadeWalk((along(5.0, 0.0, 0.0, 0.6),), fps=30.0, step=0.55, swing=0.1),
    "aside_0.3": MadeWalk((along(4.0, 0.0, 0.3, 0.0), along(1.0, 0.0, 0.0, 0.0)), step=0.6, swing=0.05),
    "back_0.3": MadeWalk((along(5.0, -0.3, 0.0, 0.0),), fps=50.0, step=0.58, arms="loose"),
    "corner_and_stop_0.5": MadeWalk(
        (along(3.5, 0.5, 0.0, 0.0), along(2.0, 0.15, 0.0, 0.7), along(3.0, 0.5, 0.0, 0.0), along(1.5, 0.0, 0.0, 0.0)),
        step=0.55,
        swing=0.25,
    ),
}
"""Twelve of them, 0.3 to 1.2 m/s; the names say the speed."""


def made_walk(walk):
    """The motion of a walk, as it is recorded: it begins and ends in motion."""
    spec, dt = Anchor.nominal().robot, 1.0 / walk.fps
    edges = np.cumsum([seconds for seconds, _ in walk.parts])
    t = np.arange(0.0, edges[-1] + 0.5 * dt, dt)
    velocity = np.array([walk.parts[min(k, len(walk.parts) - 1)][1] for k in np.searchsorted(edges, t, side="right")])
    smooth = max(int(0.4 * walk.fps), 1)  # a person takes a step to change the pace
    velocity = np.pad(velocity, ((smooth, smooth), (0, 0)), mode="edge")
    velocity = np.stack([np.convolve(v, np.hanning(smooth + 2)[1:-1] / np.hanning(smooth + 2).sum(), "same")
                         for v in velocity.T], axis=1)[smooth:-smooth]  # fmt: skip
    heading = np.cumsum(velocity[:, 2]) * dt
    place = np.cumsum((velocity[:, 0] + 1j * velocity[:, 1]) * np.exp(1j * heading)) * dt
    stride, going = np.pi * t / walk.step, np.minimum(np.abs(velocity).max(axis=1) / 0.3, 1.0)
    place = place + going * (0.025j * np.sin(stride) + 0.012 * np.sin(2.0 * stride)) * np.exp(1j * heading)
    bob = 0.012 * going * np.cos(2.0 * stride)
    tilt = np.stack(
        [0.04 * going * np.sin(stride), 0.03 + 0.02 * np.cos(2.0 * stride), heading + 0.06 * going * np.sin(stride)],
        axis=1,
    )
    stance = Anchor.nominal()
    root = np.column_stack([place.real + 1.3, place.imag - 0.7, stance.T_world_base[2, 3] - 0.01 + bob])
    return Motion(walk.fps, make_transform(rpy_to_matrix(tilt), root), _joints(walk, spec, stance, stride, going))


def _joints(walk, spec, stance, stride, going):
    """Joints (n, m): legs and arms that swing against each other, a waist that turns against the pelvis."""
    q = np.tile(stance.q_body, (len(stride), 1))
    names = list(spec.body_joints)

    def add(name, values):
        q[:, names.index(name)] += values

    for side, phase in (("left", 0.0), ("right", np.pi)):
        swing, out = going * np.sin(stride + phase), 1.0 if side == "left" else -1.0
        lifted = 0.5 * going * np.maximum(np.cos(stride + phase), 0.0)
        add(f"{side}_hip_pitch_joint", -0.3 * swing - lifted)
        add(f"{side}_knee_joint", 2.0 * lifted)
        add(f"{side}_ankle_pitch_joint", 0.3 * swing - lifted)
        add(f"{side}_shoulder_pitch_joint", walk.swing * swing + 0.5 * ELBOWS[walk.arms])
        add(f"{side}_shoulder_roll_joint", 0.08 * out)
        add(f"{side}_elbow_joint", ELBOWS[walk.arms] - 0.1 * swing)
    add("waist_yaw_joint", -0.06 * going * np.sin(stride))
    return q
