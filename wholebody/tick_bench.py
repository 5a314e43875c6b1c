"""How long one tick of the controller takes, on the reach script, and how well it does meanwhile."""

from __future__ import annotations

import gc
from math import sqrt
from time import perf_counter_ns, thread_time_ns

import numpy as np
import pinocchio as pin

from models.g1 import g1
from wholebody.config import BodyConfig, ControllerConfig, HandConfig, SafetyConfig
from wholebody.controller import WholeBodyController
from wholebody.reach_script import ReachScript
from wholebody.types import RobotState

WARM_UP = 500
"""Ticks before the clock counts."""

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
"""

ROWS = {"parity": PARITY, "default": ControllerConfig()}
"""Configurations by name."""


def bench_tick(row: str, ticks: int, *, hands: bool = True) -> dict:
    """Run the script and time every tick: set the target, update, assemble, solve, check residuals, integrate.

    Args:
        row: Name of a configuration in `ROWS`.
        ticks: Number of timed ticks; the script is repeated from the end state of its first 3000 where it is longer.
        hands: Whether the robot has its Dex3 hands.

    Returns:
        Times [us], wrist errors [mm, deg], least distance of the centre of mass from the edge of the support [mm],
        largest position overshoot [rad], number of ticks without an acceptable first answer.
    """
    config = ROWS[row]
    controller, script = WholeBodyController(g1(hands=hands), config), ReachScript(g1(hands=hands), 3600, config.dt)
    judge = _Judge(script)
    wall, cpu = np.zeros((2, ticks), dtype=np.int64)
    done = fails = 0
    gc.collect()
    gc.disable()
    try:
        while done < ticks:
            count, failed = _once(controller, script, judge, wall[done:], cpu[done:])
            done, fails = done + count, fails + failed
    finally:
        gc.enable()
    return {
        "peer": "wholebody",
        "variant": row,
        "hands": int(hands),
        "ticks": ticks,
        "tick_us": _summary(wall),
        "cpu_us": _summary(cpu),
        "fails": fails,
        **judge.summary(),
    }


def _once(
    controller: WholeBodyController, script: ReachScript, judge: _Judge, wall: np.ndarray, cpu: np.ndarray
) -> tuple[int, int]:
    """The script once, at most 3000 timed ticks; how many were timed, and how many of them failed."""
    model, dt, fails = controller.robot.model, script.dt, 0
    q, v = script.q0.copy(), np.zeros(model.nv)
    controller.reset(RobotState(0.0, q, v))
    count = min(len(wall), 3000)
    for k in range(WARM_UP + count):
        c0, t0 = thread_time_ns(), perf_counter_ns()
        _, report = controller.step(RobotState(k * dt, q, v), script.packed(k))
        dv = report.solution.dv
        middle = v + 0.5 * dt * dv
        v = v + dt * dv
        q = pin.integrate(model, q, dt * middle)
        t1, c1 = perf_counter_ns(), thread_time_ns()
        if k >= WARM_UP:
            wall[k - WARM_UP], cpu[k - WARM_UP] = t1 - t0, c1 - c0
            fails += report.level > 0 or report.qp.solver != controller.config.solver
            judge.add(q, k + 1)
    return count, fails


class _Judge:
    """Errors after each tick, outside the clock."""

    def __init__(self, script: ReachScript) -> None:
        self.script, self.model = script, script.robot.model
        self.data = self.model.createData()
        self._wrists = [script.robot.frame_id(tool.wrist_frame) for tool in script.spec.tools]
        self.errors: list[float] = []
        self.turns: list[float] = []
        self.margins: list[float] = []
        self.over = 0.0

    def add(self, q: np.ndarray, k: int) -> None:
        """Compare with the targets of tick ``k``."""
        pin.framesForwardKinematics(self.model, self.data, q)
        for p, R, frame in zip(*self.script.wrists, self._wrists, strict=True):
            T = self.data.oMf[frame]
            self.errors.append(float(np.linalg.norm(T.translation - p[k])))
            self.turns.append(float(np.linalg.norm(pin.log3(T.rotation.T @ R[k]))))
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
        }


def _summary(nanoseconds: np.ndarray) -> dict[str, float]:
    a = 1e-3 * nanoseconds
    p50, p99 = np.percentile(a, [50, 99])
    return {"p50": round(p50, 1), "p99": round(p99, 1), "max": round(float(a.max()), 1), "mean": round(a.mean(), 1)}
