"""What closing numbers and fingers may be instead: a share where an angle is meant, -1 to 1 where 0 to 1 is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from policy.action_spec.slot import DEX1_OPEN
from policy.action_spec.slot_values import NOT_FOLLOWED
from policy.action_spec.spec import ActionSpec
from policy.findings import Finding

SHARE_MAX, GRIPPER_MOVE_MIN = 1.1, 0.3
"""Largest number of a gripper that is given as a share of its range, and least movement that tells; chosen."""
OUTSIDE, STEPS_SHARE = 0.5, 0.1
"""How far past 0 to 1, and in which share of the steps, closing numbers are of another range; chosen: past
overshoot."""
FINGER_SPEED = 25.0
"""Speed that no finger has [rad/s]; definition: Dex3 motors turn at 12 rad/s without load (URDF), and twice that."""


def closing_findings(spec: ActionSpec, actions: np.ndarray, fps: float) -> list[Finding]:
    """Hypotheses about grippers and fingers of raw actions (H, A) at a rate [Hz]."""
    found: list[Finding] = []
    for side in ("left", "right"):
        grasp, hand = spec.slot(f"{side}_grasp"), spec.slot(f"{side}_hand")
        if grasp is not None and grasp.mode == "absolute":
            numbers = actions[:, grasp.start]
            found += (
                _share(grasp.name, numbers) if grasp.unit == "dex1 rad" else _range(grasp.name, grasp.to_si(numbers))
            )
        if hand is not None and hand.mode == "absolute" and hand.kind == "joint":
            found += _jump(hand.name, hand.to_si(actions[:, hand.indices]), fps)
    return found


def _share(name: str, numbers: np.ndarray) -> Iterator[Finding]:
    if numbers.min() >= -0.1 and numbers.max() <= SHARE_MAX and np.ptp(numbers) >= GRIPPER_MOVE_MIN:
        yield Finding(
            "gripper_share", "warning",
            f"{name} is {numbers.min():.2g} to {numbers.max():.2g}, {np.ptp(numbers) / DEX1_OPEN:.0%} of its range "
            f"of 0 to {DEX1_OPEN} rad: 0 to 1 looks like a share",
            'name a layout with the unit "closing" and what it is open and closed: `wholebody layouts --from` '
            "writes it",
        )  # fmt: skip


def _range(name: str, closing: np.ndarray) -> Iterator[Finding]:
    excess = np.maximum(-closing, closing - 1.0)
    if np.mean(excess > OUTSIDE) >= STEPS_SHARE:
        yield Finding(
            "closing_range", "error",
            f"{name} is {closing.min():.3g} to {closing.max():.3g} where 0 is open and 1 closed, out of it in "
            f"{np.mean(excess > OUTSIDE):.0%} of the rows",
            'name a layout with the unit "closing" and what it is open and closed, such as [-1, 1]: `wholebody '
            "layouts --from` writes it",
        )  # fmt: skip


def _jump(name: str, q: np.ndarray, fps: float) -> Iterator[Finding]:
    if len(q) < 3:
        return
    steps = np.diff(q, axis=0)
    # There and back at once: a row of another recording, and no command that a hand could follow.
    spikes = np.minimum(np.abs(steps[:-1]), np.abs(steps[1:])) * (np.sign(steps[:-1]) != np.sign(steps[1:]))
    k, joint = (int(i) for i in np.unravel_index(spikes.argmax(), spikes.shape))
    if spikes[k, joint] * fps > FINGER_SPEED:
        yield Finding(
            "finger_jump", "warning",
            f"{name}: fingers jump by {spikes[k, joint]:.2g} rad at row {k + 1} and back, which at "
            f"{spikes[k, joint] * fps:.0f} rad/s {NOT_FOLLOWED}",
            "look at that row: it is not of this motion",
        )  # fmt: skip
