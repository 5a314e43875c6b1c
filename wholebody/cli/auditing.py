"""Judges an input of an audit, in a process of its own: the answer of ``check``, and how much slower would do."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import redirect_stderr
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Option

from wholebody.cli.judging import CRASH, Judge
from wholebody.cli.options import AssumeSpec, CsvFps, Input, Judging, RobotModel, Sampling, Simulation
from wholebody.cli.sources import length, opened

if TYPE_CHECKING:
    from wholebody.verdict.audit.outcome import Outcome

SLOWER = (1.25, 1.6, 2.0, 3.0, 4.0)
"""Each a factor on the time of an input; of those that do the least is told; chosen: steps of a quarter."""


@dataclass(frozen=True)
class Audited:
    """What is audited, and how."""

    episodes: Annotated[str, Option(help="Episodes of dataset folders, such as 0-3,7; all if empty.")] = ""
    csv_fps: CsvFps = 60.0
    assume_spec: AssumeSpec = ""
    config: Annotated[Path | None, Option("--config", help="YAML file with changed settings.")] = None
    robot: RobotModel = ""
    simulated: Annotated[bool, Option("--simulated", help="Simulate every input, at about real time.")] = False
    start: Annotated[
        Literal["first", "stance"], Option(help="Where the robot is: hands at the first step, or in the stance.")
    ] = "first"
    slower: Annotated[
        bool, Option(help="Look for how much slower an input that is not feasible would be: a few more looks at it.")
    ] = True


def make_judging(audited: Audited) -> Callable[[str], Outcome]:
    """What judges an input by its name."""
    given = Input(csv_fps=audited.csv_fps, assume_spec=audited.assume_spec)
    simulation = Simulation(config=audited.config, robot=audited.robot)
    judge = Judge(given, simulation, Sampling(), Judging(fast=not audited.simulated, start=audited.start), quiet=True)

    def judged(name: str) -> Outcome:
        from wholebody.verdict.audit.outcome import Outcome

        said = StringIO()
        with redirect_stderr(said):
            answer = judge.answer(name)
            if answer.verdict is None:
                ending = "crashed" if answer.code == CRASH else "malformed"
                message = said.getvalue().strip().removeprefix("wholebody: ")
                return Outcome(name=name, ending=ending, message=message)
            policy = opened(name, given)
            seconds = length(policy, 0.0)
            looked_at = audited.slower and answer.verdict.verdict != "feasible"
            factor = slower(judge, name) if looked_at else None
        verdict = replace(answer.verdict, config={}, versions={}).as_dict()
        return Outcome(name=name, ending="judged", verdict=verdict, motion_s=seconds, slower=factor)

    return judged


def slower(judge: Judge, name: str) -> float | None:
    """Least of `SLOWER` with which a recording is feasible by its plans; None without any."""
    from policy.recorded.replay import ReplayPolicy
    from wholebody.verdict.repair import slowed

    policy = opened(name, judge.given)

    def holds(factor: float) -> bool:
        slow = ReplayPolicy(slowed(policy.episode, factor), name=name, spec=policy.spec, horizon=policy.horizon)
        checker, start = judge.fast(judge.simulation.scene or "floor"), judge.judging.starts(name)
        return checker.check(slow, name, slow.duration, start=start).verdict == "feasible"

    if not isinstance(policy, ReplayPolicy) or not holds(SLOWER[-1]):
        return None
    return next((factor for factor in SLOWER[:-1] if holds(factor)), SLOWER[-1])
