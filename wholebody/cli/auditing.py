"""Judges an input of an audit in a process of its own: the answer of ``check``, and the slow-down that would do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from dataclasses import asdict, dataclass, replace
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Option

from wholebody.cli.judging import CRASH, InputJudge
from wholebody.cli.options import AssumeSpec, Fps, Input, Judging, ReadAs, RobotModel, Sampling, Simulation
from wholebody.cli.simulated import settings_of
from wholebody.cli.sources import codes_of, is_dataset, layout_named, length, opened, robot_of

if TYPE_CHECKING:
    from policy.base import Policy
    from wholebody.config.robot import RobotConfig
    from wholebody.verdict.audit.outcome import AuditOutcome

MAPPINGS = "datasets.json"
"""What each dataset was read as."""


@dataclass(frozen=True)
class Audited:
    """Options of an audit."""

    episodes: Annotated[str, Option(help="Episodes of dataset folders, such as 0-3,7; all if empty.")] = ""
    fps: Fps = None
    assume_spec: AssumeSpec = ""
    read_as: ReadAs = ""
    config: Annotated[Path | None, Option("--config", help="YAML file with changed settings.")] = None
    robot: RobotModel = ""
    simulated: Annotated[bool, Option("--simulated", help="Simulate every input, at about real time.")] = False
    start: Annotated[
        Literal["first", "stance"], Option(help="Where the robot is: hands at the first step, or in the stance.")
    ] = "first"
    odds: Annotated[
        bool, Option("--odds", help="Tell the odds of a fall as given and of being followed: half as long again.")
    ] = False
    slower: Annotated[
        bool, Option(help="Look for how much slower an input that is not feasible would be: a few more looks at it.")
    ] = True
    repair: Annotated[
        bool,
        Option("--repair", help="Write what is not feasible slower, or its path bent, and datasets with that in them."),
    ] = False


def make_judging(audited: Audited, folder: Path) -> Callable[[str], AuditOutcome]:
    """What judges an input by its name, and writes repaired ones into a folder."""
    given = Input(fps=audited.fps, assume_spec=audited.assume_spec, read_as=audited.read_as)
    simulation = Simulation(config=audited.config, robot=audited.robot)
    judge = InputJudge(
        given, simulation, Sampling(), Judging(fast=not audited.simulated, start=audited.start), quiet=True,
        odds=audited.odds,
    )  # fmt: skip

    def judged(name: str) -> AuditOutcome:
        from wholebody.verdict.audit.outcome import AuditOutcome

        output = StringIO()
        with redirect_stderr(output):
            answer = judge.answer(name)
            if answer.verdict is None:
                ending = "crashed" if answer.code == CRASH else "malformed"
                message = output.getvalue().strip().removeprefix("wholebody: ")
                return AuditOutcome(name=name, ending=ending, message=message)
            policy = opened(name, given, judge.robot())
            verdict = replace(answer.verdict, config={}, versions={}).as_dict()
            facts = {"verdict": verdict, "motion_s": length(policy, 0.0), "gaps": _gaps(name, given, judge.robot())}
            outcome = AuditOutcome(name=name, ending="judged", **facts)
            if (audited.slower or audited.repair) and answer.verdict.verdict != "feasible":
                outcome = _changed(outcome, policy, judge, folder if audited.repair else None)
        return outcome

    return judged


def _gaps(name: str, given: Input, robot: RobotConfig) -> list[dict]:
    """How measured joints of an episode follow commanded ones; nothing of another input."""
    from policy.dataset.beside.states import episode_gaps
    from policy.dataset.open import open_dataset
    from policy.errors import PolicyError
    from wholebody.verdict.audit.tables import whence

    folder, number = whence(name)
    if number is None:
        return []
    drives = robot_of(robot)
    settings = {"assume": layout_named(given.assume_spec, drives), "robot": drives}
    try:
        dataset = open_dataset(folder)
        return [
            asdict(gap) for gap in episode_gaps(dataset, dataset.episodes[number], settings, codes_of(given.read_as))
        ]
    except PolicyError:
        return []  # an input without joints in both


def _changed(outcome: AuditOutcome, policy: Policy, judge: InputJudge, folder: Path | None) -> AuditOutcome:
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


def write_mappings(folder: Path, inputs: Sequence[str], audited: Audited) -> None:
    """Write what each dataset among the inputs was read as: joints by column, what was left out and assumed.

    Raises:
        OSError: If it cannot be written.
    """
    import json

    from policy.dataset.naming.mapping import mapping
    from policy.errors import PolicyError
    from policy.writing import write_text

    drives = robot_of(settings_of(Simulation(config=audited.config, robot=audited.robot)).robot)
    assume = layout_named(audited.assume_spec, drives)
    found = {}
    for name in filter(is_dataset, dict.fromkeys(inputs)):
        try:
            found[name] = mapping(name, assume=assume, read_as=codes_of(audited.read_as), robot=drives)
        except PolicyError as error:
            found[name] = {"refused": str(error)}
    if found:
        write_text(folder / MAPPINGS, json.dumps(found, indent=2) + "\n", errors="backslashreplace")
