"""Steps that a verdict names: those of the input, and no others."""

from __future__ import annotations

from dataclasses import replace

from policy.base import Policy
from policy.executor.executor import Executor
from policy.recorded.replay import ReplayPolicy
from wholebody.verdict.verdict import Verdict


def last_step(policy: Policy | Executor, duration: float, fps: float) -> int:
    """The last step of what a policy is asked for in a time [s], from 0: of a recording, its own last one."""
    source = policy.policy if isinstance(policy, Executor) else policy
    steps = round(duration * fps)
    return min(steps, len(source.episode) - 1) if isinstance(source, ReplayPolicy) else steps


def within(verdict: Verdict, last: int) -> Verdict:
    """A verdict that names no step after the last one.

    The end of an input is held while the robot settles. What happens then keeps its time, and is told at the last step.
    """

    def bounded[T](one: T) -> T:
        return one if one.step is None or one.step <= last else replace(one, step=last)

    causes = [replace(one, members=tuple(map(bounded, one.members))) for one in verdict.causes]
    would_do = [one if one.bound is None else replace(one, bound=bounded(one.bound)) for one in verdict.would_do]
    return replace(
        verdict,
        violations=[bounded(one) for one in verdict.violations],
        margins=[bounded(one) for one in verdict.margins],
        causes=causes,
        would_do=would_do,
        tick=None if verdict.tick is None else bounded(verdict.tick),
    )
