"""Judges an input with its report: recorded, asked why where it is not feasible, repaired where that helps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from policy.base import Policy
from wholebody.episode.run import Cameras
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.page.ghost import Watched, repaired
from wholebody.verdict.page.page import Shown, require_packages, write_page
from wholebody.verdict.verdict import Verdict, with_why


def report(
    checker: Checker,
    policy: Policy,
    name: str,
    duration: float,
    path: str | Path,
    command: str = "",
    cameras: Cameras | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> Verdict:
    """Judge a policy's episode, and write it as a page.

    Args:
        checker: Of the robot in its scene.
        policy: As in `Checker.check`, and so the others of that name.
        name: What to call the input.
        duration: How long to run it [s].
        path: Where the page goes.
        command: What makes it again, for its reader.
        cameras: What the policy's cameras see.
        progress: Called with the time and the end time [s].

    Raises:
        InputError: If the extra ``report`` is not installed, or the duration is none.
        OSError: If the page cannot be written.
    """
    require_packages()
    watched, recorder = Watched(policy), checker.recorder()
    verdict, result = checker.check(watched, name, duration, cameras=cameras, progress=progress, recorder=recorder)
    record, config, ghost = recorder.record(), checker.supervisor.config, None
    if verdict.verdict != "feasible":
        fast = FastChecker(config, checker.scene)
        start = "stance" if checker.episode.begin is None else "first"
        asked = fast.check(policy, name, duration, start=start, ask_why=True)
        verdict = with_why(verdict, asked)
        ghost = repaired(fast, watched.chunks, record, verdict, result.orientation_free)
    write_page(path, Shown(verdict, record, checker.supervisor.spec, config, command, ghost, result.start))
    return verdict
