"""Steps of an input: how far the first is from the stance, fingers past their range, and none after the last."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.base import Policy
from policy.chunk import ActionChunk
from policy.executor.executor import Executor
from policy.geometry.rotations import angle_between
from policy.joints import layout_robot
from wholebody.config import START_MAX
from wholebody.episode.tracking_error import FINGER_TOLERANCE
from wholebody.robot.palms import palm_offsets, palm_points
from wholebody.sim.limit_monitor import LimitExcess
from wholebody.verdict.quantity import quantity
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why.headline import JUDGED_THERE

HANDS = ("left", "right")


def far_from_stance(chunk: ActionChunk, spec: RobotSpec, free: tuple[bool, bool]) -> tuple[str, ...]:
    """A sentence if a hand begins as far from the stance as would be a far start for a robot that stands in it.

    Args:
        chunk: The input's first one, or all of it.
        spec: The robot.
        free: Whether the orientation of the left and of the right palm is free.

    Returns:
        One sentence, or none.
    """
    anchor, offsets = Anchor.nominal(robot=layout_robot(spec)), palm_offsets(spec)
    stance = np.stack([anchor.T_world_base @ anchor.poses[hand] for hand in ("lhand", "rhand")])
    first = np.stack([chunk.T_world_lhand[0], chunk.T_world_rhand[0]])
    here, there = (palm_points(T, offsets) for T in (stance, first))
    away = np.linalg.norm(there - here, axis=1)
    turned = np.where(free, 0.0, angle_between(stance[:, :3, :3], first[:, :3, :3]))
    shares = np.maximum(away / START_MAX[0], turned / START_MAX[1])
    side = int(shares.argmax())
    if shares[side] <= 1.0:
        return ()
    far = f"{quantity(float(away[side]), 'm')} and {np.rad2deg(turned[side]):.0f} deg from the stance"
    text = f"{JUDGED_THERE}, the {HANDS[side]} hand {far}; "
    text += "with --start stance, or a state, the way counts"
    swapped = bool((np.linalg.norm(there - here[::-1], axis=1) < away).all())
    return (f"{text}; are left and right swapped?" if swapped else text,)


def past_range(chunk: ActionChunk, due: np.ndarray, spec: RobotSpec) -> dict[str, LimitExcess]:
    """Fingers that are asked past their range at some steps, by joint: when that is first, and the most [rad].

    Args:
        chunk: Of the input.
        due: The steps, indices (n,).
        spec: The robot.
    """
    times, found = chunk.times[due], {}
    for tool, q in zip(spec.tools, (chunk.q_lhand[due], chunk.q_rhand[due]), strict=True):
        if not tool.finger_joints or not len(due):
            continue
        i = spec.indices(tool.finger_joints)
        inside = np.clip(q, spec.position_min[i], spec.position_max[i])
        excess = np.abs(q - inside)
        for joint in np.flatnonzero(excess.max(axis=0, initial=0.0) > FINGER_TOLERANCE).tolist():
            k, first = int(excess[:, joint].argmax()), int(np.argmax(excess[:, joint] > FINGER_TOLERANCE))
            one = LimitExcess(float(times[first]), 0.0, float(q[k, joint]), float(inside[k, joint]))
            found[tool.finger_joints[joint]] = one
    return found


def shortened(chunk: ActionChunk, time: float) -> ActionChunk:
    """A chunk without its steps after a time since its first one [s]; as it is where fewer than two are left."""
    n = int(np.floor(min(time, len(chunk) / chunk.fps) * chunk.fps + 1e-6)) + 1
    if not 2 <= n < len(chunk):
        return chunk
    return replace(chunk, **{name: value[:n] for name, value in chunk.arrays().items()})


def row_rate(policy: Policy | Executor) -> float:
    """Rows a second of the file that a policy plays, where those are not its steps [Hz]; else 0."""
    source = policy.policy if isinstance(policy, Executor) else policy
    return getattr(source, "row_fps", 0.0)


def last_step(policy: Policy | Executor, duration: float, fps: float) -> int:
    """The last step of what a policy is asked for in a time [s], from 0: of a recording, its own last one."""
    source = policy.policy if isinstance(policy, Executor) else policy
    steps, episode = round(duration * fps), getattr(source, "episode", None)
    return steps if episode is None else min(steps, len(episode) - 1)


def within(verdict: Verdict, last: int, rows: float = 0.0) -> Verdict:
    """A verdict in rows of the input as it was given, of which none comes after the last one.

    The end of an input is held while the robot settles. What happens then keeps its time, and is told at the last row.

    Args:
        verdict: In steps of the chunks.
        last: The last step.
        rows: Rows of the input a second, where those are not the steps [Hz].
    """
    ratio = rows / verdict.fps if rows and verdict.fps else 1.0
    most = round(last * ratio)

    def bounded[T](one: T) -> T:
        return one if one.step is None else replace(one, step=min(round(one.step * ratio), most))

    causes = [replace(one, members=tuple(map(bounded, one.members))) for one in verdict.causes]
    would_do = [bounded(replace(one, bound=one.bound and bounded(one.bound))) for one in verdict.would_do]
    return replace(
        verdict,
        fps=verdict.fps * ratio,
        violations=[bounded(one) for one in verdict.violations],
        margins=[bounded(one) for one in verdict.margins],
        causes=causes,
        would_do=would_do,
        tick=None if verdict.tick is None else bounded(verdict.tick),
    )
