"""Configuration: frozen dataclasses hold the defaults, YAML files only override them."""

from __future__ import annotations

from dataclasses import dataclass, field


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
    """Distance of a body joint from the posture plan at which the hands begin to give way to it [rad]."""
    posture_stop: float = 0.45
    """Distance at which they have given way [rad]."""
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
    """Least distance between bodies that are not neighbours; the posture plan keeps a little more [m]."""
    self_trigger: float = 0.05
    """Distance beyond the least one from which a pair of bodies counts [m]."""
    self_brake: float = 10.0
    """[m/s^2]"""
    torque_share: float = 0.95
    """Share of the effort limit that the program may plan with; the rest is for the position loop."""


@dataclass(frozen=True, kw_only=True)
class PosturePlanConfig:
    """Weights, limits and margins of the posture plan."""

    dt: float = 1.0 / 60.0
    """Step [s]."""
    position_weight: float = 2e4
    """Palm positions [1/m^2]."""
    orientation_weight: float = 340.0
    """Palm orientations [1/rad^2]."""
    orientation_give: float = 0.1
    """Orientation error from which that weight falls: where both cannot be had, position wins [rad]."""
    com_weight: float = 63.0
    """Centre of mass over the middle of the support [1/m^2]."""
    zmp_weight: tuple[float, float] = (0.005, 0.7)
    """Zero-moment point under the centre of mass, forwards and sideways: room for what the plan does not know, and no
    swaying from foot to foot, which nothing else holds back [1/m^2]."""
    torso_weight: float = 10.0
    """Torso upright: leaning loads the waist, whose 35 N m are soon used up [1/rad^2]."""
    pelvis_weight: float = 2.5
    """[1/rad^2]"""
    height_weight: float = 20.0
    """[1/m^2]"""
    posture_weight: float = 0.14
    """Joints near the stance [1/rad^2]."""
    time_constant: float = 0.11
    """With which the tasks below the hands approach their references [s]."""
    smoothness: float = 1e-6
    """Price of accelerations [1/(m/s^2)^2, 1/(rad/s^2)^2]."""
    damping: float = 1e-7
    """Price of velocities [1/(m/s)^2, 1/(rad/s)^2]."""
    slack_price: float = 100.0
    """Price of breaking a limit [s/m, s/rad]: above what a task gains by it."""
    hand_gain: float = 1.0
    """Share of a small hand error that one step takes back."""
    hand_brake: float = 2.0
    """With which a hand that is far from its target counts on stopping [m/s^2]."""
    hand_speed: float = 0.5
    """With which such a hand catches up [m/s]."""
    hand_turn_brake: float = 4.0
    """[rad/s^2]"""
    hand_turn_speed: float = 1.5
    """[rad/s]"""
    joint_margin: float = 0.04
    """Distance kept from joint position limits [rad]."""
    knee_min: float = 0.2
    """Least knee angle: a straight leg cannot move the pelvis up or down any more [rad]."""
    elbow_max: float = 1.45
    """Largest elbow angle; 1.57 is straight, and there the hand can no longer be moved along the arm [rad]."""
    speed_share: float = 0.6
    """Share of the joint speed limits that the plan uses."""
    acceleration: float = 50.0
    """Largest joint acceleration [rad/s^2]."""
    joint_brake: float = 40.0
    """Deceleration counted on before a position limit [rad/s^2]."""
    com_margin: float = 0.045
    """Distance of the centre of mass from the edge of the support: with realistic sensing 30 mm is not enough [m]."""
    com_rate: float = 3.0
    """Speed at which the centre of mass may approach that distance, per metre left [1/s]."""
    capture_margin: float = 0.03
    """Distance of the capture point from the edge of the support [m]."""
    zmp_margin: float = 0.018
    """Distance of the zero-moment point from the edge of the support [m]."""
    pelvis_tilt: float = 0.55
    """Largest tilt of the pelvis from vertical [rad]."""
    torso_tilt: float = 0.95
    """Largest tilt of the torso from vertical [rad]."""
    tilt_brake: float = 8.0
    """[rad/s^2]"""
    height_min: float = 0.28
    """Least height of the pelvis [m]."""
    height_brake: float = 3.0
    """[m/s^2]"""
    torque_share: float = 0.9
    """Share of the effort limits of waist and arms that the plan uses."""
    torque_slack_price: float = 0.073
    """Price of using more, as a speed that the torque would give the joint in one step [s/rad]."""
    waist_torque_weight: float = 1.3e-7
    """Waist torques: its 35 N m are soon used up [1/(N m)^2]."""
    self_distance: float = 0.012
    """Least distance between bodies that are not neighbours [m]."""
    self_trigger: float = 0.06
    """Distance beyond the least one at which a pair of bodies begins to count [m]."""
    distance_brake: float = 8.0
    """Deceleration of approaching bodies [m/s^2]."""


AGILE = PosturePlanConfig(
    orientation_weight=1000.0,
    com_weight=70.0,
    zmp_weight=(0.005, 0.2),
    torso_weight=200.0,
    pelvis_weight=2.0,
    height_weight=8.0,
    posture_weight=0.15,
    torque_slack_price=0.05,
    smoothness=2e-7,
    acceleration=80.0,
    hand_brake=6.0,
    hand_speed=1.5,
    hand_turn_brake=18.0,
    hand_turn_speed=4.0,
    height_min=0.35,
    zmp_margin=0.025,
)
"""For fast chunks: hard accelerations, and an upright torso, whose swinging would use up the waist."""

GENTLE = PosturePlanConfig(
    position_weight=200.0,
    orientation_weight=10.0,
    zmp_weight=(1.0, 1.0),
    torso_weight=90.0,
    smoothness=2.2e-7,
    acceleration=40.0,
    height_min=0.35,
    zmp_margin=0.025,
)
"""For chunks that cannot be followed: the hands only pull, so that nothing is torn to where it cannot be."""


@dataclass(frozen=True, kw_only=True)
class PlannerConfig:
    """From a chunk to a feasible plan."""

    posture: PosturePlanConfig = field(default_factory=PosturePlanConfig)
    agile: PosturePlanConfig = AGILE
    """The posture plan of a chunk that the calm one does not follow."""
    calm_speed: float = 0.6
    """Palm speed up to which a chunk is planned calmly [m/s]."""
    calm_loss: float = 0.01
    """Largest distance of a calm plan's palm from its target [m]."""
    gentle: PosturePlanConfig = GENTLE
    """The posture plan of a chunk that cannot be followed."""
    loss_max: float = 0.03
    """Largest distance of a planned palm from its target up to which a plan counts as following [m]."""
    slack_max: float = 0.3
    """Largest slack of a plan that counts as following [m/s, rad/s]."""
    settle: float = 0.4
    """Time that the plan goes on after the hands have arrived, to come to rest [s]."""
    clamp_tolerance: float = 0.006
    """Distance between a target and what the posture plan reaches that is left to the QP [m]."""
    turn_tolerance: float = 0.05
    """The same for orientation [rad]."""
    slowdowns: tuple[float, ...] = (1.5, 2.5)
    """Factors tried in turn when a chunk is too fast for its plan."""


@dataclass(frozen=True, kw_only=True)
class ControllerConfig:
    """The whole-body controller."""

    dt: float = 0.002
    """Control period [s]."""
    backend: str = "native"
    """Whose program is solved: 'native', or 'placo' for a second opinion on the dynamics."""
    solver: str = "daqp"
    """Name of the QP solver."""
    fallback: str = "quadprog"
    """Second solver, asked when the first one's answer fails the residual check; 'none' to do without."""
    hand: HandConfig = field(default_factory=HandConfig)
    body: BodyConfig = field(default_factory=BodyConfig)
    safety: SafetyConfig = field(default_factory=SafetyConfig)
    planner: PlannerConfig = field(default_factory=PlannerConfig)
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
