"""What a still G1 holds: the most in each of two hands at a place, or how near to it that a mass is held.

    python benchmarks/statics.py                                  # the five reaches at the plan's margins
    python benchmarks/statics.py --share 0.95 --margin 0.03       # at others
    python benchmarks/statics.py --loads 0 0.5 1 2                # distance from the place at which these are held

A symmetric posture on both feet, found by SLSQP from many starts: palms at their places, turned by at most `--turn`
from the stance, torques of gravity in waist and arms within a share of their limits, the centre of mass that far inside
the soles. Bodies may pass through each other, and the search is local: a bound from above as far as it is found.
"""

from __future__ import annotations

import argparse

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

from models import g1
from models.pinocchio_model import load_pinocchio, payload, stance_q
from wholebody.config import TrajectoryConfig

REACHES = ((0.40, 0.30), (0.45, 0.60), (0.50, 1.00), (0.40, 1.40), (0.25, 1.50))
SIDE = 0.16
"""Distance of each palm from the middle [m]; definition of the reach bars."""
PLAN = TrajectoryConfig()
LEGS = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
ARMS = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")


class Statics:
    """One still, symmetric robot: x = pelvis x, z and pitch, waist pitch, six joints of a leg, seven of an arm."""

    def __init__(self, share: float = PLAN.torque_share, margin: float = PLAN.com_margin, turn: float = np.pi) -> None:
        self.spec, self.margin, self.turn = g1(), margin, turn
        self.model, self.q0 = load_pinocchio(self.spec), stance_q(self.spec, load_pinocchio(self.spec))
        self.data, tool = self.model.createData(), self.spec.tools[0]
        self.joint, self.place = payload(self.model, tool, 1.0)[0], payload(self.model, tool, 1.0)[1].lever
        self.palm, self.foot = (self.model.getFrameId(x) for x in (tool.palm_frame, self.spec.feet[0].frame))
        names = list(self.model.names)
        self.columns = [(names.index("waist_pitch_joint"),) * 2]
        self.columns += [tuple(names.index(f"{s}_{n}_joint") for s in ("left", "right")) for n in (*LEGS, *ARMS)]
        self.sign = np.array([-1.0 if "roll" in names[j] or "yaw" in names[j] else 1.0 for j, _ in self.columns])
        self.left = np.array([self.model.idx_vs[j] for j, _ in self.columns])
        self.held = [0, *range(7, 14)]  # waist pitch and arm
        effort = self.model.effortLimit[self.left[self.held]]
        self.effort = share * effort
        low, high = self.model.lowerPositionLimit[self.left + 1], self.model.upperPositionLimit[self.left + 1]
        self.low, self.high = low + PLAN.joint_margin, high - PLAN.joint_margin
        self.low[4], self.high[10] = PLAN.knee_min, min(self.high[10], PLAN.elbow_max)
        pin.framesForwardKinematics(self.model, self.data, self.q0)
        self.T_foot, self.R_palm = self.data.oMf[self.foot].copy(), self.data.oMf[self.palm].rotation.copy()
        sole = self.T_foot.translation[0] + self.spec.feet[0].points[:, 0]
        self.com_range = sole.min() + margin, sole.max() - margin
        self.torso = self.model.getFrameId(self.spec.torso_body)

    def configuration(self, x: np.ndarray) -> np.ndarray:
        """Of Pinocchio's model (nq,)."""
        q = self.q0.copy()
        q[0], q[2], q[3:7] = x[0], x[1], (0.0, np.sin(x[2] / 2.0), 0.0, np.cos(x[2] / 2.0))
        for value, sign, (left, right) in zip(x[3:], self.sign, self.columns, strict=True):
            q[self.model.idx_qs[right]], q[self.model.idx_qs[left]] = sign * value, value
        return q

    def look(self, x: np.ndarray, load: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The palm (3,) [m], what has to be 0: the foot off its place (6,); what must not be below 0."""
        model, data, q = self.model, self.data, self.configuration(x)
        tau = pin.computeGeneralizedGravity(model, data, q)[self.left[self.held]]
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        com, mass = pin.centerOfMass(model, data, q), data.mass[0]
        ball, J = data.oMi[self.joint].act(self.place), pin.getJointJacobian(model, data, self.joint, pin.WORLD)
        lift = (J[2] + J[3] * ball[1] - J[4] * ball[0])[self.left[self.held]] * 9.81 * load
        tau = tau + lift * np.where(np.arange(len(lift)) == 0, 2.0, 1.0)  # the waist holds both
        x_com = (mass * com[0] + 2.0 * load * ball[0]) / (mass + 2.0 * load)
        foot = pin.log6(self.T_foot.actInv(data.oMf[self.foot])).vector
        palm = data.oMf[self.palm]
        turn = np.arccos(np.clip(0.5 * (np.trace(palm.rotation @ self.R_palm.T) - 1.0), -1.0, 1.0))
        tilt = np.arccos(np.clip(data.oMf[self.torso].rotation[2, 2], -1.0, 1.0))
        room = [x_com - self.com_range[0], self.com_range[1] - x_com, self.turn - turn, PLAN.torso_tilt - tilt,
                PLAN.pelvis_tilt - abs(x[2]), x[1] - PLAN.height_min]  # fmt: skip
        return palm.translation.copy(), foot, np.concatenate([room, 1.0 - np.abs(tau) / self.effort])

    def best(self, target: np.ndarray, load: float | None = None, starts: int = 12) -> float:
        """The largest load at a place of the left palm [kg], or how near a load comes to it [m]; nan if none is."""
        generator, found = np.random.default_rng(0), []
        start = np.concatenate([self.q0[[0, 2]], [0.0], self.q0[self.left + 1], [0.0]])
        bounds = [
            (-0.4, 0.3),
            (PLAN.height_min, 0.85),
            (-0.6, 0.6),
            *zip(self.low, self.high, strict=True),
            (0.0, 20.0),
        ]
        low, high = np.array(bounds).T

        def mass(y: np.ndarray) -> float:
            return y[-1] if load is None else load

        def equal(y: np.ndarray) -> np.ndarray:
            palm, foot, _ = self.look(y[:-1], mass(y))
            return foot if load is not None else np.concatenate([foot, palm - target])

        def cost(y: np.ndarray) -> float:
            return -y[-1] if load is None else 1e2 * float(np.sum((self.look(y[:-1], load)[0] - target) ** 2))

        constraints = [
            {"type": "eq", "fun": equal},
            {"type": "ineq", "fun": lambda y: self.look(y[:-1], mass(y))[2]},
        ]
        for k in range(starts):
            spread = 0.0 if k == 0 else 0.25
            y = np.clip(start + spread * (high - low) * generator.standard_normal(len(start)), low, high)
            y[:2], y[-1] = start[:2], 0.0
            answer = minimize(cost, y, method="SLSQP", bounds=bounds, constraints=constraints, options={"maxiter": 300})
            _, _, room = self.look(answer.x[:-1], mass(answer.x))
            if np.abs(equal(answer.x)).max() < 1e-4 and room.min() > -1e-4:
                off = np.linalg.norm(self.look(answer.x[:-1], mass(answer.x))[0] - target)
                found.append(answer.x[-1] if load is None else -off)
        return abs(max(found)) if found else np.nan


def main() -> None:
    """Print a row for each reach."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--share", type=float, default=PLAN.torque_share, help="of the torque limits")
    parser.add_argument("--margin", type=float, default=PLAN.com_margin, help="of the centre of mass [m]")
    parser.add_argument("--turn", type=float, default=180.0, help="most that a palm is turned from the stance [deg]")
    parser.add_argument("--loads", type=float, nargs="*", default=[], help="in each hand [kg]")
    options = parser.parse_args()
    statics = Statics(options.share, options.margin, np.deg2rad(options.turn))
    print("palms x, z [m]   most in each hand [kg]   " + "   ".join(f"{m:g} kg off [mm]" for m in options.loads))
    for x, z in REACHES:
        target = np.array([x, SIDE, z])
        off = "   ".join(f"{1e3 * statics.best(target, m):12.0f}" for m in options.loads)
        print(f"{x:.2f} {z:.2f}   {statics.best(target):22.2f}   {off}", flush=True)


if __name__ == "__main__":
    main()
