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
from wholebody.cli.options import AssumeSpec, CsvFps, Input, Judging, ReadAs, RobotModel, Sampling, Simulation
from wholebody.cli.sources import length, opened

if TYPE_CHECKING:
    from policy.base import Policy
    from wholebody.verdict.audit.outcome import Outcome


@dataclass(frozen=True)
class Audited:
    """What is audited, and how."""

    episodes: Annotated[str, Option(help="Episodes of dataset folders, such as 0-3,7; all if empty.")] = ""
    csv_fps: CsvFps = 60.0
    assume_spec: AssumeSpec = ""
    read_as: ReadAs = ""
    config: Annotated[Path | None, Option("--config", help="YAML file with changed settings.")] = None
    robot: RobotModel = ""
    simulated: Annotated[bool, Option("--simulated", help="Simulate every input, at about real time.")] = False
    start: Annotated[
        Literal["first", "stance"], Option(help="Where the robot is: hands at the first step, or in the stance.")
    ] = "first"
    slower: Annotated[
        bool, Option(help="Look for how much slower an input that is not feasible would be: a few more looks at it.")
    ] = True
    repair: Annotated[
        bool,
        Option("--repair", help="Write what is not feasible slower, or its path bent, and datasets with that in them."),
    ] = False


def make_judging(audited: Audited, folder: Path) -> Callable[[str], Outcome]:
    """What judges an input by its name, and writes repaired ones into a folder."""
    given = Input(csv_fps=audited.csv_fps, assume_spec=audited.assume_spec, read_as=audited.read_as)
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
            policy = opened(name, given, judge.robot())
            verdict = replace(answer.verdict, config={}, versions={}).as_dict()
            outcome = Outcome(name=name, ending="judged", verdict=verdict, motion_s=length(policy, 0.0))
            if (audited.slower or audited.repair) and answer.verdict.verdict != "feasible":
                outcome = _changed(outcome, policy, judge, folder if audited.repair else None)
        return outcome

    return judged


def _changed(outcome: Outcome, policy: Policy, judge: Judge, folder: Path | None) -> Outcome:
    """How much slower a recording is feasible by its plans, and its repair where there is a folder for it."""
    from policy.errors import SpecError
    from policy.recorded.replay import ReplayPolicy
    from wholebody.verdict.audit.episode_repair import EpisodeRepairer
    from wholebody.verdict.audit.repairs import repair_of

    if not isinstance(policy, ReplayPolicy):
        return outcome
    checker = judge.fast(judge.simulation.scene or "floor")
    repairer = EpisodeRepairer(checker, policy, judge.judging.starts(outcome.name))
    outcome = replace(outcome, slower=repairer.slower())
    if folder is None:
        return outcome
    try:
        change = repair_of(repairer, policy, outcome.name, outcome.slower, folder)
    except SpecError as error:
        return replace(outcome, message=f"not repaired: {error}; `wholebody convert` makes wrists of joints")
    if change is None:
        return replace(outcome, message="not repaired: `wholebody repair` tries more")
    return replace(outcome, repair={"slower": change.slower, "moved_m": change.moved, "turned_rad": change.turned})
