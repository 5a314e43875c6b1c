"""Judge an input by planning it and simulating it: feasible, feasible after repair, or infeasible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field

import numpy as np

from models.g1 import g1
from policy.base import Policy
from wholebody.config import ControllerConfig
from wholebody.runtime import EpisodeResult, run_episode
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.recorder import Recorder
from wholebody.supervisor import Supervisor

ERROR_FEASIBLE = 0.02
"""Largest palm error of a step that counts as reached [m]."""


@dataclass(frozen=True)
class Violation:
    """One reason against an input: code, what it is about, time [s], value and bound in SI units."""

    code: str
    subject: str
    time: float | None
    value: float
    bound: float


@dataclass(frozen=True)
class Verdict:
    """The answer. ``verdict`` is ``feasible``, ``feasible_after_repair`` or ``infeasible``.

    Attributes:
        name: Input.
        fell: Whether the robot fell in simulation.
        rms_m, max_m: Palm errors over all steps.
        time_factor: Time taken over time asked for.
        violations: Worst first.
        seconds: Time per status [s].
        demandable_share: Share of the steps that could be asked for (`wholebody.score.demandable`).
        demandable_rms_m, demandable_max_m: Palm errors over those.
        within_20mm: Share of those within 20 mm.
    """

    name: str
    verdict: str
    fell: bool
    rms_m: float
    max_m: float
    time_factor: float
    violations: list[Violation] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    demandable_share: float = 1.0
    demandable_rms_m: float = 0.0
    demandable_max_m: float = 0.0
    within_20mm: float = 1.0

    def as_dict(self) -> dict:
        """Plain data for JSON."""
        return asdict(self)


class Checker:
    """Holds the loaded robot, so that many inputs are cheap."""

    def __init__(self, scene: str = "floor", config: ControllerConfig | None = None) -> None:
        spec = g1()
        self.scene, self.supervisor = scene, Supervisor(spec, config)
        dt = self.supervisor.config.dt
        self.plant = MujocoPlant(spec, scene=scene, control_dt=dt)

    def recorder(self) -> Recorder:
        """A recorder for this robot and scene."""
        return Recorder(self.supervisor.robot.joint_names, self.supervisor.spec.joint_names, self.scene)

    def check(
        self,
        policy: Policy,
        name: str,
        duration: float,
        *,
        progress: Callable[[float, float], None] | None = None,
        recorder: Recorder | None = None,
    ) -> tuple[Verdict, EpisodeResult]:
        """Judge a policy's episode.

        Args:
            policy: Source of the chunks.
            name: What to call the input.
            duration: How long to run it [s].
            progress: See `run_episode`.
            recorder: See `run_episode`.
        """
        result = run_episode(
            policy, self.supervisor, self.plant, duration=duration, recorder=recorder, progress=progress
        )
        return judge(name, result), result


def judge(name: str, result: EpisodeResult) -> Verdict:
    """Verdict on an episode."""
    violations = []
    if result.fall is not None:
        violations.append(Violation("fall", result.fall.cause, result.fall.time, 1.0, 0.0))
    if result.clamped > 0.0:
        violations.append(Violation("out_of_reach", "hand target moved", None, result.clamped, 0.0))
    if result.slowdown > 1.001:
        violations.append(Violation("too_fast_for_balance", "slow-down factor", None, result.slowdown, 1.0))
    if result.errors.size and result.errors.max() > ERROR_FEASIBLE:
        step, side = np.unravel_index(result.errors.argmax(), result.errors.shape)
        hand, time = ("left palm", "right palm")[int(side)], float(result.times[step])
        violations.append(Violation("tracking_error", hand, time, float(result.errors.max()), ERROR_FEASIBLE))
    for pair, time in list(result.contacts.items())[:5]:
        violations.append(Violation("contact", " - ".join(pair), time, 1.0, 0.0))
    violations += [Violation("refused", text, None, 1.0, 0.0) for text in result.refusals[:5]]
    repaired = result.clamped > 0.0 or result.slowdown > 1.001 or result.time_factor > 1.01
    if result.fall is not None or result.refusals:
        verdict = "infeasible"
    else:
        verdict = "feasible_after_repair" if repaired else "feasible"
    largest = float(result.errors.max()) if result.errors.size else 0.0
    fair = result.errors[result.demandable]
    return Verdict(
        name,
        verdict,
        result.fall is not None,
        result.rms,
        largest,
        result.time_factor,
        violations,
        result.seconds,
        demandable_share=float(result.demandable.mean()) if result.demandable.size else 1.0,
        demandable_rms_m=float(np.sqrt(np.mean(fair**2))) if fair.size else 0.0,
        demandable_max_m=float(fair.max()) if fair.size else 0.0,
        within_20mm=float((fair <= ERROR_FEASIBLE).mean()) if fair.size else 1.0,
    )
