"""The robot's tasks as a Gymnasium environment, ``wholebody/G1-v0``: done with balance kept."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from lerobot_robot_wholebody.config_wholebody_g1 import TOLD, WholebodyCameraConfig
from lerobot_robot_wholebody.sight import Cameras
from lerobot_robot_wholebody.target import Accepted, Numbers
from lerobot_robot_wholebody.tasks import task_of
from wholebody.live.served.client import ServedRobot
from wholebody.live.served.messages import Seen, Served

FPS = 30
"""Actions a second [Hz]."""
SEEDS = 2**31
"""How many realistic robots there are [no unit]; chosen."""
FAR, FALLEN = 10.0, -1.0
"""Largest magnitude of a number of action and observation [m, rad], and the reward of a fall [no unit]; chosen."""


class G1Env(gymnasium.Env):
    """A task of `tasks.task_of`, another instance of it by `reset`.

    Reward of a step is minus how far from done it is [m], 1 more for the step of success, -1 for a fall. Success: it is
    done for as many steps as the task says; it ends an episode, as a fall does. An action whose rotations are none
    leaves both hands where they are.

    Args:
        cameras: Height and width of pictures by camera; without any there are no ``pixels``.
        scene: Around the robot, where the task has none of its own.
        render_mode: ``rgb_array`` draws what the head's camera sees.
        steps: In an episode; the task's own number if None.
        task: Its name.
        gate: Whether targets are judged before they are followed.
        realistic: Whether the robot differs from its model, and its state is estimated; another one by the seed.
        report: Where the episodes, successes and falls are counted at the end, as JSON; nowhere if empty.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": FPS}  # noqa: RUF012 - as Gymnasium has it

    def __init__(
        self,
        cameras: Mapping[str, tuple[int, int]] | None = None,
        scene: str = "floor",
        render_mode: str | None = None,
        steps: int | None = None,
        task: str = "reach",
        gate: bool = False,
        realistic: bool = False,
        report: str = "",
    ) -> None:
        self._task = task_of(task, 0)
        if self._task is None:
            raise ValueError("an environment needs a task")
        self.task = self.task_description = self._task.words
        self._max_episode_steps = steps or self._task.steps
        self.render_mode, self._numbers = render_mode, Numbers(task in TOLD)
        self._sizes, self._scene = dict(cameras or {}), self._task.scene or scene
        served = Served(self._scene, clock="lockstep", gate=gate, realistic=realistic)
        self._robot, self._drawn, self._pictures = ServedRobot(served), None, None
        self._seen: Seen | None = None
        self._report, self._count = report, {"episodes": 0, "successes": 0, "falls": 0}
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
        """The robot in its stance, with another instance of the task."""
        super().reset(seed=seed)
        self._task.draw(self.np_random)
        runs, realistic = self._robot.running, self._robot.served.realistic
        self._seen = None if runs else self._robot.start()
        if runs or realistic:
            self._seen = self._robot.reset(int(self.np_random.integers(SEEDS)) if realistic else 0)
        if (objects := self._task.objects(self._seen.objects)) is not None:
            self._robot.place(objects)
            self._seen = self._robot.see()
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
        self._count["episodes"] += int(self._steps == 1)  # lerobot-eval resets twice before it steps
        far = self._task.far(self._seen, self._numbers.palms(self._seen.observation))
        self._held = self._held + 1 if far <= 0.0 else 0
        success, fell = self._held >= self._task.held, self._seen.fallen
        self._count["successes"] += int(success)
        self._count["falls"] += int(fell and not success)
        reward = FALLEN if fell else float(success) - far
        return (
            self._observation(),
            reward,
            success or fell,
            self._steps >= self._max_episode_steps,
            {"is_success": success, "taken": taken, "fell": fell},
        )

    def _observation(self) -> dict[str, Any]:
        observation, about = self._seen.observation, self._numbers
        shown = self._task.shown(self._seen, about.anchor(observation), about.palms(observation))
        numbers = about.state(observation) | shown
        found: dict[str, Any] = {
            "agent_pos": np.array([*numbers.values()], dtype=np.float32),
            "environment_state": np.array([*shown.values()], dtype=np.float32),
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
        if self._report:
            Path(self._report).write_text(json.dumps(self._count))
        self._robot.close()
        for cameras in filter(None, (self._drawn, self._pictures)):
            cameras.close()
        self._drawn = self._pictures = None


gymnasium.register("wholebody/G1-v0", entry_point=G1Env)
