"""Settings of the environment for `lerobot-eval` and `lerobot-train`: ``--env.NAME=VALUE``."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_IMAGES, OBS_STATE

from lerobot_robot_wholebody.config_wholebody_g1 import TASKS, TOLD, WholebodyCameraConfig

if TYPE_CHECKING:
    from gymnasium import Env
    from gymnasium.vector import VectorEnv


@EnvConfig.register_subclass("wholebody")
@dataclass
class WholebodyEnvConfig(EnvConfig):
    """The robot's tasks, in simulated time."""

    task: str | None = "reach"
    """What is to be done."""
    fps: int = 30
    """Actions a second; no other rate is."""
    scene: str = "floor"
    """Around the robot."""
    cameras: dict[str, WholebodyCameraConfig] = field(default_factory=dict)
    """Cameras by name, as those of the robot."""
    steps: int | None = None
    """Steps of an episode; the task's own number if not given."""
    gate: bool = False
    """Whether targets are judged before they are followed."""
    realistic: bool = False
    """Whether the robot differs from its model, and its state is estimated; another one by the seed."""
    report: str = ""
    """File in which episodes, successes and falls are counted at the end; of the last one, of several beside."""

    def __post_init__(self) -> None:
        for name, known in (("task", TASKS[1:]), ("fps", (30,))):
            if getattr(self, name) not in known:
                there = ", ".join(map(str, known))
                raise ValueError(f"--env.{name}={getattr(self, name)} is unknown; there are {there}")
        shown = 6 if self.task in ("reach", "wipe") else 9
        sizes = {
            "action": (38 if self.task in TOLD else 32, ACTION, FeatureType.ACTION),
            "agent_pos": (23 + shown, OBS_STATE, FeatureType.STATE),
            "environment_state": (shown, OBS_ENV_STATE, FeatureType.ENV),
        }
        for name, (size, key, kind) in sizes.items():
            self.features[name], self.features_map[name] = PolicyFeature(kind, (size,)), key
        for name, camera in self.cameras.items():
            key = f"pixels/{name}"
            self.features[key] = PolicyFeature(FeatureType.VISUAL, (camera.height, camera.width, 3))
            self.features_map[key] = f"{OBS_IMAGES}.{name}"

    @property
    def package_name(self) -> str:
        """What registers the environment."""
        return "lerobot_robot_wholebody.environment"

    @property
    def gym_id(self) -> str:
        """Name of the environment."""
        return "wholebody/G1-v0"

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of the environment."""
        sizes = {name: (camera.height, camera.width) for name, camera in self.cameras.items()}
        own = {name: getattr(self, name) for name in ("task", "scene", "steps", "gate", "realistic", "report")}
        return own | {"cameras": sizes, "render_mode": "rgb_array"}

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, dict[int, VectorEnv]]:
        """Environments beside each other; LeRobot's own way does not register them in the processes of several."""
        from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

        made = [partial(_made, self.gym_kwargs)] * n_envs
        if use_async_envs and n_envs > 1:
            # LeRobot is loaded once, and not by each of their processes.
            get_context("forkserver").set_forkserver_preload([self.package_name])
            envs = AsyncVectorEnv(made, context="forkserver", autoreset_mode=AutoresetMode.SAME_STEP)
        else:
            envs = SyncVectorEnv(made, autoreset_mode=AutoresetMode.SAME_STEP)
        return {self.type: {0: envs}}


def _made(arguments: dict[str, Any]) -> Env:
    import gymnasium

    import lerobot_robot_wholebody.environment  # noqa: F401 - registers it, in whatever process this is

    return gymnasium.make("wholebody/G1-v0", disable_env_checker=True, **arguments)
