"""Judges an input with its report: recorded, asked why where it is not feasible, repaired where that helps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from policy.base import Policy
from policy.chunk import ActionChunk
from wholebody.episode.result import EpisodeResult
from wholebody.episode.run import Cameras
from wholebody.sim.record import Record
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.page.ghost import Watched, repaired
from wholebody.verdict.page.page import Shown, require_packages, write_page
from wholebody.verdict.verdict import Verdict, with_why


@dataclass(frozen=True)
class Run:
    """An input that was simulated, for its page.

    Attributes:
        policy: Source of the chunks. name: What the input is called. duration: How long it was run [s].
        verdict: Of the simulation.
        result: What happened.
        record: Every control period.
        chunks: In the order of the policy's answers.
    """

    policy: Policy
    name: str
    duration: float
    verdict: Verdict
    result: EpisodeResult
    record: Record
    chunks: Sequence[ActionChunk]


def simulated(
    checker: Checker,
    policy: Policy,
    name: str,
    duration: float,
    cameras: Cameras | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> Run:
    """Simulate a policy's episode for a page of it.

    Args:
        checker: Of the robot in its scene.
        policy: As in `Checker.check`, and so the others of that name.
        name: What to call the input.
        duration: How long to run it [s].
        cameras: What the policy's cameras see.
        progress: Called with the time and the end time [s].

    Raises:
        InputError: If the extra ``report`` is not installed, or the duration is none.
    """
    require_packages()
    watched, recorder = Watched(policy), checker.recorder()
    verdict, result = checker.check(watched, name, duration, cameras=cameras, progress=progress, recorder=recorder)
    return Run(policy, name, duration, verdict, result, recorder.record(), watched.chunks)


def write_report(checker: Checker, run: Run, path: str | Path, command: str = "") -> Verdict:
    """Write a run as a page, with why it is not feasible; its verdict with that.

    Args:
        checker: That simulated it.
        run: The run.
        path: Where the page goes.
        command: What makes it again, for its reader.

    Raises:
        InputError: If nothing was run.
        OSError: If the page cannot be written.
    """
    verdict, config, ghost = run.verdict, checker.supervisor.config, None
    if verdict.verdict != "feasible":
        fast = FastChecker(config, checker.scene)
        start = "stance" if checker.episode.begin is None else "first"
        verdict = with_why(verdict, fast.check(run.policy, run.name, run.duration, start=start, ask_why=True))
        ghost = repaired(fast, run.chunks, run.record, verdict, run.result)
    write_page(path, Shown(verdict, run.record, checker.supervisor.spec, config, command, ghost, run.result.start))
    return verdict
