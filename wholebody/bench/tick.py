"""How long one tick of the controller takes, on the reach script, and how well it does meanwhile."""

from __future__ import annotations

import gc
from dataclasses import dataclass, replace
from math import sqrt
from time import perf_counter_ns, thread_time_ns

import numpy as np
import pinocchio as pin

from models import g1
from models.spec import RobotSpec
from wholebody.backends.kinematic.controller import KinematicController
from wholebody.backends.registry import make_controller
from wholebody.bench.reach_script import ReachScript
from wholebody.bench.slow_ticks import SLOW, SlowTicks, quantiles
from wholebody.config import BodyConfig, ControllerConfig, HandConfig, SafetyConfig
from wholebody.control.base import Controller
from wholebody.control.tick_report import TickLevel
from wholebody.errors import InputError
from wholebody.types import RobotState

WARM_UP = 500
"""Ticks before the clock counts."""
TIMED = 3000
"""Ticks of the script that are timed before it is repeated."""

PARITY = ControllerConfig(
    bounds="physics",
    hand=HandConfig(kp=400.0, kd=40.0, position_weight=10.0, orientation_weight=10.0),
    body=BodyConfig(
        com_kp=50.0,
        com_kd=2.0 * sqrt(50.0),
        com_weight=(10.0, 10.0, 10.0),
        momentum_weight=0.0,
        torso_weight=0.1,
        pelvis_weight=0.0,
        height_weight=0.0,
        trunk_kp=50.0,
        trunk_kd=2.0 * sqrt(50.0),
        posture_kp=20.0,
        posture_kd=2.0 * sqrt(20.0),
        posture_weight=1e-3,
        finger_kp=400.0,
        finger_kd=40.0,
        finger_weight=1e-3,
    ),
    safety=SafetyConfig(torque_share=1.0),
    foot_kp=100.0,
    force_min=1.25,
    force_max=250.0,
)
"""Tasks, weights and rows of tsid's benchmark: four-point cones, normal forces, torque, position, speed, acceleration.

Its normal force is bounded for each foot, 5 to 1000 N; here each of four points has a quarter of that: stricter.
Source:
    The benchmark of tsid in `docs/performance.md`; units as in `ControllerConfig` [SI].
"""

KINEMATIC = replace(
    PARITY,
    backend="kinematic",
    hand=replace(PARITY.hand, position_weight=1e4, orientation_weight=400.0),
    body=replace(
        PARITY.body, com_weight=(400.0, 400.0, 400.0), torso_weight=4.0, posture_weight=0.25, finger_weight=0.25
    ),
)
"""Hard feet, centre of mass over the soles, joint positions and speeds; weights [SI].

Source:
    The benchmark of placo-kin in `docs/performance.md`.
"""

CONFIGURATIONS = {"parity": PARITY, "default": ControllerConfig(), "kinematic": KINEMATIC}
"""Configurations by name."""


@dataclass(frozen=True, kw_only=True)
class Variant:
    """How the script is made harder, so that limits bind.

    Attributes:
        torque, speed: Shares of the joints' torque and speed limits; fingers keep theirs.
        friction: Coefficient of the floor.
        shift: As in `ReachScript`.
    """

    torque: float = 1.0
    speed: float = 1.0
    friction: float = 0.6
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)


VARIANTS = {
    "none": Variant(),
    "torque": Variant(torque=0.5),
    "speed": Variant(speed=0.06),
    "friction": Variant(friction=0.02),
    "near": Variant(shift=(-0.10, -0.12, 0.0)),
}
"""Variants by name, shares and shifts [m] chosen so that the limits bind: what binds in each is counted in the
result."""


def bench_tick(row: str, ticks: int, *, hands: bool = True, variant: str = "none") -> dict:
    """Run the script and time every tick: set the target, update, assemble, solve, check residuals, integrate.

    Args:
        row: Name of a configuration in `CONFIGURATIONS`.
        variant: Name of one in `VARIANTS`.
        ticks: Number of timed ticks; the script is repeated from the end state of its first 3000 where it is longer.
        hands: Whether the robot has its Dex3 hands.

    Returns:
        Times [us], wrist errors [mm, deg], least distance of the centre of mass from the edge of the support [mm],
        largest position overshoot [rad], number of ticks of more than 1 ms of thread CPU time, the worst tick that
        comes back in every repetition [us], number of ticks without an acceptable first answer, how many rows bind, on
        average and at most, and what `SlowTicks` saw.
    """
    hard = VARIANTS[variant]
    config = replace(CONFIGURATIONS[row], friction=hard.friction)
    spec = _tightened(g1(hands=hands), hard)
    controller, script = make_controller(spec, config), ReachScript(spec, 3600, config.dt, hard.shift)
    judge, watch = _Judge(script, controller), SlowTicks()
    wall, cpu = np.zeros((2, ticks), dtype=np.int64)
    done = fails = 0
    gc.collect()
    gc.disable()
    try:
        while done < ticks:
            count, failed = _once(controller, script, (judge, watch), wall[done:], cpu[done:])
            done, fails = done + count, fails + failed
    finally:
        gc.enable()
    return {
        "peer": "wholebody",
        "variant": row if variant == "none" else f"{row}, {variant}",
        "hands": int(hands),
        "ticks": ticks,
        "tick_us": _summary(wall),
        "cpu_us": _summary(cpu),
        "cpu_over_1ms": int((cpu > SLOW).sum()),
        "worst_repeated_us": _worst_repeated(cpu),
        "fails": fails,
        **watch.summary(),
        **judge.summary(),
    }


def _tightened(spec: RobotSpec, hard: Variant) -> RobotSpec:
    joints = tuple(
        joint
        if "_hand_" in joint.name
        else replace(joint, effort_max=hard.torque * joint.effort_max, velocity_max=hard.speed * joint.velocity_max)
        for joint in spec.joints
    )
    return replace(spec, joints=joints)


def _once(
    controller: Controller,
    script: ReachScript,
    observers: tuple[_Judge, SlowTicks],
    wall: np.ndarray,
    cpu: np.ndarray,
) -> tuple[int, int]:
    """The script once, at most `TIMED` ticks; how many were timed, and how many of them failed."""
    judge, watch = observers
    model, dt, fails = controller.robot.model, script.dt, 0
    kinematic = isinstance(controller, KinematicController)
    q, v = script.q0.copy(), np.zeros(model.nv)
    controller.reset(RobotState(0.0, q, v))
    count = min(len(wall), TIMED)
    for k in range(WARM_UP + count):
        watch.begin()
        c0, t0 = thread_time_ns(), perf_counter_ns()
        _, report = controller.step(RobotState(k * dt, q, v), script.packed(k))
        if report.level is TickLevel.FAILED:
            raise InputError(f"no program of tick {k} has a solution: the limits of the variant are too tight")
        if kinematic:
            q, v = controller.q, controller.v
        else:
            dv = report.solution.dv
            middle = v + 0.5 * dt * dv
            v = v + dt * dv
            q = pin.integrate(model, q, dt * middle)
        t1, c1 = perf_counter_ns(), thread_time_ns()
        if k >= WARM_UP:
            wall[k - WARM_UP], cpu[k - WARM_UP] = t1 - t0, c1 - c0
            fails += report.level is not TickLevel.FULL or report.qp.solver != controller.config.solver
            judge.add(q, k + 1)
            watch.end(k, c1 - c0)
    return count, fails


class _Judge:
    """Errors after each tick, outside the clock."""

    def __init__(self, script: ReachScript, controller: Controller) -> None:
        self.script, self.model, self.compiled = script, script.robot.model, controller.compiled
        self.data = self.model.createData()
        self._wrists = [script.robot.frame_id(tool.wrist_frame) for tool in script.spec.tools]
        self.errors: list[float] = []
        self.turns: list[float] = []
        self.margins: list[float] = []
        self.active: list[int] = []
        self.over = 0.0

    def add(self, q: np.ndarray, k: int) -> None:
        """Compare with the targets of tick ``k``."""
        pin.framesForwardKinematics(self.model, self.data, q)
        for p, R, frame in zip(*self.script.wrists, self._wrists, strict=True):
            T = self.data.oMf[frame]
            self.errors.append(float(np.linalg.norm(T.translation - p[k])))
            self.turns.append(float(np.linalg.norm(pin.log3(T.rotation.T @ R[k]))))
        self.active.append(self.compiled.active)
        com = pin.centerOfMass(self.model, self.data, q)
        self.margins.append(self.script.support.margin(com[:2]))
        low, high = self.model.lowerPositionLimit[7:], self.model.upperPositionLimit[7:]
        self.over = max(self.over, float(np.max(low - q[7:])), float(np.max(q[7:] - high)))

    def summary(self) -> dict[str, float]:
        """Medians and extremes."""
        return {
            "ee_med_mm": round(1e3 * float(np.median(self.errors)), 3),
            "ee_max_mm": round(1e3 * max(self.errors), 3),
            "rot_med_deg": round(float(np.rad2deg(np.median(self.turns))), 3),
            "rot_max_deg": round(float(np.rad2deg(max(self.turns))), 3),
            "com_margin_min_mm": round(1e3 * min(self.margins), 3),
            "max_q_over": round(max(self.over, 0.0), 9),
            "active_mean": round(float(np.mean(self.active)), 2),
            "active_max": max(self.active),
        }


def _worst_repeated(cpu: np.ndarray) -> float | None:
    """Largest over the ticks of the script of the median over its repetitions [us]; None with less than three.

    What the tick itself costs comes back in every repetition; what the machine does in between (an interrupt, a host
    that takes the processor away, which counts as thread time in its guests) does not.
    """
    whole = len(cpu) // TIMED
    if whole < 3:
        return None
    return round(1e-3 * float(np.median(cpu[: whole * TIMED].reshape(whole, TIMED), axis=0).max()), 1)


def _summary(nanoseconds: np.ndarray) -> dict[str, float]:
    return quantiles(nanoseconds) | {"mean": round(1e-3 * nanoseconds.mean(), 1)}
