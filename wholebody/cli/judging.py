"""Inputs judged one after the other, or side by side in processes of their own; answers in the inputs' order."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import redirect_stderr
from dataclasses import dataclass, replace
from functools import cache
from io import StringIO
from multiprocessing import get_context
from signal import SIG_DFL, SIGINT, signal
from typing import TYPE_CHECKING

from policy.writing import OutputError
from wholebody.cli.console import complain, heartbeat, log_to_terminal, progress_bar, waiting
from wholebody.cli.crash import CRASH, CrashError, ours, sentence
from wholebody.cli.simulated import STEPS_OF, cameras_of, make_checker, make_fast_checker, scene_for, settings_of
from wholebody.cli.sources import expanded, length, opened, tell, walks_of
from wholebody.resources import end_with_parent, processors

if TYPE_CHECKING:
    from policy.base import Policy
    from wholebody.cli.options import Input, Judging, Sampling, Simulation
    from wholebody.cli.pages import Pages
    from wholebody.verdict.verdict import Verdict

FEASIBLE, INFEASIBLE, MALFORMED = 0, 1, 2
"""Exit codes, besides that of a crash; of several inputs the largest counts."""
BROKEN = "its process ended abruptly, as where memory is short: judge fewer at a time (-j)"


@dataclass(frozen=True)
class Answer:
    """What became of an input.

    Attributes:
        code: Exit code.
        verdict: None if it could not be judged, which was said on standard error.
        stderr: What a process of its own wrote there.
        misuse: What is wrong with the options, which holds for every input.
    """

    code: int
    verdict: Verdict | None = None
    stderr: str = ""
    misuse: str = ""


class InputJudge:
    """Judges inputs with the same options; a robot in a scene is loaded once.

    Args:
        given: How much of each input is read.
        simulation: Where the robot is simulated.
        sampling: How checkpoints are run.
        judging: Whether anything is simulated.
        quiet: Without a progress bar.
        pages: Where the report of each input is written; without them if None.
        odds: Tell the odds of a fall, which take a third of the time of a verdict by plans.
    """

    def __init__(
        self, given: Input, simulation: Simulation, sampling: Sampling, judging: Judging, *, quiet: bool = False,
        pages: Pages | None = None, odds: bool = True,
    ) -> None:  # fmt: skip
        self._odds = odds
        self.given, self.simulation, self.sampling, self.judging = given, simulation, sampling, judging
        self.quiet, self.pages = quiet, pages
        self._first = not judging.as_given
        follow = "as_given" if judging.as_given else "planned"
        self.robot = cache(lambda: settings_of(simulation).robot)
        self.walks = cache(lambda: None if judging.fast else walks_of(settings_of(simulation)))
        self._checker = cache(lambda scene, steps: make_checker(simulation, scene, quiet, follow, steps))
        self.fast = cache(lambda scene: make_fast_checker(simulation, scene, quiet, alone=judging.fast))

    def names(self, inputs: Iterable[str]) -> Iterator[str | Answer]:
        """Inputs to judge, one per episode of a dataset, or the answer about an input that cannot be read."""
        for name in inputs:
            try:
                yield from expanded(name, self.given.episodes)
            except Exception as error:  # noqa: BLE001 - whatever it is, the other inputs are judged all the same
                yield self._failed(name, error)

    def answer(self, name: str, title: str = "") -> Answer:
        """Judge an input: by its plans, and then in a simulation, if that is wanted.

        Args:
            name: As a user named it.
            title: What to call it while it is simulated.

        Raises:
            WholebodyError, RobotSpecError, ValueError: If the options are wrong, which they are for every input.
        """
        try:
            policy = opened(name, self.given, self.robot(), self.walks(), **self.sampling.choices())
            if self.judging.fast:
                return _answer(
                    self._explained(policy, name, title) if self.judging.why else self._planned(policy, name)
                )
            verdict = self._simulated(policy, name, title or name)
            if self.judging.why and self.pages is None and verdict.verdict != "feasible":
                from wholebody.verdict.verdict import with_why

                verdict = with_why(verdict, self._explained(policy, name, title))
        except Exception as error:  # noqa: BLE001 - whatever it is, the other inputs are judged all the same
            return self._failed(name, error)
        return _answer(verdict)

    def _explained(self, policy: Policy, name: str, title: str = "") -> Verdict:
        """The fast check, asked why."""
        with waiting(f"{title or name}: looking for what forbids it, and for what would do", self.quiet):
            return self._planned(policy, name, why=True)

    def _planned(self, policy: Policy, name: str, *, why: bool = False) -> Verdict:
        """The fast check."""
        seconds, start, fast = (
            length(policy, self.given.duration),
            self.judging.starts(name),
            self.fast(self._scene(name)),
        )
        with ours():
            return fast.check(policy, name, seconds, start=start, ask_why=why, odds=self._odds)

    def _fast_verdict(self, policy: Policy, name: str) -> Verdict | None:
        """The fast check before a simulation; None where a chunk cannot be planned, which the simulation tells."""
        from wholebody.errors import PlanningError

        try:
            return self._planned(policy, name)
        except CrashError as error:
            if isinstance(error.__cause__, PlanningError):
                return None
            raise

    def _simulated(self, policy: Policy, name: str, title: str) -> Verdict:
        """The simulated check, after the fast one where asking twice is free: of sources that do not see the robot."""
        scene, seconds, begin, first = self._scene(name), length(policy, self.given.duration), None, None
        planned, placed = self._first and not policy.sees_robot, self.judging.starts(name) == "first"
        fast = self.fast(scene) if planned or placed else None
        with waiting(f"planning {title}", self.quiet):
            if planned:
                first = self._fast_verdict(policy, name)
                title += f", {first.verdict.replace('_', ' ')} by its plans" if first else ""
            if placed:
                with ours():
                    begin = fast.first_state(policy)
        checker = self._checker(scene, STEPS_OF.get(name, "never"))
        checker.episode = replace(checker.episode, begin=begin)
        with (
            cameras_of(policy, checker, self.given.images) as cameras,
            progress_bar(title, quiet=self.quiet) as progress,
            ours(),
        ):
            shown = {"cameras": cameras, "progress": progress}
            run = None if self.pages is None else self.pages.run(checker, policy, name, seconds, **shown)
            verdict = run.verdict if run else checker.check(policy, name, seconds, **shown)[0]
        tell(policy, name)
        verdict = _after(verdict, first)
        if run is None:
            return verdict
        with waiting(f"{name}: looking for why, and writing its page", self.quiet), ours():
            return self.pages.write(checker, replace(run, verdict=verdict))

    def in_world(self, name: str, seed: int) -> Answer:
        """Judge an input in the realistic world of a seed."""
        simulation = replace(self.simulation, realistic=True, robot_seed=seed)
        judge = InputJudge(self.given, simulation, self.sampling, replace(self.judging, why=False), quiet=True)
        # Plans know nothing of the world: what they say is said once.
        judge.fast, judge._first = self.fast, False
        return judge.answer(name)

    def _scene(self, name: str) -> str:
        return scene_for(name, self.simulation)

    def _failed(self, name: str, error: Exception) -> Answer:
        """Report the fault of an input; a fault of the options is raised again."""
        from models.spec import RobotSpecError
        from policy.errors import PolicyError
        from wholebody.errors import WholebodyError

        if isinstance(error, OutputError):  # every other input would fail as well
            raise error
        if isinstance(error, PolicyError | OSError):
            return _sentence(name, str(error), MALFORMED)
        if isinstance(error, WholebodyError | RobotSpecError | ValueError):
            raise error
        # The other inputs must not meet the traces of a fault of ours.
        self._checker.cache_clear()
        self.fast.cache_clear()
        return _sentence(name, sentence(error), CRASH)


def _after(verdict: Verdict, planned: Verdict | None) -> Verdict:
    """A simulated verdict with what plans had said before."""
    if planned is None:
        return verdict
    said = {"fast": planned.verdict, "would_do": planned.would_do if verdict.verdict != "feasible" else []}
    said |= {name: getattr(planned, name) for name in ("decided_by", "margins", "odds")}
    return replace(verdict, **said)


def answers(judge: InputJudge, inputs: Iterable[str], jobs: int) -> Iterator[Answer]:
    """Answers in the order of the inputs, each as soon as it and those before it are there.

    Args:
        judge: Judges them, or a copy of it in each process does.
        inputs: As the user named them.
        jobs: How many are judged at a time; more than one, in processes of their own.

    Raises:
        WholebodyError, RobotSpecError, ValueError: If the options are wrong.
    """
    names, judging = list(judge.names(inputs)), judge.judging
    if jobs == 1 and not judging.worlds:
        yield from _one_by_one(judge, names)
        return
    seeds = range(judge.simulation.robot_seed, judge.simulation.robot_seed + judging.worlds)
    jobs = max(jobs, len(processors())) if judging.worlds else jobs
    options = (judge.given, judge.simulation, judge.sampling, judging, judge.pages)
    # Fresh interpreters: threads of libraries do not survive a fork.
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_begin, initargs=options)
    try:
        tasks = [
            [pool.submit(_judge_apart, name, seed) for seed in (None, *seeds)] if isinstance(name, str) else name
            for name in names
        ]
        for k, (name, task) in enumerate(zip(names, tasks, strict=True)):
            title = _title(name, k, len(names))
            yield _together(name, title, task, seeds, judge.quiet) if isinstance(task, list) else task
    finally:
        pool.shutdown(cancel_futures=True)


def _one_by_one(judge: InputJudge, names: Sequence[str | Answer]) -> Iterator[Answer]:
    """Answers computed in this process, with their number shown as progress."""
    count = 0

    def line(seconds: float) -> str:
        return f"judged {count} of {len(names)} ({seconds:.0f} s)"

    # What is simulated has a line of its own, with the number of the input.
    with heartbeat(line, quiet=judge.quiet or not judge.judging.fast or len(names) == 1):
        for count, name in enumerate(names):
            yield judge.answer(name, _title(name, count, len(names))) if isinstance(name, str) else name


def _title(name: str | Answer, k: int, n: int) -> str:
    return f"{name} ({k + 1} of {n})" if n > 1 else str(name)


def _together(name: str, title: str, tasks: Sequence[Future[Answer]], seeds: Sequence[int], quiet: bool) -> Answer:
    """The answer about an input, with what became of it in worlds."""
    from wholebody.verdict.worlds import in_worlds

    answer, *others = (
        _wait(name, task, quiet, f"{title}, world {k} of {len(seeds)}" if k else title) for k, task in enumerate(tasks)
    )
    found = [other.verdict for other in others]
    if answer.verdict is None or not found:
        return answer
    if None in found:
        return _sentence(name, "could not be judged in every world", max(other.code for other in others))
    return replace(_answer(in_worlds(answer.verdict, seeds, found)), stderr=answer.stderr)


def _wait(name: str, future: Future[Answer], quiet: bool, title: str = "") -> Answer:
    try:
        with waiting(f"judging {title or name} and those after it", quiet):
            answer = future.result()
    except BrokenProcessPool:
        return _sentence(name, BROKEN, CRASH)
    sys.stderr.write(answer.stderr)
    if answer.misuse:
        raise ValueError(answer.misuse)
    return answer


def _begin(given: Input, simulation: Simulation, sampling: Sampling, judging: Judging, pages: Pages | None) -> None:
    """Make the judge of this process, for all of its inputs."""
    global _judge  # noqa: PLW0603 - a process has one
    # Ctrl-C reaches every process of a terminal; the first one says what there is to say.
    signal(SIGINT, SIG_DFL)
    end_with_parent()
    _judge = InputJudge(given, simulation, sampling, judging, quiet=True, pages=pages)


def _judge_apart(name: str, seed: int | None = None) -> Answer:
    from models.spec import RobotSpecError
    from wholebody.errors import WholebodyError

    output = StringIO()
    with redirect_stderr(output):
        # Warnings belong to the input that they are about.
        logging.root.handlers.clear()
        log_to_terminal()
        try:
            answer = _judge.answer(name) if seed is None else _judge.in_world(name, seed)
        except (WholebodyError, RobotSpecError, ValueError, OutputError) as error:
            answer = Answer(MALFORMED, misuse=str(error))
    # Of worlds only the first one says what there is to say.
    return replace(answer, stderr="" if seed is not None and answer.verdict is not None else output.getvalue())


def _answer(verdict: Verdict) -> Answer:
    return Answer(INFEASIBLE if verdict.verdict == "infeasible" else FEASIBLE, verdict)


def _sentence(name: str, text: str, code: int) -> Answer:
    complain(text if text.startswith(name) else f"{name}: {text}")
    return Answer(code)
