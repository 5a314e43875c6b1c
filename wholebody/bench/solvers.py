"""The same motions with each QP solver, without a second one to fall back on: what `wholebody bench solvers` prints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.spec import RobotSpec
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy, stance_pose
from wholebody.config import ControllerConfig
from wholebody.control.tick_report import TickLevel
from wholebody.episode.result import EpisodeResult
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.types import JointCommand, RobotState


@dataclass(frozen=True)
class SolverRow:
    """How one motion went with one solver.

    Attributes:
        solver: Who gave the answers. motion: Name of the motion.
        ticks: Control periods. failures: Those in which its answer was not accepted.
        fell: Whether the robot fell.
        rms, largest: Palm error against the chunks at their own times [m].
        time_factor: Time on chunks over chunk time covered.
        primal, dual: Worst constraint violation, and worst scaled stationarity or complementarity, of any answer.
        median, p99: Thread CPU time of solving and judging one program [s]; 0 for the compiled one, which is part of a
            compiled tick.
    """

    solver: str
    motion: str
    ticks: int
    failures: int
    fell: bool
    rms: float
    largest: float
    time_factor: float
    primal: float
    dual: float
    median: float
    p99: float


class _Watched(Supervisor):
    """A supervisor that notes what the solver answered."""

    def reset(self, state: RobotState, now: float | None = None) -> None:
        super().reset(state, now)
        self.levels: list[TickLevel] = []
        self.residuals: list[tuple[float, float]] = []
        self.seconds: list[float] = []

    def step(self, state: RobotState, now: float | None = None) -> JointCommand:
        command = super().step(state, now)
        tick = self.last_tick
        if tick is not None:
            self.levels.append(tick.level)
            r = tick.qp.residuals
            self.residuals.append((r.primal, max(r.stationarity, r.complementarity)))
            self.seconds.append(tick.qp.seconds)
        return command


def study(
    spec: RobotSpec,
    solver: str,
    policies: Sequence[ScriptedPolicy],
    *,
    seconds: float = 10.0,
    episode: EpisodeConfig | None = None,
) -> list[SolverRow]:
    """Run every motion in MuJoCo with one solver and no fallback.

    Args:
        spec: The robot.
        solver: Name of the QP solver, "compiled", or "placo" for the controller backend of that name.
        policies: The motions.
        seconds: Time after which a motion is cut short [s].
        episode: Times of standing before and after.
    """
    changed = {"backend": "placo"} if solver == "placo" else {"solver": solver}
    supervisor = _Watched(spec, ControllerConfig(fallback="none", **changed))
    plant = MujocoPlant(spec, control_dt=supervisor.config.dt)
    rows = []
    for policy in policies:
        result = run_episode(policy, supervisor, plant, duration=min(seconds, policy.duration), config=episode)
        rows.append(_row(policy.name, supervisor, result))
    return rows


def _row(motion: str, watched: _Watched, result: EpisodeResult) -> SolverRow:
    worst = np.max(watched.residuals, axis=0)
    median, p99 = np.percentile(watched.seconds, [50, 99])
    return SolverRow(
        solver=watched.last_tick.qp.solver,
        motion=motion,
        ticks=len(watched.levels),
        failures=int(np.count_nonzero(watched.levels)),
        fell=result.fall is not None,
        rms=result.rms,
        largest=float(result.errors.max(initial=0.0)),
        time_factor=result.time_factor,
        primal=float(worst[0]),
        dual=float(worst[1]),
        median=float(median),
        p99=float(p99),
    )


def standing(seconds: float) -> ScriptedPolicy:
    """Both hands stay where they are in the stance."""
    pose = stance_pose()

    def script(t: np.ndarray) -> ScriptedMotion:
        palms = [np.tile(p, (len(t), 1)) for p in (pose.p_world_lpalm, pose.p_world_rpalm)]
        return ScriptedMotion(*palms, pose.R_world_lhand, pose.R_world_rhand, pose.q_lhand, pose.q_rhand)

    return ScriptedPolicy("standing", script, seconds)


HEADINGS = ("solver", "motion", "fell", "failures", "RMS / max mm", "time factor", "primal", "dual", "p50 / p99 ms")


def cells(row: SolverRow) -> tuple[str, ...]:
    """Cells of a row below `HEADINGS`."""
    return (
        row.solver,
        row.motion,
        "yes" if row.fell else "no",
        f"{row.failures} of {row.ticks}",
        f"{1e3 * row.rms:.2f} / {1e3 * row.largest:.1f}",
        f"{row.time_factor:.3f}",
        f"{row.primal:.0e}",
        f"{row.dual:.0e}",
        f"{1e3 * row.median:.2f} / {1e3 * row.p99:.2f}" if row.median else "in the tick",
    )
