"""Still, balanced postures of the whole body for two wrist poses, and ways to them, inside all bounds of a plan.

The search for a posture is local: Gauss-Newton steps on the active bounds, from the stance and, where that gets stuck,
from those of many random postures (of a fixed seed) whose palms are nearest. The way there is a curve in the space of
postures, not a straight line of the hands, which often leads where no posture is balanced.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.builtin import builtin
from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from policy.joints import layout_robot
from policy.reading import FPS_MAX, FPS_MIN
from policy.scripted.policy import minimum_jerk
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.errors import InputError
from wholebody.lending import Lending
from wholebody.planning.posture_path import PosturePath, PosturePaths
from wholebody.planning.still_postures import (  # fmt: skip
    EXCESS_NONE,
    ORIENTATION_REACHED,
    POSITION_REACHED,
    PostureLimit,
    RandomPostures,
    Round,
    StillPostures,
    wrist_target,
)
from wholebody.robot.palms import palm_offsets, palm_poses
from wholebody.trajopt.layout import LOWER
from wholebody.trajopt.robot_tables import RobotTables
from wholebody.types import RobotState, check_state

ROOM_NONE = 0.02
"""Room up to which a bound is said to hold a posture back, in terms of its tolerance; chosen, no trial is on record."""
PALM_SCALES = {"position": 1e-3, "position_give": 0.3, "orientation": 4e-3, "orientation_give": 0.5}
"""Scales of the palms and the errors past which they pull no harder [m, rad]; chosen: finer than a plan's."""
GENTLE_SCALES = PALM_SCALES | {"position": 0.01, "orientation": 0.04}
"""Scales of the palms where the targets are missed [m, rad]; chosen: the bounds are not to be bent."""
FIRM_SCALE = 0.01
"""Factor on the scales of the bounds at the end; chosen: nothing wanted buys `EXCESS_NONE` of them."""
FREE_SCALE = 1e3
"""Scale of the palms' orientation where nothing is asked of it [rad]; chosen: it costs nothing then."""
STAGES, STAGE_STEPS = 12, 15
"""Targets between the stance and those that are missed, and most steps to each."""
ROTATION_LEVER = 0.25
"""Length at which an error of orientation counts as much as one of position [m]; chosen: a forearm."""
STARTS_MAX = 12
"""Most postures that the search begins at, the stance included."""
DURATION_MIN, DURATION_MAX = 0.2, 60.0
"""Shortest and longest way [s]; chosen, no trial is on record."""


@dataclass(frozen=True)
class Solution:
    """A still posture with both feet where the stance has them. ``print`` says it in words.

    Attributes:
        reached: Whether both wrists are within 1 mm and 0.2 degrees of their targets and all bounds hold.
        joints: Position of each joint by name, fingers included [rad].
        q: The same with the pelvis, shape (nq,), Pinocchio convention.
        torques: At rest, of waist and arms by name [N m]. Those of the legs depend on how the feet share the load.
        margins: Least room to the bounds of each kind: [rad] of tilt and joints, [m] of pelvis height, distance
            beyond the one to keep and balance, share of the limit for torques; negative where exceeded.
        position_error, orientation_error: Of both wrists, [m] and [rad].
        reasons: What stands between the posture and the targets; empty where they are reached.
    """

    reached: bool
    joints: dict[str, float]
    q: np.ndarray
    torques: dict[str, float]
    margins: dict[PostureLimit, float]
    position_error: tuple[float, float]
    orientation_error: tuple[float, float]
    reasons: tuple[PostureLimit, ...]

    def __str__(self) -> str:
        """A line for the targets, one for each reason, one for the least room to each bound, one for the torques."""
        errors = zip(("left", "right"), self.position_error, self.orientation_error, strict=True)
        off = ", ".join(f"{side} wrist {1e3 * p:.1f} mm and {np.rad2deg(turn):.1f} deg off" for side, p, turn in errors)
        most = sorted(self.torques, key=lambda name: -abs(self.torques[name]))[:3]
        return "\n".join(
            [
                f"{'reached' if self.reached else 'not reached'}: {off}",
                *(f"because {reason.sentence}" for reason in self.reasons),
                "room: " + ", ".join(f"{name} {room:.3f} {name.unit}" for name, room in self.margins.items()),
                "largest torques: " + ", ".join(f"{name} {self.torques[name]:.1f} N m" for name in most),
            ]
        )


class PostureSolver:
    """Postures for wrist poses, and ways to them.

    Args:
        spec: The robot.
        config: Bounds and margins are those of its ``planner.posture``, masses in the hands those of its ``loads``.
    """

    def __init__(self, spec: RobotSpec, config: ControllerConfig | None = None) -> None:
        config = config or ControllerConfig()
        self.spec, self._weights = spec, config.planner.posture
        body = self.body = RobotTables.of(spec, self._weights, config.friction, config.force_min)
        body.carry((config.loads.left, config.loads.right))
        t = body.tables
        edges = np.minimum(np.minimum(t.com_offsets, t.zmp_offsets), t.capture_offsets)
        body.tables = t._replace(com_offsets=edges)
        exact, gentle = (replace(self._weights, **scales) for scales in (PALM_SCALES, GENTLE_SCALES))
        self._reaching = Round(exact, 1.0, 25), Round(exact, FIRM_SCALE, 25)
        self._retreating = Round(gentle, 1.0, 40), Round(gentle, FIRM_SCALE, 60)
        self._stage = (Round(gentle, FIRM_SCALE, STAGE_STEPS),)
        self._one = StillPostures(body, self._weights, 2)
        self._palm_offsets = palm_offsets(spec)

    @cached_property
    def _random(self) -> RandomPostures:
        return RandomPostures(self.body)

    @cached_property
    def _ways(self) -> PosturePaths:
        return PosturePaths(self.body, self._weights)

    def solve(self, T_world_lhand: np.ndarray, T_world_rhand: np.ndarray, *, starts: int = STARTS_MAX) -> Solution:
        """Still, balanced posture for two wrist poses, searched for from at most ``starts`` starts; see `solve`."""
        targets = np.stack([wrist_target(T_world_lhand, "T_world_lhand"), wrist_target(T_world_rhand, "T_world_rhand")])
        T_palms, missed = palm_poses(targets, self._palm_offsets), []
        for _ in self._attempts(T_palms, self._reaching, starts):
            found = self._solution(targets)
            if found.reached:
                return found
            missed.append((self._score(found), self.body.body_of(found.q)))
        return self._nearest(T_palms, targets, min(missed, key=lambda scored: scored[0])[1])

    def missed(
        self, T_palms: np.ndarray, *, orientation_free: bool = False, starts: int = STARTS_MAX, hopeless: float = inf
    ) -> float:
        """How far the palms stay from poses (2, 4, 4) in world, at the best start [m]; 0 where a posture holds them.

        That is what `solve` says of the wrists behind them, without its search for what is nearest. Errors of a turn
        count by `ROTATION_LEVER`, or not at all where it is free; a start that stays further off than
        ``hopeless`` is the last.
        """
        rounds: tuple[Round, ...] = self._reaching
        least = inf
        if orientation_free:
            rounds = tuple(
                replace(x, weights=replace(x.weights, orientation=FREE_SCALE), oriented=False) for x in rounds
            )
        for _ in self._attempts(T_palms, rounds, starts):
            T = self._one.T_palms[1]
            off = float(np.linalg.norm(T[:, :3, 3] - T_palms[:, :3, 3], axis=1).max())
            turn = 0.0 if orientation_free else float(angle_between(T[:, :3, :3], T_palms[:, :3, :3]).max())
            inside = max(self._one.shares(1).values()) <= EXCESS_NONE
            if off <= POSITION_REACHED and turn <= ORIENTATION_REACHED and inside:
                return 0.0
            least = min(least, max(off + ROTATION_LEVER * turn, POSITION_REACHED))
            if least > hopeless:
                break
        return least

    def path_to(
        self,
        posture: Solution,
        start: RobotState | None = None,
        *,
        duration: float = 3.0,
        fps: float = 30.0,
        seq: int = 0,
    ) -> PosturePath:
        """Balanced way to a posture as a chunk; `path_to` has the details."""
        if not isinstance(posture, Solution):
            raise InputError(f"posture is a {type(posture).__name__}; give what `wholebody.solve` returns, a Solution")
        if not (DURATION_MIN <= duration <= DURATION_MAX and FPS_MIN <= fps <= FPS_MAX):
            raise InputError(
                f"a way of {duration} s at {fps} Hz; {DURATION_MIN:g} to {DURATION_MAX:g} s and {FPS_MIN:g} to "
                f"{FPS_MAX:g} Hz are possible"
            )
        time, begin = 0.0, self.body.q_full
        if start is not None:
            time, begin = start.time, check_state(start, self.spec.n_joints).q
        shares = minimum_jerk(np.linspace(0.0, 1.0, round(duration * fps) + 1))
        way = self._ways.between(begin, posture.q, shares)
        wrists = palm_poses(way.T_palms, -self._palm_offsets)
        robot = layout_robot(self.spec)
        q_l, q_r = (np.zeros((len(shares), n)) for n in robot.fingers)
        mine = way.q[:, self.body.fingers]
        for hand, fingers in zip((q_l, q_r), np.split(mine, [self.spec.fingers[0]], axis=1), strict=True):
            hand[:, : fingers.shape[1]] = fingers
        chunk = ActionChunk(builtin("wbc32", robot).id, seq, time, fps, wrists[:, 0], wrists[:, 1], q_l, q_r)
        if not posture.reached:
            lines = str(posture).splitlines()[: 1 + len(posture.reasons)]
            chunk = replace(chunk, notes=(f"goes to the nearest posture found, {'; '.join(lines)}",))
        return PosturePath(way.clear, chunk, way.q, way.margins)

    def _nearest(self, T_palms: np.ndarray, targets: np.ndarray, start: np.ndarray) -> Solution:
        """The best of the postures inside the bounds: from a start, from the stance, and on the way from it."""
        stance, inside = self.body.tables.q_stance, []

        def search(goal: np.ndarray, begin: np.ndarray, rounds: tuple[Round, ...]) -> None:
            self._one.search(goal, begin, self.body.q_full[self.body.fingers], rounds)
            if self._one.excess()[1] <= EXCESS_NONE:
                found = self._solution(targets)
                inside.append((self._score(found), found))

        search(T_palms, stance, ())
        palms = self._one.T_palms[1, :, :3, 3].copy()
        last = stance
        for share in np.linspace(1.0 / STAGES, 1.0, STAGES):
            goal = T_palms.copy()
            goal[:, :3, 3] = palms + share * (T_palms[:, :3, 3] - palms)
            search(goal, last, self._stage)
            last = self.body.body_of(inside[-1][1].q) if inside else stance
        for begin in (start, stance):
            search(T_palms, begin, self._retreating)
        return min(inside, key=lambda scored: scored[0])[1] if inside else self._solution(targets)

    def _attempts(self, T_palms: np.ndarray, rounds: tuple[Round, ...], starts: int) -> Iterator[int]:
        """Search from the stance, then from the nearest random postures; the number of each, once done."""
        for start in range(starts):
            if start == 1:
                near = self._random.nearest(T_palms, starts - 1, ROTATION_LEVER if rounds[0].oriented else 0.0)
            begin = near[start - 1] if start else self.body.tables.q_stance
            self._one.search(T_palms, begin, self.body.q_full[self.body.fingers], rounds)
            yield start

    def _score(self, found: Solution) -> float:
        """How far a posture is from the targets [m], and much more for what exceeds the bounds."""
        excess = max(0.0, float(self._one.excess()[1]) - EXCESS_NONE)
        return 1e3 * excess + sum(found.position_error) + ROTATION_LEVER * sum(found.orientation_error)

    def _solution(self, targets: np.ndarray) -> Solution:
        """What the search has found."""
        body, one = self.body, self._one
        full = body.q_full.copy()
        body.put(full, one.q[1])
        wrists = palm_poses(one.T_palms[1], -self._palm_offsets)
        position = np.linalg.norm(wrists[:, :3, 3] - targets[:, :3, 3], axis=1)
        orientation = angle_between(wrists[:, :3, :3], targets[:, :3, :3])
        on_target = position.max() <= POSITION_REACHED and orientation.max() <= ORIENTATION_REACHED
        margins, excess = one.margins(1), one.shares(1)
        reached = bool(on_target and max(excess.values()) <= EXCESS_NONE)
        reasons = () if reached else tuple(name for name, share in excess.items() if share > -ROOM_NONE)
        names = list(body.full.names)[2:]
        upper, has = list(body.model.names)[2 + LOWER - 6 :], body.real[LOWER - 6 :]
        return Solution(
            reached=reached,
            joints=dict(zip(names, full[7:].tolist(), strict=True)),
            q=full,
            torques={name: tau for name, tau, mine in zip(upper, one.torques(1).tolist(), has, strict=True) if mine},
            margins=margins,
            position_error=tuple(position.tolist()),
            orientation_error=tuple(orientation.tolist()),
            reasons=reasons or (() if reached else (PostureLimit.NOT_FOUND,)),
        )


def solve(T_world_lhand: np.ndarray, T_world_rhand: np.ndarray, config: ControllerConfig | None = None) -> Solution:
    """A balanced posture at rest with both hands at two poses, or the nearest one that is found within the bounds.

    Args:
        T_world_lhand: Pose (4, 4) of ``left_wrist_yaw_link`` in world: midpoint of the soles, x forward, z up [m].
        T_world_rhand: The same of the right one. Fingers are those of the stance.
        config: Of the robot and its bounds.

    Raises:
        InputError: If a pose is not finite or no rigid transform.
    """
    with _solvers.lend(config or ControllerConfig()) as solver:
        return solver.solve(T_world_lhand, T_world_rhand)


def path_to(
    posture: Solution,
    start: RobotState | None = None,
    *,
    duration: float = 3.0,
    fps: float = 30.0,
    seq: int = 0,
    config: ControllerConfig | None = None,
) -> PosturePath:
    """A way to a posture that is balanced at every step, for `Supervisor.accept`.

    Where the posture does not reach its targets, the chunk has a note that says so.

    Args:
        posture: Where to: what `solve` returns.
        start: Where the robot is, at rest, with its feet as in the stance; the stance at time 0 if not given.
        duration: [s]; a plan takes longer where the body cannot be as fast.
        fps: Rate of the chunk [Hz].
        seq: Its number.
        config: Of the robot and its bounds.

    Raises:
        InputError: If the posture is none, the start no state of this robot, or the duration or rate is out of range.
    """
    with _solvers.lend(config or ControllerConfig()) as solver:
        return solver.path_to(posture, start, duration=duration, fps=fps, seq=seq)


_solvers = Lending(lambda config: PostureSolver(describe(config.robot), config))
