"""The robot's tasks as a Gymnasium environment, ``wholebody/G1-v0``: both palms to a goal each, balanced meanwhile."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from lerobot_robot_wholebody.config_wholebody_g1 import WholebodyCameraConfig
from lerobot_robot_wholebody.sight import Cameras
from lerobot_robot_wholebody.target import Accepted, Numbers, palm_of
from lerobot_robot_wholebody.tasks import REACHED, SIDES, Reach
from policy.geometry.se3 import inverse
from wholebody.live.served.client import ServedRobot
from wholebody.live.served.messages import Seen, Served

FPS, STEPS = 30, 150
"""Actions a second [Hz], and in an episode."""
HELD = 10
"""Steps for which both palms must be at their goals for success; chosen: a third of a second, so that none flies by."""
FAR, FALLEN = 10.0, -1.0
"""Largest magnitude of a number of action and observation [m, rad], and the reward of a fall [no unit]; chosen."""


class G1Env(gymnasium.Env):
    """Reach: a goal for each palm, drawn anew by `reset`.

    Reward of a step is minus the larger of both distances [m], 1 more for the step of success, -1 for a fall. Success:
    both palms within `REACHED` of their goals for `HELD` steps; it ends an episode, as a fall does. An action whose
    rotations are none leaves both hands where they are.

    Args:
        cameras: Height and width of pictures by camera; without any there are no ``pixels``.
        scene: Around the robot.
        render_mode: ``rgb_array`` draws what the head's camera sees.
        steps: In an episode.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": FPS}  # noqa: RUF012 - as Gymnasium has it
    task = task_description = "reach the balls"

    def __init__(
        self,
        cameras: Mapping[str, tuple[int, int]] | None = None,
        scene: str = "floor",
        render_mode: str | None = None,
        steps: int = STEPS,
    ) -> None:
        self._max_episode_steps = steps
        self.render_mode, self._numbers, self._task = render_mode, Numbers(), Reach(0)
        self._sizes, self._scene = dict(cameras or {}), scene
        self._robot, self._drawn, self._pictures = ServedRobot(Served(scene, clock="lockstep")), None, None
        self._seen: Seen | None = None
        box = gymnasium.spaces.Box
        self.action_space = box(-FAR, FAR, (len(self._numbers.action_names),), np.float32)
        spaces: dict[str, Any] = {
            "agent_pos": box(-FAR, FAR, (len(self._numbers.state_names) + len(self._task.names),), np.float32),
            "environment_state": box(-FAR, FAR, (len(self._task.names),), np.float32),
        }
        if self._sizes:
            pixels = {name: box(0, 255, (*size, 3), np.uint8) for name, size in self._sizes.items()}
            spaces["pixels"] = gymnasium.spaces.Dict(pixels)
        self.observation_space = gymnasium.spaces.Dict(spaces)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """The robot in its stance, with other goals."""
        super().reset(seed=seed)
        self._task.draw(self.np_random)
        self._seen = self._robot.reset() if self._robot.running else self._robot.start()
        self._accepted, self._steps, self._held = Accepted(self._numbers, self._seen.observation), 0, 0
        return self._observation(), {"is_success": False}

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Say where wrists and fingers are to be, and let a step pass."""
        given = dict(zip(self._numbers.action_names, np.asarray(action, dtype=float).tolist(), strict=True))
        taken = True
        try:
            parts, _, _ = self._accepted.take(given, self._seen.observation)
            self._robot.put(**parts)
        except ValueError:
            taken = False
        self._robot.advance(1.0 / FPS)
        self._seen = self._robot.see()
        self._steps += 1
        far = float(self.distances().max())
        self._held = self._held + 1 if far <= REACHED else 0
        success, fell = self._held >= HELD, self._seen.fallen
        reward = FALLEN if fell else float(success) - far
        return (
            self._observation(),
            reward,
            success or fell,
            self._steps >= self._max_episode_steps,
            {"is_success": success, "taken": taken, "fell": fell},
        )

    def distances(self) -> np.ndarray:
        """Of both palms from their goals, shape (2,), [m]."""
        anchor = self._numbers.anchor(self._seen.observation)
        T = inverse(anchor.T_world_stance) @ anchor.T_world_base
        hands = zip(("lhand", "rhand"), SIDES, strict=True)
        palms = np.array([palm_of(T @ anchor.poses[hand], side, self._numbers) for hand, side in hands])
        return np.linalg.norm(palms - self._task.goals, axis=1)

    def _observation(self) -> dict[str, Any]:
        numbers = self._numbers.state(self._seen.observation) | self._task.shown()
        found: dict[str, Any] = {
            "agent_pos": np.array([*numbers.values()], dtype=np.float32),
            "environment_state": self._task.goals.ravel().astype(np.float32),
        }
        if self._sizes:
            self._drawn = self._drawn or self._cameras(self._sizes)
            found["pixels"] = self._look(self._drawn)
        return found

    def render(self) -> np.ndarray | None:
        """What the head's camera sees, uint8 (240, 320, 3)."""
        if self.render_mode is None or self._seen is None:
            return None
        self._pictures = self._pictures or self._cameras({"head": (240, 320)})
        return self._look(self._pictures)["head"]

    def _cameras(self, sizes: Mapping[str, tuple[int, int]]) -> Cameras:
        settings = {name: WholebodyCameraConfig(height=size[0], width=size[1]) for name, size in sizes.items()}
        return Cameras(self._scene, settings, self._task.marks)

    def _look(self, cameras: Cameras) -> dict[str, np.ndarray]:
        return cameras.look(self._seen, self._task.in_world(self._numbers.anchor(self._seen.observation)))

    def close(self) -> None:
        """End the robot's processes."""
        self._robot.close()
        for cameras in filter(None, (self._drawn, self._pictures)):
            cameras.close()
        self._drawn = self._pictures = None


gymnasium.register("wholebody/G1-v0", entry_point=G1Env)
