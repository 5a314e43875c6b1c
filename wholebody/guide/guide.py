"""What a batch of chunks lacks to what the robot can do: a cost with its gradient, and the nearest chunks that can be.

Nothing here is learned. Where the robot gets with its palms within its bounds is what the sketch of `judge_many` finds,
so the cost of reach is half the squared distance to that, and its gradient is the way there: where the nearest point of
a set is found, the derivative of the distance does not depend on how that point moves (the envelope theorem). Rates of
the hands are bounded as in plans.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from itertools import pairwise
from threading import Lock
from typing import Any

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import as_spec
from policy.action_spec.spec import ActionSpec
from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix
from policy.joints import layout_robot
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.episode.observation import observation_of
from wholebody.errors import InputError, require_extra
from wholebody.guide.wrists import wrists
from wholebody.planning.judgement.chunk_judge import ChunkJudge
from wholebody.planning.judgement.sketch import CHUNKS_AT_ONCE, Reached, Sketches
from wholebody.planning.limit_projection import DEMAND
from wholebody.trajopt.layout import COM_EDGE, DISTANCE, POSITION, STATIC
from wholebody.types import RobotState, check_state

EVERY = 1.0 / 15.0
"""Time from one row to the next at which the robot is asked for its palms [s]; chosen: the knots of a plan."""
STIFF, QUADRATIC = 5e-3, 100.0
"""Scale of palm positions [m], and errors up to which losses are squares [m, rad]; measured: with 0.01 m palms that can
be reached stay 3 mm off for the posture, with 0.002 m bounds give way for palms, and the gradient is no derivative."""
BY = ("reach", "posture", "joint_range", "torque", "self_distance", "balance")
"""What keeps palms from where they are asked: arms that are too short, or the bounds of `wholebody.trajopt.layout`."""


@dataclass(frozen=True)
class Cost:
    """What chunks lack; B chunks. Tensors of torch have gradients with respect to the actions, but for ``worst``.

    Attributes:
        total: Cost of each chunk, shape (B,); 0 where it lacks nothing.
        parts: The same by kind, shape (B,) each: ``speed`` of the hands, and reach by what keeps the palms from where
            they are asked (`BY`).
        worst: What a chunk lacks most, in terms of what a repair may change, shape (B,); above 1 it is likely to be
            infeasible.
    """

    total: Any
    parts: dict[str, Any]
    worst: np.ndarray


class Guide:
    """Costs and corrections of raw actions (B, H, A) from one state; any number of threads may ask.

    Args:
        layout: What raw actions are: a name (`wholebody layouts` lists them) or a spec, of wrists with rot6d.
        config: Of the robot and its controller.
        state: Where the robot is; in its stance if not given.
        fps: Steps a second [Hz]; the layout's if not given.
        orientation_free: Whether nothing is asked of the left and the right palm's orientation; as the layout says if
            not given.

    Raises:
        InputError: If the layout has no wrists whose numbers have a gradient, or the state is malformed.
    """

    def __init__(
        self,
        layout: ActionSpec | str = "wbc32",
        config: ControllerConfig | None = None,
        *,
        state: RobotState | None = None,
        fps: float | None = None,
        orientation_free: tuple[bool, bool] | None = None,
    ) -> None:
        config = config or ControllerConfig()
        spec, self.spec = describe(config.robot), as_spec(layout)
        judge = ChunkJudge(spec, config)
        bounds = config.verdict
        self._lock, self._unit = Lock(), (bounds.palm_repair, bounds.turn_repair)
        # Squares alone: then where the robot gets is the nearest that it gets to, as repairs measure it.
        self.free = self.spec.orientation_free if orientation_free is None else orientation_free
        turns = QUADRATIC if all(self.free) else STIFF * bounds.turn_repair / bounds.palm_repair
        nearest = replace(
            config.planner.posture,
            position=STIFF,
            position_give=QUADRATIC,
            orientation=turns,
            orientation_give=QUADRATIC,
        )
        self._sketches = Sketches(judge.planner, *self._unit, nearest)
        self.fps = float(self.spec.fps if fps is None else fps)
        limits = judge.planner.hand_limits[0]
        self._rates = [
            np.multiply(DEMAND, astuple(one)) / self.fps ** np.arange(1, 4)
            for one in (limits.position, limits.orientation)
        ]
        if state is None:
            self._begin, anchor = judge.stance(), Anchor.nominal(robot=layout_robot(spec))
        else:
            state = check_state(state, spec.n_joints)
            self._begin = judge.present(state)
            anchor = Anchor.measured(observation_of(spec, judge.robot, state), layout_robot(spec))
        self._wrists = wrists(self.spec, anchor, judge.planner.offsets)

    def __call__(self, actions: Any) -> Cost:
        """Cost of raw actions (B, H, A), a tensor of torch or an array; only tensors have gradients.

        Raises:
            InputError: If the shape is wrong, a number is not finite, or torch is missing.
        """
        require_extra("lerobot", "torch", "a cost with gradients")
        import torch

        tensor = torch.as_tensor(actions)
        numbers = self._checked(tensor.detach().cpu().double().numpy())
        p, R = self._palms(numbers)
        toward, turned, shares = self._corrections(p, R)
        with torch.enable_grad():
            palms = [wrist.palm(tensor) for wrist in self._wrists]
            points, axes = torch.stack([one[0] for one in palms], 2), torch.stack([one[1] for one in palms], 2)
            goal_p, goal_R = (torch.as_tensor(x).to(tensor) for x in (p + toward, rotvec_to_matrix(turned) @ R))
            off = ((points - goal_p) ** 2).sum(-1) / self._unit[0] ** 2
            # |R - R'|^2 = 2 (3 - trace) is twice the angle's square, to fourth order.
            awry = 0.5 * ((axes - goal_R) ** 2).sum((-1, -2)) / self._unit[1] ** 2
            steps = 0.5 * (off + awry * torch.as_tensor([not one for one in self.free]).to(tensor)).sum(-1)
            parts = {name: (steps * torch.as_tensor(shares[..., i]).to(tensor)).mean(-1) for i, name in enumerate(BY)}
            parts["speed"] = self._speed(points, axes)
        return Cost(sum(parts.values()), parts, self._worst(toward, turned))

    def corrected(self, actions: np.ndarray, share: float = 1.0, rounds: int = 1) -> np.ndarray:
        """Raw actions (B, H, A) moved towards the nearest ones that the robot reaches: the Gauss-Newton step of reach.

        Args:
            actions: Finite; what is no number of a wrist stays as it is.
            share: Share of the way, 0 to 1.
            rounds: Steps, each from where the one before led.
        """
        numbers = self._checked(np.asarray(actions, dtype=float))
        for _ in range(rounds):
            p, R = self._palms(numbers)
            toward, turned, _ = self._corrections(p, R)
            p, R = p + share * toward, rotvec_to_matrix(share * turned) @ R
            for hand, wrist in enumerate(self._wrists):
                numbers = wrist.moved(numbers, p[:, :, hand], R[:, :, hand])
        return numbers

    def worst(self, actions: np.ndarray) -> np.ndarray:
        """What each chunk lacks most, shape (B,), as in `Cost`; torch is not needed."""
        return self._worst(*self._corrections(*self._palms(self._checked(np.asarray(actions, dtype=float))))[:2])

    def _checked(self, actions: np.ndarray) -> np.ndarray:
        if actions.ndim != 3 or actions.shape[2] != self.spec.dim or min(actions.shape) < 1 or actions.shape[1] < 2:
            raise InputError(
                f"actions have shape {actions.shape}; (chunks, steps, {self.spec.dim}) is expected, 2 steps or more"
            )
        if not np.isfinite(actions).all():
            raise InputError("actions are not finite; finite numbers are expected")
        return actions

    def _palms(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Palm points (B, H, 2, 3) [m] and rotations (B, H, 2, 3, 3) in world."""
        palms = [wrist.palm(actions) for wrist in self._wrists]
        return np.stack([one[0] for one in palms], 2), np.stack([one[1] for one in palms], 2)

    def _corrections(self, p: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What leads each palm to where the robot gets with it, (B, H, 2, 3) [m] and [rad], and shares (B, H, `BY`)."""
        B, H = p.shape[:2]
        toward, turned, shares = np.zeros((B, H, 2, 3)), np.zeros((B, H, 2, 3)), np.zeros((B, H, len(BY)))
        T = np.zeros((B, H, 2, 4, 4))
        T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, p, 1.0
        for first in range(0, B, CHUNKS_AT_ONCE):
            some = slice(first, first + CHUNKS_AT_ONCE)
            with self._lock:
                found = self._sketches.reached(T[some], self.fps, self._begin, EVERY)
            joined = found.joined[..., None, None]
            away = joined * (found.palms[..., :3, 3] - found.wanted[..., :3, 3])
            turn = found.palms[..., :3, :3] @ np.swapaxes(found.wanted[..., :3, :3], -1, -2)
            turns = joined * matrix_to_rotvec(turn)
            turns[:, :, list(self.free)] = 0.0
            toward[some], turned[some] = (_between(found.steps, x, H) for x in (away, turns))
            shares[some] = _between(found.steps, _shares(found), H, begun=False)
        return toward, turned, shares

    def _speed(self, points: Any, axes: Any) -> Any:
        """Half the squared excess over bounds on speed, acceleration and jerk of palms, mean of the steps, (B,)."""
        import torch

        turns = axes[:, :-1].transpose(-1, -2) @ axes[:, 1:]
        turns = 0.5 * torch.stack([turns[..., i, j] - turns[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))], -1)
        total = points.new_zeros(len(points))
        for steps, bounds in zip((points.diff(dim=1), turns), self._rates, strict=True):
            for order, bound in enumerate(bounds.tolist()):
                excess = torch.relu(steps.diff(n=order, dim=1).abs() / bound - 1.0)
                total = total + 0.5 * (excess**2).sum((1, 2, 3)) / points.shape[1]
        return total

    def _worst(self, toward: np.ndarray, turned: np.ndarray) -> np.ndarray:
        lacks = [
            np.linalg.norm(x, axis=-1).max(axis=(1, 2)) / unit
            for x, unit in zip((toward, turned), self._unit, strict=True)
        ]
        return np.maximum(*lacks)


def _shares(found: Reached) -> np.ndarray:
    """Share of each kind of `BY` in what pushes back, shape (n, r, len(`BY`))."""
    ends = (0, POSITION, STATIC, DISTANCE, COM_EDGE, found.excess.shape[-1])
    pushed = np.maximum(found.excess, 0.0) ** 2
    kinds = np.stack([pushed[..., a:b].sum(-1) for a, b in pairwise(ends)], -1)
    total = kinds.sum(-1, keepdims=True)
    shares = np.divide(kinds, total, out=np.zeros_like(kinds), where=total > 0.0)
    return np.concatenate([1.0 - shares.sum(-1, keepdims=True), shares], -1)


def _between(rows: np.ndarray, values: np.ndarray, H: int, *, begun: bool = True) -> np.ndarray:
    """Values (n, r, ...) of rows at all H steps, linear in between; 0 at the first step, if the robot has ``begun``."""
    if begun:
        rows, values = np.append(0, rows), np.concatenate([np.zeros_like(values[:, :1]), values], axis=1)
    at = np.arange(H)
    after = np.clip(np.searchsorted(rows, at), min(1, len(rows) - 1), len(rows) - 1)
    before = np.maximum(after - 1, 0)
    share = np.clip((at - rows[before]) / np.maximum(rows[after] - rows[before], 1), 0.0, 1.0)
    share = share.reshape(1, H, *[1] * (values.ndim - 2))
    return (1.0 - share) * values[:, before] + share * values[:, after]
