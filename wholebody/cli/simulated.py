"""The simulation that a command asks for: its scene, settings and sensors, and the policy beside it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.cli.console import complain, waiting
from wholebody.config.bounds import require_run

if TYPE_CHECKING:
    from policy.base import Policy
    from policy.executor.executor import Executor
    from wholebody.cli.options import Asking, Simulation
    from wholebody.config import ControllerConfig, LoadConfig, PlanningConfig
    from wholebody.episode.run import Cameras
    from wholebody.sim.sensors import SensorConfig
    from wholebody.verdict.check import Checker
    from wholebody.verdict.fast import FastChecker
    from wholebody.verdict.verdict import Follow

UNSEEN = "the planner sees the robot and the floor alone: what the robot touches of the scene is in the verdict"
SCENE_OF = {
    "grasp": "table_cylinder",
    "touch": "table",
    "wipe": "table",
    "press": "button",
    "pull_drawer": "drawer",
    "turn_handle": "door",
    "lift_box": "table_crate",
    "hand_over": "table_flask",
    "learned_place": "table_cylinder",
}
"""Scenes of policies that need more than the floor."""
STEPS_OF = {"walk_reach": "reach"}
"""When the robot may step in scripted policies that need it; a settings file that says so stands above."""


def scene_for(name: str, options: Simulation) -> str:
    """Scene that an input is simulated in: what was asked for, or the one that it needs."""
    return options.scene or SCENE_OF.get(name.partition("#")[0], "floor")


def make_checker(
    options: Simulation, scene: str, quiet: bool = False, follow: Follow = "planned", steps: str = "never"
) -> Checker:
    """What runs policies in a scene and judges them; says that it takes a while unless quiet.

    Raises:
        ConfigError: If the settings file is malformed.
        ValueError: If there is no such scene.
    """
    from wholebody.episode.run import EpisodeConfig
    from wholebody.sim.robot_errors import REALISTIC_ROBOT
    from wholebody.verdict.check import Checker

    settings = settings_of(options)
    if steps != "never" and options.config is None:
        settings = replace(settings, steps=steps)
    require_run("seed", options.robot_seed, "--robot-seed")
    if scene.lower().endswith(".xml"):
        complain(f"{scene}: {UNSEEN}")
    with waiting("loading the robot, compiling if it is the first time: a minute or two", quiet):
        return Checker(
            scene,
            settings,
            episode=EpisodeConfig(hold=options.hold),
            sensors=_sensors(options),
            payload_kg=options.payload_kg,
            errors=replace(REALISTIC_ROBOT, seed=options.robot_seed) if options.realistic else None,
            follow=follow,
        )


def _sensors(options: Simulation) -> SensorConfig | None:
    """Errors of the sensors, or None where the controller is told the truth at once."""
    from wholebody.sim.sensors import REALISTIC, REALISTIC_READINGS, SensorConfig

    chosen = options.sensors or ("realistic" if options.realistic else "true")
    if chosen == "true" and not options.delay_ms:
        return None
    errors = SensorConfig() if chosen == "true" else REALISTIC_READINGS if options.realistic else REALISTIC
    return replace(errors, delay=1e-3 * options.delay_ms, seed=options.robot_seed)


def make_fast_checker(options: Simulation, scene: str, quiet: bool = False, *, alone: bool = True) -> FastChecker:
    """What judges by plans; says that it takes a while unless quiet.

    Args:
        options: As given.
        scene: What stands around the robot.
        quiet: Without a note.
        alone: Whether nothing is simulated beside.

    Raises:
        ConfigError: If the settings file is malformed.
        ValueError: If something is asked for that only a simulation has.
    """
    from wholebody.verdict.fast import FastChecker

    realistic = {"--realistic": options.realistic, "--sensors": options.sensors == "realistic"}
    asked = realistic | {
        "--delay-ms": options.delay_ms,
        "--payload-kg": any(options.payload_kg) and not options.payload_known,
    }
    if alone and (simulated := [name for name, given in asked.items() if given]):
        raise ValueError(f"--fast simulates nothing, so {', '.join(simulated)} would say nothing; leave one out")
    with waiting("loading the robot, compiling if it is the first time: a minute or two", quiet):
        return FastChecker(settings_of(options), scene)


def settings_of(options: Simulation) -> ControllerConfig:
    """Settings of the file, for the robot and the planning time asked for."""
    from wholebody.config import ControllerConfig

    settings = ControllerConfig()
    if options.config:
        from wholebody.config.file import load_config  # brings the parser of YAML

        settings = load_config(options.config)
    robot = replace(settings.robot, model=options.robot or settings.robot.model)
    changed = {"planning": planning(settings.planning, options), "loads": loads(settings.loads, options)}
    return replace(settings, robot=robot, **changed)


def planning(config: PlanningConfig, options: Simulation) -> PlanningConfig:
    """How long planning takes in simulation, and how far ahead plans are asked for.

    Raises:
        ValueError: If a time or a factor is out of its bounds, or both are given.
    """
    fixed, times = options.planning_ms, options.planning_times
    for name, value in (("planning_ms", fixed), ("planning_times", times)):
        if value is not None:
            require_run(name, value, f"--{name.replace('_', '-')}")
    if fixed is not None and times is not None:
        raise ValueError("--planning-ms says how long planning takes, --planning-times measures it; give one of them")
    if fixed is not None:
        return replace(config, lead=1e-3 * fixed, latency="fixed", factor=1.0)
    return config if times is None else replace(config, latency="measured", factor=times)


def loads(config: LoadConfig, options: Simulation) -> LoadConfig:
    """What the controller is told of the masses in the hands.

    Raises:
        InputError: If one is beyond what is believed.
    """
    if not options.payload_known:
        return config
    for mass in options.payload_kg:
        require_run("payload_known", mass)
    left, right = options.payload_kg
    return replace(config, source="told", left=left, right=right)


def make_executor(policy: Policy, options: Asking) -> Executor:
    """The policy beside a simulated control loop, as late as it was said to be, or as a server really is."""
    from policy.executor.executor import ExecutorConfig
    from policy.executor.simulated import LATENCY_MAX, Latency, simulated_executor, uniform_latency
    from policy.remote.client import RemotePolicy

    config = ExecutorConfig(
        replace_every=options.replace_every, ensemble=options.ensemble, real_time=options.real_time_chunking
    )
    for bound in options.latency_ms or ():
        if not 0.0 <= bound <= 1e3 * LATENCY_MAX:
            raise ValueError(f"--latency-ms has {bound:g} ms; 0 to {1e3 * LATENCY_MAX:g} ms is expected")
    latency: Latency | float | None = None if isinstance(policy, RemotePolicy) else 0.0
    if options.latency_ms is not None:
        latency = uniform_latency(*(1e-3 * bound for bound in options.latency_ms))
    return simulated_executor(policy, latency=latency, config=config)


@contextmanager
def cameras_of(policy: Policy, checker: Checker, images: str) -> Iterator[Cameras | None]:
    """What a policy's cameras see while it runs: pictures of the checker's robot and scene, or nothing.

    Raises:
        RenderError: If pictures are wanted, and there is no OpenGL.
    """
    from wholebody.sim.cameras import MOUNTS, RenderedCameras

    sizes = {name: size for name, size in getattr(policy, "cameras", {}).items() if name in MOUNTS}
    if images != "rendered" or not sizes:
        yield None
        return
    with RenderedCameras(checker.plant, checker.scene, sizes) as cameras:
        yield cameras


def check_settings(file: Path | None) -> None:
    """Refuse a settings file that is missing or malformed before any input is looked at: it holds for all of them.

    Raises:
        ConfigError: With file and line.
    """
    from wholebody.config.file import load_config

    if file is not None:
        load_config(file)


def check_times(duration: float, hold: float) -> None:
    """Refuse times that are negative, no numbers or longer than anyone waits [s].

    Raises:
        InputError: If one is.
    """
    require_run("duration", duration, "--duration")
    require_run("hold", hold, "--hold")
