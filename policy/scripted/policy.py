"""Policies that are formulas: hand motions written as functions of time, in world coordinates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.chunk import ActionChunk
from policy.clock import EpisodeClock
from policy.geometry.se3 import make_transform, translated
from policy.observation import Observation


@dataclass(frozen=True)
class ScriptedMotion:
    """Both hands over time.

    Attributes:
        p_world_lpalm, p_world_rpalm: Palm points, shape (H, 3), [m].
        R_world_lhand, R_world_rhand: Hand rotations, shape (H, 3, 3) or (3, 3) if constant.
        q_lhand, q_rhand: Fingers in motor order, shape (H, m) or (m,) if constant, [rad].
        f_world_lpalm, f_world_rpalm: Force that the world is expected to put on each palm, shape (H, 3) or (3,) if
            constant, [N].
    """

    p_world_lpalm: np.ndarray
    p_world_rpalm: np.ndarray
    R_world_lhand: np.ndarray
    R_world_rhand: np.ndarray
    q_lhand: np.ndarray
    q_rhand: np.ndarray
    f_world_lpalm: np.ndarray = field(default_factory=lambda: np.zeros(3))
    f_world_rpalm: np.ndarray = field(default_factory=lambda: np.zeros(3))


Script = Callable[[np.ndarray], ScriptedMotion]
"""A motion as a function of episode time, shape (H,), [s]; it must hold its end pose after its duration."""


class ScriptedPolicy:
    """Serves a script in chunks.

    Chunks are sampled from the formula in episode time, so successive chunks agree wherever they overlap. Episode time
    is 0 at the first observation after `reset`.

    Args:
        name: What the CLI and reports call it.
        script: The motion.
        duration: When the script has arrived [s].
        fps: Steps per second of the chunks [Hz].
        horizon: Steps per chunk.
        orientation_free: Whether the task does not depend on how the hands are turned.
        robot: Whose hands; the G1's with Dex3 hands if None.
    """

    sees_robot = False

    def __init__(
        self,
        name: str,
        script: Script,
        duration: float,
        *,
        fps: float = 30.0,
        horizon: int = 50,
        orientation_free: bool = False,
        robot: RobotSpec | None = None,
    ) -> None:
        self.name, self.script, self.duration = name, script, duration
        spec = builtin("wbc32", robot)
        self.spec = spec.with_free_orientation() if orientation_free else spec
        self.fps, self.horizon = fps, horizon
        self._clock = EpisodeClock()

    def reset(self, task: str = "") -> None:
        """Begin the script anew at the next observation."""
        self._clock.reset()

    def infer(self, observation: Observation) -> ActionChunk:
        """Chunk that starts at the observation's time.

        Raises:
            ObservationError: If time goes back without a reset.
        """
        seq, elapsed = self._clock.tick(observation.time)
        motion = self.script(elapsed + np.arange(self.horizon) / self.fps)
        chunk = to_chunk(motion, self.spec.id, seq, observation.time, self.fps, self.horizon, robot=self.spec.robot)
        chunk.validate(robot=self.spec.robot)
        return chunk


def to_chunk(
    motion: ScriptedMotion,
    spec_id: str,
    seq: int,
    t_obs: float,
    fps: float,
    steps: int,
    *,
    robot: RobotSpec | None = None,
) -> ActionChunk:
    """Chunk of a robot, the G1 with Dex3 hands if not given: wrist poses from palm points."""
    robot = robot or g1()
    T_palm = {"lhand": palm_offset("left", robot), "rhand": palm_offset("right", robot)}
    wrists = {
        hand: make_transform(R, p - R @ T_palm[hand])
        for hand, R, p in (
            ("lhand", motion.R_world_lhand, motion.p_world_lpalm),
            ("rhand", motion.R_world_rhand, motion.p_world_rpalm),
        )
    }
    hands = zip((motion.q_lhand, motion.q_rhand), robot.fingers, strict=True)
    left, right = (np.broadcast_to(q, (steps, n)).copy() for q, n in hands)
    expected = {"f_world_lpalm": motion.f_world_lpalm, "f_world_rpalm": motion.f_world_rpalm}
    forces: dict[str, Any] = {
        name: np.broadcast_to(f, (steps, 3)).astype(float) for name, f in expected.items() if np.any(f)
    }
    return ActionChunk(spec_id, seq, t_obs, fps, wrists["lhand"], wrists["rhand"], left, right, **forces)


def palm_offset(side: str, robot: RobotSpec | None = None) -> np.ndarray:
    """Palm point of a robot, the G1 if not given, in the wrist frame, shape (3,), [m]."""
    return np.array((robot or g1()).tool(side).palm_offset)


def stance_pose(robot: RobotSpec | None = None) -> ScriptedMotion:
    """Where the hands of a robot, the G1 with Dex3 hands if not given, are in its stance; palm points of shape (3,)."""
    return _stance_pose(robot or g1())


@lru_cache(maxsize=8)
def _stance_pose(robot: RobotSpec) -> ScriptedMotion:
    anchor = Anchor.nominal(robot=robot)
    T = {hand: anchor.T_world_base @ anchor.poses[hand] for hand in ("lhand", "rhand")}
    palms = {
        hand: translated(T[hand], palm_offset(side, robot))[:3, 3]
        for hand, side in (("lhand", "left"), ("rhand", "right"))
    }
    return ScriptedMotion(
        palms["lhand"], palms["rhand"], T["lhand"][:3, :3], T["rhand"][:3, :3], anchor.q_lhand, anchor.q_rhand
    )


def minimum_jerk(share: np.ndarray) -> np.ndarray:
    """Rest-to-rest blend from 0 to 1 with zero velocity and acceleration at both ends, clipped outside [0, 1].

    Source:
        Flash and Hogan 1985, "The coordination of arm movements", J. Neuroscience.
    """
    s = np.clip(share, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
