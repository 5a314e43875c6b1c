"""Inputs judged in processes of their own, each with one robot: a process that dies or takes too long is replaced."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from signal import SIG_IGN, SIGINT, signal
from time import monotonic

from wholebody.errors import InputError
from wholebody.resources import end_with_parent
from wholebody.verdict.audit.outcome import AuditOutcome, Judging

TRIES = 2
"""How often an input is tried whose process dies."""
LOADING = 300.0
"""Time that loading the robot may take beside the limit of a process's first input [s]; chosen: a cold compile."""


@dataclass
class _Worker:
    """A process and its present input.

    Attributes:
        process, pipe: Of it.
        name: Input that it judges.
        end: When that takes too long [s].
    """

    process: BaseProcess
    pipe: Connection
    name: str
    end: float


def outcomes(
    names: Sequence[str], make: Callable[[], Judging], jobs: int, limit: float, loading: float = LOADING
) -> Iterator[AuditOutcome]:
    """Outcomes as they come, in any order.

    Args:
        names: Inputs.
        make: Makes what judges them, in each process; it can be pickled.
        jobs: Processes side by side.
        limit: Time that an input may take [s].
        loading: Time that a process may take beside that for its first one [s].

    Raises:
        InputError: If options are wrong, which they are for every input.
    """
    waiting, tries, workers = deque(names), dict.fromkeys(names, 0), list[_Worker]()
    try:
        while waiting or workers:
            while waiting and len(workers) < jobs:
                workers.append(_begun(make, waiting.popleft(), limit + loading))
            soonest = min(worker.end for worker in workers)
            ready = wait([worker.pipe for worker in workers], max(soonest - monotonic(), 0.0))
            for worker in [one for one in workers if one.pipe in ready or one.end <= monotonic()]:
                outcome = _heard(worker) if worker.pipe in ready else too_long(worker.name, limit)
                alive = outcome is not None and outcome.ending != "timed_out"
                if outcome is None:
                    tries[worker.name] += 1
                    if tries[worker.name] < TRIES:
                        waiting.append(worker.name)
                    else:
                        outcome = AuditOutcome(
                            name=worker.name, ending="crashed", message=f"its process died {TRIES} times"
                        )
                if outcome is not None:
                    yield outcome
                if alive and waiting:
                    worker.name, worker.end = waiting.popleft(), monotonic() + limit
                    worker.pipe.send(worker.name)
                else:
                    _end(worker)
                    workers.remove(worker)
    finally:
        for worker in workers:
            _end(worker)


def _begun(make: Callable[[], Judging], name: str, time: float) -> _Worker:
    # A fresh interpreter: threads of libraries do not survive a fork.
    context = get_context("spawn")
    mine, its = context.Pipe()
    process = context.Process(target=_work, args=(make, its), daemon=True)
    process.start()
    its.close()
    mine.send(name)
    return _Worker(process, mine, name, monotonic() + time)


def _heard(worker: _Worker) -> AuditOutcome | None:
    """What a process says; None if it died.

    Raises:
        InputError: If it says that options are wrong.
    """
    try:
        message = worker.pipe.recv()
    except (EOFError, ConnectionError):
        return None
    if isinstance(message, str):
        raise InputError(message)
    return message


def too_long(name: str, limit: float) -> AuditOutcome:
    """Answer for an input that takes more than a limit [s]."""
    return AuditOutcome(name=name, ending="timed_out", message=f"not judged within {limit:g} s (--limit)")


def _end(worker: _Worker) -> None:
    worker.process.kill()
    worker.process.join()
    worker.pipe.close()


def _work(make: Callable[[], Judging], pipe: Connection) -> None:
    """Judge inputs in a process of its own until the pipe ends."""
    # Ctrl-C reaches every process of a terminal; the first one says what there is to say.
    signal(SIGINT, SIG_IGN)
    end_with_parent()
    judging = make()
    while True:
        try:
            pipe.send(outcome_or_fault(judging, pipe.recv()))
        except (EOFError, BrokenPipeError):  # nobody asks any more, or listens
            return


def outcome_or_fault(judging: Judging, name: str) -> AuditOutcome | str:
    """Outcome of an input, or the fault of the options, which holds for every input."""
    try:
        return judging(name)
    except (InputError, ValueError) as error:
        return str(error)
