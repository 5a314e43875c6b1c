"""Configuration: frozen dataclasses hold the defaults, YAML files only override them."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import radians

from wholebody.config.loads import LoadConfig
from wholebody.config.planning import PlanningConfig
from wholebody.config.robot import RobotConfig
from wholebody.config.touch import TouchConfig
from wholebody.config.verdict import VerdictConfig

START_MAX = (0.3, radians(60.0))
"""Distance of the hands from a chunk's present step from which it is no continuation of their motion [m, rad]: further
than a hand moves between two chunks, half of its reach. The verdict reports such starts."""


@dataclass(frozen=True, kw_only=True)
class HandConfig:
    """Tracking of the two wrists."""

    kp: float = 900.0
    """Stiffness [1/s^2]."""
    kd: float = 60.0
    """Damping [1/s]."""
    position_weight: float = 1000.0
    """[1/(m/s^2)^2]"""
    orientation_weight: float = 100.0
    """[1/(rad/s^2)^2]"""


@dataclass(frozen=True, kw_only=True)
class BodyConfig:
    """Tracking of the centre of mass, the trunk and the joints."""

    com_kp: float = 50.0
    """[1/s^2]"""
    com_kd: float = 14.0
    """[1/s]"""
    com_weight: tuple[float, float, float] = (1000.0, 1000.0, 1.0)
    """Per world axis [1/(m/s^2)^2]."""
    momentum_kd: float = 5.0
    """[1/s]"""
    momentum_weight: float = 0.1
    """[1/(N m)^2]"""
    torso_weight: float = 10.0
    """[1/(rad/s^2)^2]"""
    pelvis_weight: float = 10.0
    """[1/(rad/s^2)^2]"""
    height_weight: float = 50.0
    """Pelvis height [1/(m/s^2)^2]."""
    trunk_kp: float = 50.0
    """[1/s^2]"""
    trunk_kd: float = 14.0
    """[1/s]"""
    posture_kp: float = 50.0
    """[1/s^2]"""
    posture_kd: float = 14.0
    """[1/s]"""
    posture_weight: float = 2.0
    """Body joints [1/(rad/s^2)^2]."""
    finger_kp: float = 900.0
    """[1/s^2]"""
    finger_kd: float = 60.0
    """[1/s]"""
    finger_weight: float = 1.0
    """[1/(rad/s^2)^2]"""


@dataclass(frozen=True, kw_only=True)
class SafetyConfig:
    """Bounds that stand above the hands."""

    balance_margin: float = 0.02
    """Distance of the capture point from the edge of the support [m]."""
    balance_gain: float = 5.0
    """[1/s]"""
    pelvis_angle: float = 0.2
    """Largest rotation of the pelvis away from the plan, per axis [rad]."""
    torso_angle: float = 0.15
    """Largest rotation of the torso away from the plan, per axis [rad]."""
    joint_brake: float = 50.0
    """Deceleration that a body joint is trusted to find when it nears a position limit [rad/s^2]."""
    knee_min: float = 0.1
    """Least knee angle: with straight legs the pelvis can no longer be moved [rad]."""
    elbow_max: float = 1.5
    """Largest elbow angle: 1.57 is a straight arm [rad]."""
    joint_horizon: float = 0.01
    """Time over which joint bounds are kept viable [s]."""
    error_slow: float = 0.03
    """Palm error at which the chunk is slowed [m]."""
    error_stop: float = 0.08
    """Palm error at which it is held [m]."""
    posture_slow: float = 0.2
    """Distance of a body joint from the trajectory at which the hands give way, and it is planned anew [rad]."""
    posture_stop: float = 0.45
    """Distance at which they have given way and the robot stands [rad]."""
    posture_lost: float = 0.15
    """Distance of a body joint from where it was to stand off the plan up to which a plan from there is taken [rad]."""
    balance_slow: float = 0.02
    """Distance of the capture point from the edge below which the chunk is slowed [m]."""
    trunk_rate: float = 3.0
    """Largest angular rate of pelvis and torso, per axis [rad/s]."""
    trunk_brake: float = 10.0
    """[rad/s^2]"""
    height_band: float = 0.05
    """Largest distance of the pelvis from the planned height [m]."""
    height_lowest: float = 0.28
    """Pelvis height never gone below [m]."""
    height_brake: float = 3.0
    """[m/s^2]"""
    self_distance: float = 0.008
    """Least distance between bodies that are not neighbours; the trajectory keeps a little more [m]."""
    self_trigger: float = 0.05
    """Distance beyond the least one from which a pair of bodies counts [m]."""
    self_brake: float = 10.0
    """[m/s^2]"""
    floor_distance: float = 0.02
    """Least height of hands and forearms over the floor; the trajectory keeps a little more [m]."""
    floor_trigger: float = 0.1
    """Height beyond the least one from which a body counts [m]."""
    floor_brake: float = 10.0
    """[m/s^2]"""
    torque_share: float = 0.95
    """Share of the effort limit that the program may plan with; the rest is for the position loop."""


@dataclass(frozen=True, kw_only=True)
class TrajectoryConfig:
    """Scales, limits and margins of the trajectory optimiser: an error as large as its scale costs 1."""

    dt: float = 1.0 / 15.0
    """Time between two knots [s]."""
    position: float = 2e-3
    """Scale of palm positions [m]."""
    position_give: float = 0.01
    """Error of a palm at which the gradient of its loss is greatest; it falls beyond [m]."""
    orientation: float = 8e-3
    """Scale of palm orientations [rad]."""
    orientation_give: float = 0.01
    """Angle beyond which a palm turns no harder [rad]."""
    com: float = 0.025
    """Centre of mass off the middle of the support [m]."""
    zmp: float = 0.06
    """Zero-moment point off the middle of the support [m]."""
    torso: float = 0.6
    """Torso off upright [rad]."""
    pelvis: float = 0.8
    """Pelvis off upright [rad]."""
    height: float = 0.15
    """Pelvis off the stance's height [m]."""
    posture: float = 1.5
    """Joints off the stance [rad]."""
    waist_torque: float = 60.0
    """Waist torques: their 35 N m are soon used up [N m]."""
    slide: float = 0.07
    """Acceleration of the soles by the legs' velocities alone [m/s^2]."""
    smoothness: float = 20.0
    """Accelerations [m/s^2, rad/s^2]."""
    stillness: float = 8.0
    """Speeds [m/s, rad/s]."""
    leg_stillness: float = 0.6
    """Speeds of the leg joints: fast legs make soles slide a little [rad/s]."""
    joint_margin: float = 0.08
    """Distance kept from joint position limits [rad]."""
    knee_min: float = 0.2
    """Least knee angle: a straight leg cannot move the pelvis up or down any more [rad]."""
    elbow_max: float = 1.45
    """Largest elbow angle; 1.57 is straight, and there the hand can no longer be moved along the arm [rad]."""
    speed_share: float = 0.6
    """Share of the joint speed limits that the plan uses."""
    acceleration: float = 70.0
    """Largest joint acceleration [rad/s^2]."""
    waist_acceleration: float = 25.0
    """Largest acceleration of the waist: half of what its 35 N m give the 0.7 kg m^2 on it, for what happens between
    knots."""
    com_margin: float = 0.045
    """Distance of the centre of mass from the edge of the support: with realistic sensing 30 mm is not enough [m]."""
    zmp_margin: float = 0.028
    """Distance of the zero-moment point from the edge of the support: room for what the plan does not know [m]."""
    capture_margin: float = 0.025
    """Distance of the capture point from the edge of the support: a little more than the controller keeps [m]."""
    capture_time: float = 0.1
    """Time in which the capture point may reach that edge [s]."""
    pelvis_tilt: float = 0.55
    """Largest tilt of the pelvis from vertical [rad]."""
    torso_tilt: float = 0.95
    """Largest tilt of the torso from vertical [rad]."""
    height_min: float = 0.3
    """Least height of the pelvis [m]."""
    load_min: float = 0.4
    """Least share of the weight that stays on the floor: friction and pressure balance the robot with it."""
    friction_share: float = 0.9
    """Share of the friction that the controller counts on that the plan uses."""
    torque_share: float = 0.88
    """Share of the effort limits of waist and arms that the plan uses."""
    self_distance: float = 0.014
    """Least distance between bodies that are not neighbours [m]."""
    self_trigger: float = 0.05
    """Distance beyond the least one at which a pair of bodies begins to count [m]."""
    floor_distance: float = 0.03
    """Least height of hands and forearms over the floor [m]."""
    floor_trigger: float = 0.1
    """Height beyond the least one at which a body begins to count [m]."""
    approach_time: float = 0.033
    """Time for which bodies may approach each other or the floor before they are too near, between two knots [s]."""


@dataclass(frozen=True, kw_only=True)
class PlannerConfig:
    """Settings of the way from a chunk to a feasible plan."""

    posture: TrajectoryConfig = field(default_factory=TrajectoryConfig)
    orientation_relaxed: float = 0.02
    """Scale of palm orientations where palms cannot be at their positions otherwise [rad]."""
    orientation_free: float = 0.05
    """Scale of the palms' orientation where that is not enough [rad]."""
    relax_error: float = 0.008
    """Distance of a planned palm from its target above which these are tried [m]."""
    tracking_error_max: float = 0.03
    """Largest distance of a planned palm from its target up to which a plan counts as following [m]."""
    mean_error_max: float = 0.01
    """Mean distance of the palms from the targets, at their own times, up to which it does whatever the largest [m]."""
    unreachable: float = 0.15
    """Distance of a planned palm from its target past which the target is out of reach, not just hard to follow [m]."""
    violation_max: float = 1.0
    """Largest excess over a bound of a safe plan, in terms of the bound's tolerance."""
    capture_point_drift_max: float = 0.006
    """Drift of the capture point up to which a plan is balanced where, between knots, its zero-moment point would have
    to leave the support: a quarter of the controller's own margin [m]."""
    friction_deficit_max: float = 0.3
    """Impulse per mass that the floor may fail to give for lack of friction up to which a plan is balanced [m/s]."""
    friction_deficit_unreachable: float = 0.15
    """Largest friction deficit where a target is out of reach, for which less is risked [m/s]."""
    warm_start_distance: float = 0.03
    """Distance of the plan before from the palms wanted up to which the search begins with it [m]."""
    warm_start_error: float = 0.0055
    """Tracking error above which a search that began so is repeated without, up to `relax_error` [m]."""
    settle: float = 0.5
    """Time that the plan goes on after the hands have arrived, to come to rest [s]."""
    clamp_tolerance: float = 0.008
    """Distance between a target and what the trajectory reaches that is left to the QP [m]."""
    turn_tolerance: float = 0.05
    """Tolerance of the palms' orientation [rad]."""
    slowdowns: tuple[float, ...] = (1.5, 2.5)
    """Factors tried in turn when a chunk is too fast for its plan."""


@dataclass(frozen=True, kw_only=True)
class ControllerConfig:
    """The whole-body controller."""

    dt: float = 0.002
    """Control period [s]."""
    backend: str = "native"
    """Program that is solved: 'native', 'placo' for a second opinion on the dynamics, or 'kinematic' for none."""
    solver: str = "compiled"
    """'compiled', or the name of a QP solver such as 'daqp' for the same program in readable Python."""
    fallback: str = "quadprog"
    """Second solver, asked when the first one's answer fails the residual check; 'none' to do without."""
    bounds: str = "all"
    """'all', or 'physics' for dynamics, contacts, friction, torque and joint limits alone, to compare with others."""
    hand: HandConfig = field(default_factory=HandConfig)
    body: BodyConfig = field(default_factory=BodyConfig)
    safety: SafetyConfig = field(default_factory=SafetyConfig)
    planner: PlannerConfig = field(default_factory=PlannerConfig)
    verdict: VerdictConfig = field(default_factory=VerdictConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    robot: RobotConfig = field(default_factory=RobotConfig)
    loads: LoadConfig = field(default_factory=LoadConfig)
    touch: TouchConfig = field(default_factory=TouchConfig)
    steps: str = "never"
    """When the robot may step: 'never', both feet stay; 'reach', where it is told to walk."""
    leak: float = 0.3
    """Time constant with which the desired state forgets its difference from the measured one [s]."""
    friction: float = 0.6
    """Friction coefficient that the controller counts on."""
    force_min: float = 5.0
    """Least normal force of one contact point [N]."""
    force_max: float = 500.0
    """Largest normal force of one contact point [N]."""
    foot_kp: float = 0.0
    """Stiffness with which a foot that moved is pulled back [1/s^2]."""
    foot_kd: float = 20.0
    """[1/s]"""
