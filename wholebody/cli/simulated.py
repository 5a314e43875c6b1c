"""The simulation that a command asks for: its scene, settings and sensors, and the policy beside it."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from typing import TYPE_CHECKING

from wholebody.cli.console import waiting

if TYPE_CHECKING:
    from policy.base import Policy
    from policy.executor.executor import Executor
    from wholebody.cli.options import Asking, Simulation
    from wholebody.verdict.check import Checker

SCENE_OF = {"grasp": "table_cylinder"}
"""Scenes of scripted policies that need more than the floor."""


def make_checker(options: Simulation, scene: str) -> Checker:
    """What runs policies in a scene and judges them.

    Raises:
        ConfigError: If the settings file is malformed.
        ValueError: If there is no such scene.
    """
    from wholebody.config_file import load_config
    from wholebody.episode.run import EpisodeConfig
    from wholebody.sim.sensors import REALISTIC, SensorConfig
    from wholebody.verdict.check import Checker

    settings = load_config(options.config) if options.config else None
    sensors = replace(REALISTIC if options.realistic else SensorConfig(), delay=1e-3 * options.delay_ms)
    with waiting("loading the robot; the first time takes longest"):
        return Checker(
            scene,
            settings,
            episode=EpisodeConfig(hold=options.hold),
            sensors=sensors if options.realistic or options.delay_ms else None,
            payload_kg=options.payload_kg,
        )


def make_executor(policy: Policy, options: Asking) -> Executor:
    """The policy beside a simulated control loop, as late as it was said to be, or as a server really is."""
    from policy.executor.executor import ExecutorConfig
    from policy.executor.simulated import Latency, simulated_executor, uniform_latency
    from policy.remote.client import RemotePolicy

    config = ExecutorConfig(
        replace_every=options.replace_every, ensemble=options.ensemble, real_time=options.real_time_chunking
    )
    latency: Latency | float | None = None if isinstance(policy, RemotePolicy) else 0.0
    if options.latency_ms is not None:
        latency = uniform_latency(*(1e-3 * bound for bound in options.latency_ms))
    return simulated_executor(policy, latency=latency, config=config)


def check_times(duration: float, hold: float) -> None:
    """Refuse times that are negative or no numbers [s].

    Raises:
        ValueError: If one is.
    """
    for name, seconds, meaning in (("--duration", duration, " (0: the whole input)"), ("--hold", hold, "")):
        if not (isfinite(seconds) and seconds >= 0.0):
            raise ValueError(f"{name} is {seconds} s; it must be at least 0{meaning}")
