"""Which G1 it is, how it stands and how stiff its motors are; part of `wholebody.config.ControllerConfig`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from models.unitree_g1 import ARM, GAINS, STANCE_DEX3

_HIP, _KNEE, _ANKLE, _WAIST, _SHOULDER, _ELBOW, _WRIST, _FINGERS = GAINS
_ARM = dict(zip(ARM, STANCE_DEX3["arm"], strict=True))


@dataclass(frozen=True, kw_only=True)
class GainConfig:
    """Gains of the position loop of a motor."""

    kp: Annotated[float, "N m/rad"]
    """Stiffness."""
    kd: Annotated[float, "N m s/rad"]
    """Damping."""


_OF = {pattern: GainConfig(kp=kp, kd=kd) for pattern, (kp, kd) in GAINS.items()}


@dataclass(frozen=True, kw_only=True)
class GainsConfig:
    """Gains of all motors, both sides alike."""

    hip: GainConfig = _OF[_HIP]
    knee: GainConfig = _OF[_KNEE]
    ankle: GainConfig = _OF[_ANKLE]
    waist: GainConfig = _OF[_WAIST]
    shoulder: GainConfig = _OF[_SHOULDER]
    """Pitch and roll."""
    elbow: GainConfig = _OF[_ELBOW]
    """Gains of the elbow, and of the shoulder's yaw."""
    wrist: GainConfig = _OF[_WRIST]
    fingers: GainConfig = _OF[_FINGERS]


LED_BY_POSITION = GainsConfig(
    hip=GainConfig(kp=200.0, kd=5.0), knee=GainConfig(kp=250.0, kd=5.0), ankle=GainConfig(kp=200.0, kd=2.0)
)
"""Gains for motors that get less than the whole torque [N m/rad, N m s/rad]; chosen: legs of 150 to 250 N m/rad, hips
and knees damped at a ratio of 0.7 in the stance, an ankle at that of its foot in the air."""


@dataclass(frozen=True, kw_only=True)
class StanceConfig:
    """How the robot stands, both sides alike: angles of the left one.

    Hips and ankles follow: soles flat, pelvis upright, the centre of mass over the middle of the soles.
    """

    knee: Annotated[float, "rad"] = STANCE_DEX3["leg"][3]
    """Angle of the knees."""
    feet_apart: Annotated[float, "m"] = 0.238
    """Distance between the middles of the soles."""
    shoulder_pitch: Annotated[float, "rad"] = _ARM["shoulder_pitch"]
    """Angle of the shoulder pitch joints."""
    shoulder_roll: Annotated[float, "rad"] = _ARM["shoulder_roll"]
    """Angle of the shoulder roll joints, of the left."""
    shoulder_yaw: Annotated[float, "rad"] = _ARM["shoulder_yaw"]
    """Angle of the shoulder yaw joints, of the left."""
    elbow: Annotated[float, "rad"] = _ARM["elbow"]
    """Zero is a forearm at right angles."""
    wrist_roll: Annotated[float, "rad"] = _ARM["wrist_roll"]
    """Angle of the wrist roll joints, of the left."""
    wrist_pitch: Annotated[float, "rad"] = _ARM["wrist_pitch"]
    """Angle of the wrist pitch joints."""
    wrist_yaw: Annotated[float, "rad"] = _ARM["wrist_yaw"]
    """Angle of the wrist yaw joints, of the left."""

    @property
    def arm(self) -> tuple[float, ...]:
        """Joints of the left arm, shape (7,), [rad]."""
        return tuple(getattr(self, name) for name in ARM)


@dataclass(frozen=True, kw_only=True)
class RobotConfig:
    """The robot that is controlled and simulated."""

    model: str = "g1_dex3"
    """'g1_dex3' with two Dex3-1 hands, 43 joints, or 'g1' with rubber hands, 29 joints; or a name of `models.robots`,
    whose description says all that the other settings here say of a G1."""
    body: str = "29dof"
    """Joints that this G1 has: '29dof', '27dof' (no waist roll and pitch), 'locked_waist' (no waist), or '23dof' (no
    waist roll and pitch, no wrist pitch and yaw). The others are fixed at zero."""
    linkage_effort: Annotated[float, "N m"] = 35.0
    """Torque limit of ankles and waist roll and pitch: 35 in the URDF, 50 in Unitree's MJCF."""
    gains: GainsConfig = GainsConfig()
    torque: float = 1.0
    """Share of the feed-forward torques that motors are sent; the rest is added to their positions, over `kp`. Below 1
    the gains are `position_gains`."""
    position_gains: GainsConfig = LED_BY_POSITION
    """Gains for a `torque` below 1."""
    stance: StanceConfig = StanceConfig()
    """Posture in which the robot begins, and which plans prefer. The default of 'g1' has its arms a little
    otherwise."""
