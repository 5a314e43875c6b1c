"""Inputs judged one after the other, or side by side in processes of their own; answers in the inputs' order."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import redirect_stderr
from dataclasses import dataclass, replace
from functools import cache
from io import StringIO
from multiprocessing import get_context
from signal import SIG_DFL, SIGINT, signal
from typing import TYPE_CHECKING

from wholebody.cli.console import complain, log_to_terminal, progress_bar, waiting
from wholebody.cli.crash import CRASH, ours, sentence
from wholebody.cli.simulated import SCENE_OF, cameras_of, make_checker, make_fast_checker
from wholebody.cli.sources import expanded, length, opened

if TYPE_CHECKING:
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
        said: What a process of its own said there.
        misuse: What is wrong with the options, which holds for every input.
    """

    code: int
    verdict: Verdict | None = None
    said: str = ""
    misuse: str = ""


class Judge:
    """Judges inputs with the same options; a robot in a scene is loaded once.

    Args:
        given: How much of each input is read.
        simulation: Where the robot is simulated.
        sampling: How checkpoints are run.
        judging: Whether anything is simulated.
        quiet: Without a progress bar.
        pages: Where the report of each input is written; without them if None.
    """

    def __init__(
        self, given: Input, simulation: Simulation, sampling: Sampling, judging: Judging, *, quiet: bool = False,
        pages: Pages | None = None,
    ) -> None:  # fmt: skip
        self.given, self.simulation, self.sampling, self.judging = given, simulation, sampling, judging
        self.quiet, self.pages = quiet, pages
        self._checker = cache(lambda scene: make_checker(simulation, scene, quiet))
        self.fast = cache(lambda: make_fast_checker(simulation, quiet))

    def names(self, inputs: Iterable[str]) -> Iterator[str | Answer]:
        """What is to be judged, an episode each of a dataset, or the answer about what cannot be read."""
        for name in inputs:
            try:
                yield from expanded(name, self.given.episodes)
            except Exception as error:  # noqa: BLE001 - whatever it is, the other inputs are judged all the same
                yield self._failed(name, error)

    def answer(self, name: str) -> Answer:
        """Judge an input.

        Raises:
            WholebodyError, RobotSpecError, ValueError: If the options are wrong, which they are for every input.
        """
        try:
            policy = opened(name, self.given, **self.sampling.choices())
            if self.judging.fast:
                seconds, start, checker = length(policy, self.given.duration), self.judging.starts(name), self.fast()
                with ours():
                    return _answer(checker.check(policy, name, seconds, start=start, ask_why=self.judging.why))
            checker = self._checker(self.simulation.scene or SCENE_OF.get(name, "floor"))
            seconds = length(policy, self.given.duration)
            with (
                cameras_of(policy, checker, self.given.images) as cameras,
                progress_bar(name, quiet=self.quiet) as progress,
                ours(),
            ):
                if self.pages is not None:
                    return _answer(self.pages.check(checker, policy, name, seconds, cameras, progress))
                verdict, _ = checker.check(policy, name, seconds, cameras=cameras, progress=progress)
                if self.judging.why and verdict.verdict != "feasible":
                    verdict = replace(
                        verdict, causes=self.fast().check(policy, name, seconds, start="stance", ask_why=True).causes
                    )
        except Exception as error:  # noqa: BLE001 - whatever it is, the other inputs are judged all the same
            return self._failed(name, error)
        return _answer(verdict)

    def _failed(self, name: str, error: Exception) -> Answer:
        """Say what is wrong with an input; what is wrong with the options is raised again."""
        from models.spec import RobotSpecError
        from policy.errors import PolicyError
        from wholebody.errors import WholebodyError

        if isinstance(error, PolicyError | OSError):
            return _told(name, str(error), MALFORMED)
        if isinstance(error, WholebodyError | RobotSpecError | ValueError):
            raise error
        # The other inputs must not meet the traces of a fault of ours.
        self._checker.cache_clear()
        self.fast.cache_clear()
        return _told(name, sentence(error), CRASH)


def answers(judge: Judge, inputs: Iterable[str], jobs: int) -> Iterator[Answer]:
    """Answers in the order of the inputs, each as soon as it and those before it are there.

    Args:
        judge: Judges them, or a copy of it in each process does.
        inputs: As the user named them.
        jobs: How many are judged at a time; more than one, in processes of their own.

    Raises:
        WholebodyError, RobotSpecError, ValueError: If the options are wrong.
    """
    names = judge.names(inputs)
    if jobs == 1:
        yield from (judge.answer(name) if isinstance(name, str) else name for name in names)
        return
    options = (judge.given, judge.simulation, judge.sampling, judge.judging, judge.pages)
    # Fresh interpreters: threads of libraries do not survive a fork.
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_begin, initargs=options)
    try:
        waiting = [(name, pool.submit(_judge_apart, name) if isinstance(name, str) else name) for name in names]
        for name, answer in waiting:
            yield _come(name, answer, judge.quiet) if isinstance(answer, Future) else answer
    finally:
        pool.shutdown(cancel_futures=True)


def _come(name: str, future: Future[Answer], quiet: bool) -> Answer:
    try:
        with waiting(f"judging {name} and those after it", quiet):
            answer = future.result()
    except BrokenProcessPool:
        return _told(name, BROKEN, CRASH)
    sys.stderr.write(answer.said)
    if answer.misuse:
        raise ValueError(answer.misuse)
    return answer


def _begin(given: Input, simulation: Simulation, sampling: Sampling, judging: Judging, pages: Pages | None) -> None:
    """In a process of its own: the judge of all its inputs."""
    global _judge  # noqa: PLW0603 - a process has one
    # Ctrl-C reaches every process of a terminal; the first one says what there is to say.
    signal(SIGINT, SIG_DFL)
    _judge = Judge(given, simulation, sampling, judging, quiet=True, pages=pages)


def _judge_apart(name: str) -> Answer:
    from models.spec import RobotSpecError
    from wholebody.errors import WholebodyError

    said = StringIO()
    with redirect_stderr(said):
        # Warnings belong to the input that they are about.
        logging.root.handlers.clear()
        log_to_terminal()
        try:
            answer = _judge.answer(name)
        except (WholebodyError, RobotSpecError, ValueError) as error:
            answer = Answer(MALFORMED, misuse=str(error))
    return replace(answer, said=said.getvalue())


def _answer(verdict: Verdict) -> Answer:
    return Answer(INFEASIBLE if verdict.verdict == "infeasible" else FEASIBLE, verdict)


def _told(name: str, text: str, code: int) -> Answer:
    complain(text if text.startswith(name) else f"{name}: {text}")
    return Answer(code)
