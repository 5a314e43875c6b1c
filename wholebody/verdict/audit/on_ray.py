"""Inputs judged on a Ray cluster, by actors with a robot each: one that dies or takes too long is started anew."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import monotonic

from wholebody.errors import InputError, require_extra
from wholebody.verdict.audit.outcome import AuditOutcome, Judging
from wholebody.verdict.audit.workers import LOADING, TRIES, outcome_or_fault, too_long

LOCAL = "local"
"""Address of a cluster that is begun here and ends with the audit."""


class _Actor:
    """Worker on a node of the cluster: judges what comes, in the folder of the audit."""

    def __init__(self, make: Callable[[], Judging], folder: str) -> None:
        os.chdir(folder)
        self._judging = make()

    def judge(self, name: str) -> AuditOutcome | str:
        """An outcome, or what is wrong with the options."""
        return outcome_or_fault(self._judging, name)


def outcomes(
    names: Sequence[str],
    make: Callable[[], Judging],
    jobs: int,
    limit: float,
    address: str,
    loading: float = LOADING,
) -> Iterator[AuditOutcome]:
    """Outcomes as they come, in any order.

    Args:
        names: Inputs; nodes find them in the same folder.
        make: Makes what judges them.
        jobs: Actors; 0: one a processor of the cluster.
        limit: Time that an input may take, on an actor that has its robot [s].
        address: Of the cluster; `LOCAL` begins one here.
        loading: Time that an actor may take beside that for its first one [s].

    Raises:
        InputError: If the extra is not installed, the cluster does not answer, or options are wrong.
    """
    require_extra("ray", "ray", "--ray")
    # Nothing about an audit leaves the cluster.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    import ray

    try:
        ray.init(
            None if address == LOCAL else address,
            log_to_driver=False,
            runtime_env={"env_vars": {"OMP_NUM_THREADS": "1"}},
            **({"num_cpus": jobs or None, "include_dashboard": False} if address == LOCAL else {}),
        )
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise InputError(f"no Ray cluster answers at '{address}': {error}; '{LOCAL}' begins one here") from error
    try:
        yield from _judged(names, make, jobs or int(ray.cluster_resources().get("CPU", 1)), limit, loading)
    finally:
        ray.shutdown()


def _judged(
    names: Sequence[str], make: Callable[[], Judging], count: int, limit: float, loading: float
) -> Iterator[AuditOutcome]:
    import ray

    remote = ray.remote(num_cpus=1, max_restarts=-1, max_task_retries=TRIES - 1)(_Actor)
    waiting, fresh, busy = deque(names), set(), {}

    def begun() -> object:
        actor = remote.remote(make, str(Path.cwd()))
        fresh.add(actor)
        return actor

    idle = [begun() for _ in range(min(count, len(names)))]
    while waiting or busy:
        while waiting and idle:
            actor, name = idle.pop(), waiting.popleft()
            end = monotonic() + limit + (loading if actor in fresh else 0.0)
            fresh.discard(actor)
            busy[actor.judge.remote(name)] = (actor, name, end)
        soonest = min(end for _, _, end in busy.values())
        ready, _ = ray.wait(list(busy), timeout=max(soonest - monotonic(), 0.0))
        overdue = [one for one, (_, _, end) in busy.items() if one not in ready and end <= monotonic()]
        for one in (*ready, *overdue):
            actor, name, _ = busy.pop(one)
            idle.append(actor)
            if one in overdue:
                # A new one: the same would try the input again.
                ray.kill(actor)
                idle[-1] = begun()
                yield too_long(name, limit)
                continue
            try:
                outcome = ray.get(one)
            except ray.exceptions.RayActorError:
                fresh.add(actor)
                outcome = AuditOutcome(name=name, ending="crashed", message=f"its process died {TRIES} times")
            if isinstance(outcome, str):
                raise InputError(outcome)
            yield outcome
