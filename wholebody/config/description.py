"""The robot that a configuration describes: model, motor gains, and a stance that balances."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from functools import lru_cache

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, stance_q
from models.robots import ROBOTS
from models.spec import RobotSpec, Stance
from models.unitree_g1 import GAINS, LOCKED, g1, mirrored_stance, without
from wholebody.config.robot import GainsConfig, RobotConfig, StanceConfig
from wholebody.errors import ConfigError

HANDS = {"g1_dex3": True, "g1": False}
"""Whether a G1 has Dex3-1 hands, by name; its other settings are only about these."""
_LEFT_LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
_STEPS, _STEP, _TOLERANCE = 30, 1e-6, 1e-8
"""Newton steps at most, step of the differences [rad, m], and residual of a stance that stands [rad, m]."""


@lru_cache(maxsize=8)
def describe(config: RobotConfig) -> RobotSpec:
    """The robot of a configuration: what plant, controller, planner and recorder are made for.

    Raises:
        ConfigError: If there is no such model, or nothing that stands is so.
    """
    if config.model not in ROBOTS:
        raise ConfigError(f"robot.model is '{config.model}'; there are: {', '.join(ROBOTS)}", setting="robot.model")
    if config.model not in HANDS:
        if config != RobotConfig(model=config.model):
            raise ConfigError(
                f"robot.model is '{config.model}', whose description says its joints, gains and stance; the other "
                "settings of robot are those of a G1",
                setting="robot.model",
            )
        return ROBOTS[config.model]()
    if config.body not in LOCKED:
        raise ConfigError(f"robot.body is '{config.body}'; there are: {', '.join(LOCKED)}", setting="robot.body")
    hands, locked = HANDS[config.model], LOCKED[config.body]
    spec = g1(hands, linkage_effort=config.linkage_effort, locked=locked)
    chosen = config.gains if config.torque >= 1.0 else config.position_gains
    if chosen != GainsConfig():
        gains = zip(GAINS, (getattr(chosen, field.name) for field in fields(chosen)), strict=True)
        there = {p: vars(gain) for p, gain in gains if any(re.fullmatch(p, name) for name in spec.joint_names)}
        spec = spec.with_joints(there)
    if config.stance != StanceConfig() or locked:
        spec = replace(spec, stance=_standing(spec, config.stance, hands=hands))
    return spec


def _standing(spec: RobotSpec, wanted: StanceConfig, *, hands: bool) -> Stance:
    """The stance with these knees, feet and arms whose soles are flat and whose centre of mass is over their middle."""
    model = load_pinocchio(spec)
    data, foot = model.createData(), spec.foot("left")
    frame = model.getFrameId(foot.frame)

    def stance(x: np.ndarray) -> Stance:
        hip_pitch, hip_roll, hip_yaw, ankle_pitch, ankle_roll, forward, up = x.tolist()
        leg = (hip_pitch, hip_roll, hip_yaw, wanted.knee, ankle_pitch, ankle_roll)
        return without(mirrored_stance((forward, 0.0, up), leg, wanted.arm, hands=hands), spec.locked, hands=hands)

    def residual(x: np.ndarray) -> np.ndarray:
        """Turn of the left sole (3,), its middle off its place (3,) and the centre of mass ahead of it."""
        pin.framesForwardKinematics(model, data, q := stance_q(replace(spec, stance=stance(x)), model))
        sole = data.oMf[frame]
        ahead = pin.centerOfMass(model, data, q)[0]
        return np.hstack(
            [pin.log3(sole.rotation), sole.act(foot.sole_center) - [0.0, 0.5 * wanted.feet_apart, 0.0], ahead]
        )

    leg, base = spec.stance.joints[spec.indices([f"left_{name}_joint" for name in _LEFT_LEG])], spec.stance.base
    x = np.array([-0.5 * wanted.knee, leg[1], leg[2], -0.5 * wanted.knee, leg[5], base[0], base[2]])
    for _ in range(_STEPS):
        r = residual(x)
        if not np.isfinite(r).all() or np.linalg.norm(r) < _TOLERANCE:
            break
        J = np.stack([(residual(x + _STEP * e) - r) / _STEP for e in np.eye(len(x))], axis=1)
        x = x - np.linalg.lstsq(J, r, rcond=None)[0]
    if not np.linalg.norm(residual(x)) < _TOLERANCE:
        raise ConfigError(
            f"robot.stance: no legs with knees at {wanted.knee:g} rad and feet {wanted.feet_apart:g} m apart stand "
            "with flat soles; the default is 0.4 rad and 0.238 m",
            setting="robot.stance",
        )
    _require_within(spec, found := stance(x))
    return found


def _require_within(spec: RobotSpec, stance: Stance) -> None:
    """Every joint of a stance is within its range, or it is a `ConfigError`."""
    for joint, angle in zip(spec.joints, stance.joint_positions, strict=True):
        if not joint.position_min <= angle <= joint.position_max:
            raise ConfigError(
                f"robot.stance has {joint.name} at {angle:.3f} rad; its range is {joint.position_min:.3f} to "
                f"{joint.position_max:.3f} rad",
                setting="robot.stance",
            )
