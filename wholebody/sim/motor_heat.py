"""How much a run heats the motors: by the mean square of their torques, as the current's losses go."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio
from models.spec import RobotSpec
from wholebody.robot.plant import Plant

LISTED = 3
"""Motors that are told: the ankle that is heated most, and the others that are [no unit]; chosen: a line."""
HARDLY = 0.02
"""Share of its largest torque below which a motor that stands is hardly heated, and nothing is a multiple of that;
chosen."""


@dataclass(frozen=True)
class MotorHeat:
    """How much a motor is heated.

    Attributes:
        joint: Its joint.
        torque_rms_nm: Root mean square of its torque over the run [N m]; its square times the time is the I²t of it.
        share: That, of the largest torque that it has.
        of_stance: Mean square, of that of a robot that stands in its stance; None where that is hardly any.
    """

    joint: str
    torque_rms_nm: float
    share: float
    of_stance: float | None


class HeatMeter:
    """Adds up what the motors give.

    Args:
        plant: Looked at after each control period.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant, self._count = plant, 0
        self._squares = np.zeros(plant.spec.n_joints)

    def look(self) -> None:
        """Take in the control period that has ended."""
        self._squares += np.square(self._plant.torque)
        self._count += 1

    def hottest(self) -> list[MotorHeat]:
        """The ankle that is heated most, then the other motors that are, fingers left out; none before any period."""
        if not self._count:
            return []
        spec, mean = self._plant.spec, self._squares / self._count
        share = np.where(spec.is_finger, 0.0, np.sqrt(mean) / spec.effort_max)
        order, ankles = np.argsort(-share), _ankles(spec)
        first = [i for i in order if i in ankles][:1]
        chosen = [*first, *(i for i in order if i not in first)][:LISTED]
        still = np.square(stance_torques(spec))
        known = np.sqrt(still) > HARDLY * spec.effort_max
        return [
            MotorHeat(
                spec.joint_names[i], float(np.sqrt(mean[i])), float(share[i]),
                float(mean[i] / still[i]) if known[i] else None,
            )
            for i in chosen
        ]  # fmt: skip


def _ankles(spec: RobotSpec) -> set[int]:
    """Joints of the legs below their knees, in motor order."""
    knees = spec.parts("knee")
    legs = (spec.limbs["left_leg"].tolist(), spec.limbs["right_leg"].tolist())
    return {i for leg in legs for k, i in enumerate(leg) if any(knees[j] for j in leg[:k])}


@lru_cache(maxsize=8)
def stance_torques(spec: RobotSpec) -> np.ndarray:
    """Torques with which a robot stands in its stance, shape (n_joints,), motor order, [N m].

    The floor carries it under its centre of mass, each sole as much as that is nearer to it, without force across.
    """
    model = load_pinocchio(spec)
    data, order = model.createData(), spec.indices(list(model.names)[2:])  # motor order to that of the model
    q = np.concatenate([spec.stance.base_position, spec.stance.base_quat_xyzw, spec.stance.joints[order]])
    tau = pin.computeGeneralizedGravity(model, data, q).copy()
    com = pin.centerOfMass(model, data, q)
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    frames = [model.getFrameId(foot.frame) for foot in spec.feet]
    soles = [data.oMf[i].act(np.mean(foot.contact_points, axis=0)) for i, foot in zip(frames, spec.feet, strict=True)]
    weight = pin.computeTotalMass(model) * np.linalg.norm(model.gravity.linear)
    across = soles[1][:2] - soles[0][:2]
    right = float(np.clip((com[:2] - soles[0][:2]) @ across / (across @ across), 0.0, 1.0))
    shares, middle = (1.0 - right, right), (1.0 - right) * soles[0] + right * soles[1]
    for i, sole, share in zip(frames, soles, shares, strict=True):
        point = sole + np.array([*(com[:2] - middle[:2]), 0.0])
        J = pin.getFrameJacobian(model, data, i, pin.LOCAL_WORLD_ALIGNED)
        force = np.array([0.0, 0.0, share * weight])
        tau -= J.T @ np.concatenate([force, np.cross(point - data.oMf[i].translation, force)])
    return tau[6:][np.argsort(order)]
