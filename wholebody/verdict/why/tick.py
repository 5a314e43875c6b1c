"""What the tick's program says of a chunk's hands as given: that it has no solution, with a proof, or what limits it.

The robot is ideal: what the program answers is integrated. Its hands follow the chunk as given, its body the motion
that comes nearest to it within all bounds. The first tick at which the program, its bounds hard and the accelerations
that the hand tasks ask for required, has no solution is told with a Farkas vector. That is a proof about this state and
these accelerations alone: another motion may lead elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.control.reference_packet import BodyReference, PalmReference
from wholebody.control.tick_report import TickLevel
from wholebody.planning.trajectory import GRID, SampledTrajectory
from wholebody.qp.infeasibility import FarkasCertificate, LinearRows, infeasibility
from wholebody.qp.problem import QuadraticProgram
from wholebody.qp.solvers import solve
from wholebody.reference import HandMotion
from wholebody.types import RobotState
from wholebody.verdict.causes import Tick
from wholebody.verdict.why.chunk_program import ChunkProgram
from wholebody.verdict.why.motion_search import Witness

EVERY_TICKS = 5
"""Control periods from one look at the hands to the next; chosen: 10 ms."""
SHORT = (0.5, 1.5)
"""Acceleration that a hand lacks from which its tick is looked at [m/s^2, rad/s^2]; chosen: above what soft tasks give
away at rest."""
LOOKS = 12
"""Most ticks of which a proof is tried; chosen: a tenth of a second."""
LIMITS = 5
"""Most rows that are told where the program has a solution."""
AXES = ("x", "y", "z", "about x", "about y", "about z")


class TickProver:
    """Holds the whole-body program.

    Args:
        spec: The robot.
        config: Of its controller, which counts on the loads that it is told.
    """

    def __init__(self, spec: RobotSpec, config: ControllerConfig) -> None:
        self._controller = WholeBodyController(spec, config)
        self._controller.carry((config.loads.left, config.loads.right))

    def of(self, program: ChunkProgram, nearest: Witness, since: float = 0.0) -> Tick | None:
        """The first tick that is proven, else the one at which the hands lack most; None where they lack nothing.

        Args:
            program: Of a chunk that is not done as given.
            nearest: Its nearest motion.
            since: Added to times [s].
        """
        looks, worst = 0, (0.0, None)
        for time, lacking in self._followed(program, nearest):
            if lacking <= 1.0:
                continue
            qp = self._controller.build()
            certificate = infeasibility(hard_rows(self._controller, qp, program.free)) if looks < LOOKS else None
            looks += 1
            if certificate is not None:
                return _proof(certificate, time + since, program.chunk.fps)
            if lacking > worst[0]:
                worst = lacking, self._limits(qp, time + since, program.chunk.fps)
            if looks >= LOOKS:
                break
        return worst[1]

    def _followed(self, program: ChunkProgram, nearest: Witness) -> Iterator[tuple[float, float]]:
        """Times, and what hands lack there in terms of `SHORT`, while they are on the chunk; puts the robot there."""
        c, robot, body = self._controller, self._controller.robot, program.begin.body
        track, hands = program.track(nearest)
        palms = [_palms(hand, offset) for hand, offset in zip(hands, program.judge.planner.offsets, strict=True)]
        q, v, dt = body.q.copy(), body.v.copy(), c.config.dt
        c.reset(RobotState(0.0, q, v))
        far = program.judge.config.verdict.palm_feasible
        for i in range(len(track.q)):
            reference = reference_at(track, palms, i)
            _, report = c.step(RobotState(i * dt, q, v), reference)
            full = report.level is TickLevel.FULL
            if i % EVERY_TICKS == 0 or not full:
                robot.update(q, v)
                if max(np.linalg.norm(palm.error(robot)[:3]) for palm in c.palms) > far:
                    return
                dv = report.solution.dv if full else np.full(robot.nv, np.inf)
                yield float(track.start + GRID * i), self._lacking(dv, program.free)
            if report.solution is None:
                return
            dv = report.solution.dv
            q, v = pin.integrate(robot.model, q, dt * v + 0.5 * dt**2 * dv), v + dt * dv

    def _lacking(self, dv: np.ndarray, free: np.ndarray) -> float:
        if not np.isfinite(dv).all():
            return np.inf
        most = 0.0
        for palm, any_turn in zip(self._controller.palms, free, strict=True):
            one = palm.objective(self._controller.robot)
            short = one.target - one.J @ dv
            turn = 0.0 if any_turn else np.linalg.norm(short[3:]) / SHORT[1]
            most = max(most, np.linalg.norm(short[:3]) / SHORT[0], turn)
        return float(most)

    def _limits(self, qp: QuadraticProgram, time: float, fps: float) -> Tick | None:
        """The multipliers of the program as it is solved, the largest first."""
        answer = solve(qp)
        if not answer.ok:
            return None
        size = np.abs(answer.z) * np.linalg.norm(qp.C, axis=1)
        box = np.abs(answer.z_box[: qp.A.shape[1] - qp.n_slack])
        names, sizes = [*qp.labels, *variable_names(self._controller)], np.concatenate([size, box])
        values = np.concatenate([answer.z, answer.z_box[: len(box)]])
        best = [int(i) for i in np.argsort(-sizes)[:LIMITS] if sizes[i] > 1e-6]
        return Tick(
            proven=False, time=time, step=max(round(time * fps), 0), rows=[names[i] for i in best],
            weights=[float(values[i]) for i in best], A=[], lower=[], upper=[],
        )  # fmt: skip


def hard_rows(controller: WholeBodyController, qp: QuadraticProgram, free: np.ndarray) -> LinearRows:
    """The rows of a program without slack, and the accelerations that the hand tasks ask for as equations.

    Args:
        controller: Its robot is where the program was built.
        qp: The program.
        free: Whether the orientation of the left and of the right palm is free.
    """
    n = len(qp.g) - qp.n_slack
    A, lower, upper, labels = [qp.A[:, :n]], [qp.b], [qp.b], [f"dynamics.{i}" for i in range(6)]
    labels += [f"{foot.frame}.{axis}" for foot in controller.standing for axis in AXES]
    A.append(qp.C[:, :n])
    lower.append(qp.lower)
    upper.append(qp.upper)
    labels += qp.labels
    bounded = np.minimum(np.abs(qp.x_min[:n]), np.abs(qp.x_max[:n])) < FREE
    A.append(np.eye(n)[bounded])
    lower.append(qp.x_min[:n][bounded])
    upper.append(np.where(qp.x_max[:n][bounded] < FREE, qp.x_max[:n][bounded], np.inf))
    labels += [name for name, kept in zip(variable_names(controller), bounded, strict=True) if kept]
    for side, palm, any_turn in zip(("left palm", "right palm"), controller.palms, free, strict=True):
        one, rows = palm.objective(controller.robot), 3 if any_turn else 6
        A.append(np.hstack([one.J[:rows], np.zeros((rows, n - one.J.shape[1]))]))
        lower.append(one.target[:rows])
        upper.append(one.target[:rows])
        labels += [f"{side}.{axis}" for axis in AXES[:rows]]
    return LinearRows(np.vstack(A), np.concatenate(lower), np.concatenate(upper), tuple(labels))


FREE = 1e8
"""Size from which a bound on a variable is none [m/s^2, rad/s^2, N]; derived: a tenth of what stands for infinity."""


def variable_names(controller: WholeBodyController) -> list[str]:
    """Names of the accelerations of base and joints, and of the forces at the corners of the soles."""
    base = [f"base.{axis}" for axis in AXES]
    joints = [f"acceleration.{name}" for name in controller.robot.joint_names]
    forces = [
        f"force.{foot.frame}.{corner}.{axis}" for foot in controller.feet for corner in range(len(foot.points))
        for axis in AXES[:3]
    ]  # fmt: skip
    return base + joints + forces


def reference_at(track: SampledTrajectory, palms: Sequence[Sequence[PalmReference]], row: int) -> BodyReference:
    """What to follow at a row of a trajectory, with palms that go their own way."""
    return BodyReference(
        palms=tuple(palm[row] for palm in palms),
        q=track.q[row], dq=track.v[row, 6:], ddq=track.ddq[row],
        pelvis=tuple(part[row] for part in track.pelvis), torso=tuple(part[row] for part in track.torso),
        height=tuple(track.height[:, row].tolist()), com=tuple(track.com[:, row]),
        momentum=tuple(track.momentum[:, row]),
    )  # fmt: skip


def _palms(hand: HandMotion, offset: np.ndarray) -> list[PalmReference]:
    """A palm at each row of the motion of its wrist."""
    T, spin, alpha = hand.T_world_hand, hand.w, hand.alpha
    arm = T[:, :3, :3] @ offset
    T[:, :3, 3] += arm
    twist = np.hstack([hand.v + np.cross(spin, arm), spin])
    acceleration = np.hstack([hand.a + np.cross(alpha, arm) + np.cross(spin, np.cross(spin, arm)), alpha])
    return [
        PalmReference(T_world=pin.SE3(*row[:2]), twist=row[2], acceleration=row[3])
        for row in zip(T[:, :3, :3], T[:, :3, 3], twist, acceleration, strict=True)
    ]


def _proof(certificate: FarkasCertificate, time: float, fps: float) -> Tick:
    rows = certificate.rows
    return Tick(
        proven=True, time=time, step=max(round(time * fps), 0), rows=list(rows.labels),
        weights=certificate.y.tolist(), A=rows.A.tolist(),
        lower=[x if np.isfinite(x) else None for x in rows.lower.tolist()],
        upper=[x if np.isfinite(x) else None for x in rows.upper.tolist()],
    )  # fmt: skip
