"""Configuration: frozen dataclasses hold the defaults, YAML files only override them."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import radians
from typing import Annotated

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

    kp: Annotated[float, "1/s^2"] = 900.0
    """Stiffness."""
    kd: Annotated[float, "1/s"] = 60.0
    """Damping."""
    position_weight: Annotated[float, "1/(m/s^2)^2"] = 1000.0
    """Weight of palm positions."""
    orientation_weight: Annotated[float, "1/(rad/s^2)^2"] = 100.0
    """Weight of palm orientations."""


@dataclass(frozen=True, kw_only=True)
class BodyConfig:
    """Tracking of the centre of mass, the trunk and the joints."""

    com_kp: Annotated[float, "1/s^2"] = 50.0
    """Stiffness of the centre of mass."""
    com_kd: Annotated[float, "1/s"] = 14.0
    """Damping of the centre of mass."""
    com_weight: Annotated[tuple[float, float, float], "1/(m/s^2)^2"] = (1000.0, 1000.0, 1.0)
    """Per world axis."""
    momentum_kd: Annotated[float, "1/s"] = 5.0
    """Damping of the angular momentum."""
    momentum_weight: Annotated[float, "1/(N m)^2"] = 0.1
    """Weight of the angular momentum."""
    torso_weight: Annotated[float, "1/(rad/s^2)^2"] = 10.0
    """Weight of the orientation of the torso."""
    pelvis_weight: Annotated[float, "1/(rad/s^2)^2"] = 10.0
    """Weight of the orientation of the pelvis."""
    height_weight: Annotated[float, "1/(m/s^2)^2"] = 50.0
    """Pelvis height."""
    trunk_kp: Annotated[float, "1/s^2"] = 50.0
    """Stiffness of pelvis and torso."""
    trunk_kd: Annotated[float, "1/s"] = 14.0
    """Damping of pelvis and torso."""
    posture_kp: Annotated[float, "1/s^2"] = 50.0
    """Stiffness of the posture."""
    posture_kd: Annotated[float, "1/s"] = 14.0
    """Damping of the posture."""
    posture_weight: Annotated[float, "1/(rad/s^2)^2"] = 2.0
    """Body joints."""
    finger_kp: Annotated[float, "1/s^2"] = 900.0
    """Stiffness of fingers."""
    finger_kd: Annotated[float, "1/s"] = 60.0
    """Damping of fingers."""
    finger_weight: Annotated[float, "1/(rad/s^2)^2"] = 1.0
    """Weight of fingers."""


@dataclass(frozen=True, kw_only=True)
class SafetyConfig:
    """Bounds that stand above the hands."""

    balance_margin: Annotated[float, "m"] = 0.02
    """Distance of the capture point from the edge of the support."""
    balance_gain: Annotated[float, "1/s"] = 5.0
    """Rate at which the capture point may approach that distance, per metre left."""
    pelvis_angle: Annotated[float, "rad"] = 0.2
    """Largest rotation of the pelvis away from the plan, per axis."""
    torso_angle: Annotated[float, "rad"] = 0.15
    """Largest rotation of the torso away from the plan, per axis."""
    joint_brake: Annotated[float, "rad/s^2"] = 50.0
    """Deceleration that a body joint is trusted to find when it nears a position limit."""
    knee_min: Annotated[float, "rad"] = 0.1
    """Least knee angle: with straight legs the pelvis can no longer be moved."""
    elbow_max: Annotated[float, "rad"] = 1.5
    """Largest elbow angle: 1.57 is a straight arm."""
    joint_horizon: Annotated[float, "s"] = 0.01
    """Time over which joint bounds are kept viable."""
    error_slow: Annotated[float, "m"] = 0.03
    """Palm error at which the chunk is slowed."""
    error_stop: Annotated[float, "m"] = 0.08
    """Palm error at which it is held."""
    posture_slow: Annotated[float, "rad"] = 0.2
    """Distance of a body joint from the trajectory at which the hands give way, and it is planned anew."""
    posture_stop: Annotated[float, "rad"] = 0.45
    """Distance at which they have given way and the robot stands."""
    posture_lost: Annotated[float, "rad"] = 0.15
    """Distance of a body joint from where it was to stand off the plan up to which a plan from there is taken."""
    balance_slow: Annotated[float, "m"] = 0.02
    """Distance of the capture point from the edge below which the chunk is slowed."""
    trunk_rate: Annotated[float, "rad/s"] = 3.0
    """Largest angular rate of pelvis and torso, per axis."""
    trunk_brake: Annotated[float, "rad/s^2"] = 10.0
    """Deceleration that pelvis and torso are trusted to find."""
    height_band: Annotated[float, "m"] = 0.05
    """Largest distance of the pelvis from the planned height."""
    height_lowest: Annotated[float, "m"] = 0.28
    """Pelvis height never gone below."""
    height_brake: Annotated[float, "m/s^2"] = 3.0
    """Deceleration that the height is trusted to find."""
    self_distance: Annotated[float, "m"] = 0.008
    """Least distance between bodies that are not neighbours; the trajectory keeps a little more."""
    self_trigger: Annotated[float, "m"] = 0.05
    """Distance beyond the least one from which a pair of bodies counts."""
    self_brake: Annotated[float, "m/s^2"] = 10.0
    """Deceleration that two bodies are trusted to find."""
    floor_distance: Annotated[float, "m"] = 0.02
    """Least height of hands and forearms over the floor; the trajectory keeps a little more."""
    floor_trigger: Annotated[float, "m"] = 0.1
    """Height beyond the least one from which a body counts."""
    floor_brake: Annotated[float, "m/s^2"] = 10.0
    """Deceleration that a hand or forearm is trusted to find."""
    torque_share: float = 0.95
    """Share of the effort limit that the program may plan with; the rest is for the position loop."""


@dataclass(frozen=True, kw_only=True)
class TrajectoryConfig:
    """Scales, limits and margins of the trajectory optimiser: an error as large as its scale costs 1."""

    dt: Annotated[float, "s"] = 1.0 / 15.0
    """Time between two knots."""
    position: Annotated[float, "m", "scale"] = 2e-3
    """Scale of palm positions."""
    position_give: Annotated[float, "m"] = 0.01
    """Error of a palm at which the gradient of its loss is greatest; it falls beyond."""
    orientation: Annotated[float, "rad", "scale"] = 8e-3
    """Scale of palm orientations."""
    orientation_give: Annotated[float, "rad"] = 0.01
    """Angle beyond which a palm turns no harder."""
    com: Annotated[float, "m", "scale"] = 0.025
    """Centre of mass off the middle of the support."""
    zmp: Annotated[float, "m", "scale"] = 0.06
    """Zero-moment point off the middle of the support."""
    torso: Annotated[float, "rad", "scale"] = 0.6
    """Torso off upright."""
    pelvis: Annotated[float, "rad", "scale"] = 0.8
    """Pelvis off upright."""
    height: Annotated[float, "m", "scale"] = 0.15
    """Pelvis off the stance's height."""
    posture: Annotated[float, "rad", "scale"] = 1.5
    """Joints off the stance."""
    waist_torque: Annotated[float, "N m", "scale"] = 60.0
    """Waist torques: their 35 N m are soon used up."""
    slide: Annotated[float, "m/s^2", "scale"] = 0.07
    """Acceleration of the soles by the legs' velocities alone."""
    smoothness: Annotated[float, "m/s^2, rad/s^2", "scale"] = 20.0
    """Accelerations."""
    stillness: Annotated[float, "m/s, rad/s", "scale"] = 8.0
    """Speeds."""
    leg_stillness: Annotated[float, "rad/s", "scale"] = 0.6
    """Speeds of the leg joints: fast legs make soles slide a little."""
    joint_margin: Annotated[float, "rad"] = 0.08
    """Distance kept from joint position limits."""
    knee_min: Annotated[float, "rad"] = 0.2
    """Least knee angle: a straight leg cannot move the pelvis up or down any more."""
    elbow_max: Annotated[float, "rad"] = 1.45
    """Largest elbow angle; 1.57 is straight, and there the hand can no longer be moved along the arm."""
    speed_share: float = 0.6
    """Share of the joint speed limits that the plan uses."""
    acceleration: Annotated[float, "rad/s^2"] = 70.0
    """Largest joint acceleration."""
    waist_acceleration: float = 25.0
    """Largest acceleration of the waist: half of what its 35 N m give the 0.7 kg m^2 on it, for what happens between
    knots."""
    com_margin: Annotated[float, "m"] = 0.045
    """Distance of the centre of mass from the edge of the support: with realistic sensing 30 mm is not enough."""
    zmp_margin: Annotated[float, "m"] = 0.028
    """Distance of the zero-moment point from the edge of the support: room for what the plan does not know."""
    capture_margin: Annotated[float, "m"] = 0.025
    """Distance of the capture point from the edge of the support: a little more than the controller keeps."""
    capture_time: Annotated[float, "s"] = 0.1
    """Time in which the capture point may reach that edge."""
    pelvis_tilt: Annotated[float, "rad"] = 0.55
    """Largest tilt of the pelvis from vertical."""
    torso_tilt: Annotated[float, "rad"] = 0.95
    """Largest tilt of the torso from vertical."""
    height_min: Annotated[float, "m"] = 0.3
    """Least height of the pelvis."""
    load_min: float = 0.4
    """Least share of the weight that stays on the floor: friction and pressure balance the robot with it."""
    friction_share: float = 0.9
    """Share of the friction that the controller counts on that the plan uses."""
    torque_share: float = 0.88
    """Share of the effort limits of waist and arms that the plan uses."""
    self_distance: Annotated[float, "m"] = 0.014
    """Least distance between bodies that are not neighbours."""
    self_trigger: Annotated[float, "m"] = 0.05
    """Distance beyond the least one at which a pair of bodies begins to count."""
    floor_distance: Annotated[float, "m"] = 0.03
    """Least height of hands and forearms over the floor."""
    floor_trigger: Annotated[float, "m"] = 0.1
    """Height beyond the least one at which a body begins to count."""
    approach_time: Annotated[float, "s"] = 0.033
    """Time for which bodies may approach each other or the floor before they are too near, between two knots."""


@dataclass(frozen=True, kw_only=True)
class PlannerConfig:
    """Settings of the way from a chunk to a feasible plan."""

    posture: TrajectoryConfig = field(default_factory=TrajectoryConfig)
    orientation_relaxed: Annotated[float, "rad", "scale"] = 0.02
    """Scale of palm orientations where palms cannot be at their positions otherwise."""
    orientation_free: Annotated[float, "rad", "scale"] = 0.05
    """Scale of the palms' orientation where that is not enough."""
    relax_error: Annotated[float, "m"] = 0.008
    """Distance of a planned palm from its target above which these are tried."""
    tracking_error_max: Annotated[float, "m"] = 0.03
    """Largest distance of a planned palm from its target up to which a plan counts as following."""
    mean_error_max: Annotated[float, "m"] = 0.01
    """Mean distance of the palms from the targets, at their own times, up to which it does whatever the largest."""
    unreachable: Annotated[float, "m"] = 0.15
    """Distance of a planned palm from its target past which the target is out of reach, not just hard to follow."""
    violation_max: float = 1.0
    """Largest excess over a bound of a safe plan, in terms of the bound's tolerance."""
    capture_point_drift_max: Annotated[float, "m"] = 0.006
    """Drift of the capture point up to which a plan is balanced where, between knots, its zero-moment point would have
    to leave the support: a quarter of the controller's own margin."""
    friction_deficit_max: Annotated[float, "m/s"] = 0.3
    """Impulse per mass that the floor may fail to give for lack of friction up to which a plan is balanced."""
    friction_deficit_unreachable: Annotated[float, "m/s"] = 0.15
    """Largest friction deficit where a target is out of reach, for which less is risked."""
    warm_start_distance: Annotated[float, "m"] = 0.03
    """Distance of the plan before from the palms wanted up to which the search begins with it."""
    warm_start_error: Annotated[float, "m"] = 0.0055
    """Tracking error above which a search that began so is repeated without, up to `relax_error`."""
    settle: Annotated[float, "s"] = 0.5
    """Time that the plan goes on after the hands have arrived, to come to rest."""
    clamp_tolerance: Annotated[float, "m"] = 0.008
    """Distance between a target and what the trajectory reaches that is left to the QP."""
    turn_tolerance: Annotated[float, "rad"] = 0.05
    """Tolerance of the palms' orientation."""
    slowdowns: tuple[float, ...] = (1.5, 2.5)
    """Factors tried in turn when a chunk is too fast for its plan."""


@dataclass(frozen=True, kw_only=True)
class ControllerConfig:
    """The whole-body controller."""

    dt: Annotated[float, "s"] = 0.002
    """Control period."""
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
    """When the robot may step: 'never', both feet stay; 'recover', to catch itself; 'reach', also to where hands are in
    reach, and as it is told."""
    leak: Annotated[float, "s"] = 0.3
    """Time constant with which the desired state forgets its difference from the measured one."""
    friction: float = 0.6
    """Friction coefficient that the controller counts on."""
    force_min: Annotated[float, "N"] = 5.0
    """Least normal force of one contact point."""
    force_max: Annotated[float, "N"] = 500.0
    """Largest normal force of one contact point."""
    foot_kp: Annotated[float, "1/s^2"] = 0.0
    """Stiffness with which a foot that moved is pulled back."""
    foot_kd: Annotated[float, "1/s"] = 20.0
    """Damping of a foot that moved."""
