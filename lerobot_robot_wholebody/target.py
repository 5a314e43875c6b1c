"""The numbers of actions and observations, and what an action makes of the ones before it."""

from __future__ import annotations

import numpy as np

from policy import builtin
from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode, encode_valid
from policy.action_spec.hands import SIDES, grasp_posture
from policy.action_spec.state import aligned_state, state_layout, state_numbers
from policy.errors import ChunkError
from policy.geometry.se3 import inverse, make_transform
from policy.observation import Observation
from policy.targets.parts import rows_of
from wholebody.config.touch import TouchConfig

FORCE_MAX = TouchConfig.force_max
"""Largest number of a force in an action [N]: a hand pushes no harder, as shipped."""
GRASPS = ("left_grasp.pos", "right_grasp.pos")
"""Numbers of an action that may stand for a hand's fingers: 0 open to 1 closed."""
PERIODS, WAVES = (0.8, 2.5), 3
"""Periods of a disturbance [s], and how many waves it is of along each axis; chosen: slow enough for hands to be where
they are led, quick enough for several ways back in an episode."""
_HANDS = ("lhand", "rhand")
_PARTS = {
    "left_wrist": "lhand", "right_wrist": "rhand", "left_hand": "q_lhand", "right_hand": "q_rhand",
    "left_force": "f_lpalm", "right_force": "f_rpalm",
}  # fmt: skip


class Numbers:
    """Actions in wbc32, observations in the state that goes with it.

    Args:
        forces: Whether actions tell the forces that palms are to meet: then they are in wbc32_forces.

    Attributes:
        action_names, state_names: Of their numbers.
        forces: Those of an action that are forces.
        known: What an action may say, and what is observed only.
        bounds: Least and largest position of each finger joint [rad], and number of a force [N].
    """

    def __init__(self, forces: bool = False) -> None:
        self.spec = builtin("wbc32_forces" if forces else "wbc32")
        self.aligned, self._layout = aligned_state(self.spec), state_layout(self.spec)
        self.action_names, self.state_names = self.spec.feature_names, self._layout.feature_names
        joints = {joint.name: (joint.position_min, joint.position_max) for joint in self.spec.robot.joints}
        slots = [self.spec.slot("left_hand"), self.spec.slot("right_hand")]
        fingers = [pair for slot in slots for pair in zip(slot.feature_names, slot.joint_names, strict=True)]
        self._told = [(i, self.spec.slot(f"{side}_force")) for i, side in enumerate(SIDES) if forces]
        self.forces = tuple(name for _, slot in self._told for name in slot.feature_names)
        self.bounds = {name: joints[joint] for name, joint in fingers}
        self.bounds |= dict.fromkeys(self.forces, (-FORCE_MAX, FORCE_MAX))
        self._at: tuple[Observation, Anchor] | None = None
        self._palms: tuple[Observation, np.ndarray] | None = None
        self.known = tuple(dict.fromkeys((*self.action_names, *GRASPS, *self.state_names)))

    def anchor(self, observation: Observation) -> Anchor:
        """Where a robot stands; asked for several times a step, found once."""
        if self._at is None or self._at[0] is not observation:
            self._at = observation, Anchor.measured(observation, self.spec.robot)
        return self._at[1]

    def palms(self, observation: Observation) -> np.ndarray:
        """Palm points in the stance, left first, shape (2, 3), [m]; found once as well."""
        found = self._palms
        if found is None or found[0] is not observation:
            anchor = self.anchor(observation)
            T = inverse(anchor.T_world_stance) @ anchor.T_world_base
            hands = (("lhand", "left"), ("rhand", "right"))
            palms = np.array([palm_of(T @ anchor.poses[hand], side, self) for hand, side in hands])
            self._palms = found = observation, palms
        return found[1].copy()

    def executed(self, observation: Observation, forces: np.ndarray | None = None) -> dict[str, float]:
        """Executed action: numbers of the measured wrists and fingers, and of what palms felt, by name.

        Args:
            observation: What was measured.
            forces: On both palms in world axes, shape (2, 3), [N]; none if not given.
        """
        anchor = self.anchor(observation)
        numbers = state_numbers(self.aligned, observation, anchor)
        for i, slot in self._told if forces is not None else ():
            numbers[slot.indices] = anchor.T_world_stance[:3, :3].T @ forces[i]
        return dict(zip(self.action_names, numbers.tolist(), strict=True))

    def state(self, observation: Observation) -> dict[str, float]:
        """The state's numbers by name."""
        numbers = state_numbers(self._layout, observation, self.anchor(observation))
        return dict(zip(self.state_names, numbers.tolist(), strict=True))


class Accepted:
    """The target as it was accepted last, number by number; at first what the robot does.

    Args:
        numbers: What they mean.
        observation: Of the robot at first.

    Attributes:
        last: Its numbers by name.
    """

    def __init__(self, numbers: Numbers, observation: Observation) -> None:
        self._numbers = numbers
        self.last = numbers.executed(observation)

    def take(self, given: dict[str, float], observation: Observation) -> tuple[dict[str, np.ndarray], dict[str, float]]:
        """Parts of a target in world, and the numbers as they were accepted.

        Args:
            given: By name, finite.
            observation: Whose stance the wrists are in.

        Raises:
            ChunkError: If wrist numbers are no rotation.
        """
        numbers, spec = self._numbers, self._numbers.spec
        now = {name: value for name, value in given.items() if name in self.last}
        grasps = {name: float(np.clip(given[name], 0.0, 1.0)) for name in GRASPS if name in given}
        fingers = {name: self._closed(name, closing) for name, closing in grasps.items()}
        for closed in fingers.values():
            now = closed | now
        now |= {name: float(np.clip(now[name], *bounds)) for name, bounds in numbers.bounds.items() if name in now}
        anchor, going_back = numbers.anchor(observation), bool(given.keys() - now.keys() - grasps.keys())
        if going_back:  # what is told no more is let go of
            now = dict.fromkeys(numbers.forces, 0.0) | now
        try:
            chunk = decode(spec, np.array([[now.get(name, value) for name, value in self.last.items()]]), anchor)
        except ChunkError:
            turns = {name for name in now if "_wrist_r" in name}
            if not (going_back and turns):
                raise
            # LeRobot's way back blends rotations number by number: where that gives none, a hand keeps its own.
            return self.take({name: value for name, value in given.items() if name not in turns}, observation)
        self.last = dict(zip(self.last, encode_valid(spec, chunk, anchor)[0].tolist(), strict=True))
        everything = {part: rows[0] for part, rows in rows_of(chunk).items()}
        parts = {part for prefix, part in _PARTS.items() if any(name.startswith(prefix) for name in now)}
        accepted = {name: self.last[name] for name in given if name in self.last}
        return everything, parts, accepted | grasps

    def _closed(self, grasp: str, closing: float) -> dict[str, float]:
        side = grasp.split("_", maxsplit=1)[0]
        slot = self._numbers.spec.slot(f"{side}_hand")
        return dict(
            zip(slot.feature_names, grasp_posture(side, closing, self._numbers.spec.robot).tolist(), strict=True)
        )


class Disturbance:
    """Leads both hands aside a little, smoothly and never twice in the same way.

    Args:
        spread: Standard deviation along each axis [m].
        seed: Of the waves.
    """

    def __init__(self, spread: float, seed: int) -> None:
        rng, shape = np.random.default_rng(seed), (WAVES, len(_HANDS), 3)
        self._size, self._rates = spread * np.sqrt(2.0 / WAVES), 2.0 * np.pi / rng.uniform(*PERIODS, shape)
        self._phases = rng.uniform(0.0, 2.0 * np.pi, shape)

    def led(self, parts: dict[str, np.ndarray], time: float) -> dict[str, np.ndarray]:
        """Parts of a target in world as they are at a time [s]."""
        off = self._size * np.sin(self._rates * time + self._phases).sum(axis=0)
        ways = {name: make_transform(np.eye(3), way) for name, way in zip(_HANDS, off, strict=True)}
        return {name: ways[name] @ value if name in ways else value for name, value in parts.items()}


def palm_of(T_wrist: np.ndarray, side: str, numbers: Numbers) -> np.ndarray:
    """Palm point (3,) of a wrist pose (4, 4), in the same frame [m]."""
    return T_wrist[:3, :3] @ np.asarray(numbers.spec.robot.tool(side).palm_offset) + T_wrist[:3, 3]


def wrist_at(palm: np.ndarray, R: np.ndarray, side: str, numbers: Numbers) -> np.ndarray:
    """Wrist pose (4, 4) whose palm point is there, turned so."""
    return make_transform(R, palm - R @ np.asarray(numbers.spec.robot.tool(side).palm_offset))
