"""Chunks that break one thing each, by construction, and a computation of its own that says so.

``python tests/support/planted_causes.py FIRST LAST [KIND ...]`` plants the seeds FIRST to LAST - 1 of each kind, asks
why they cannot be done, as ``check --fast --why`` does, and prints a line each, then the share of right causes of each
kind, of the sets that pass drop-one and of the certificates that are proofs, and the time. A case that nothing is
said against is done, if the motion that a search has for it keeps what is looked at here. Drop-one is looked at
by searches of their own: with the set alone there is no plan from five starts, without any one member the plan that was
kept keeps the others. With --from FILE only what its lines come to is printed.

What is planted is computed here from Pinocchio's URDF model and NumPy alone: lengths of chains, inverse
kinematics with and without joint limits, forces of the forearms as they are asked to move, distances of hulls.
"""

import json
import sys
from copy import deepcopy
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import wholebody
from models import g1
from models.pinocchio_model import load_collision, load_pinocchio, stance_q
from models.scenes.furniture import TABLE_HEIGHT
from policy.chunk import ActionChunk
from policy.geometry.rotations import rotvec_to_matrix
from policy.scripted.policy import minimum_jerk, palm_offset, stance_pose
from tests.support.proof import proves
from tests.support.sent_chunks import FPS, SPEC, STANCE, STEPS
from wholebody.config import ControllerConfig, LoadConfig, PlannerConfig, RobotConfig
from wholebody.planning.judgement.limits import Limit
from wholebody.planning.trajectory import curve_through
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.why import explainer
from wholebody.verdict.why.cause import causes
from wholebody.verdict.why.chunk_program import ChunkProgram
from wholebody.verdict.why.findings import NOTHING
from wholebody.verdict.why.motion_search import EVERY, NAMES

TIME = np.arange(STEPS) / FPS
SLIPPERY, WEAK = 0.05, 10.0
"""Friction coefficient, and effort limit of the waist's linkage [N m], of the robots that are planted with."""
LOADS = 9.5, 10.5
"""Masses in a hand that waist and arm do not hold ahead [kg]."""
ARM = ("elbow", "wrist", "hand")
AHEAD = np.array([0.05, 0.0, 0.1])
"""Where hands have room to swing, from the stance [m]."""
PALM, TURN = 0.02, np.deg2rad(10.0)
"""What counts as done as given [m, rad]."""
TRIES = 20
"""Postures from which inverse kinematics begin here."""
CLEAR = 0.03
"""Distance of bodies that no bound of theirs has to do with [m]: twice what a plan keeps."""


PLAIN = ControllerConfig()
UPRIGHT = replace(PLAIN.planner.posture, torso_tilt=0.15, pelvis_tilt=0.15, height_min=0.62)
STIFF = ControllerConfig(planner=PlannerConfig(posture=UPRIGHT))
TALL = ControllerConfig(planner=PlannerConfig(posture=replace(PLAIN.planner.posture, height_min=0.62)))
NARROW = ControllerConfig(planner=PlannerConfig(posture=replace(UPRIGHT, joint_margin=0.22)))
"""A robot that may hardly lean or crouch cannot draw its trunk or its leg away from a hand."""


@dataclass
class Planted:
    """A chunk, the robot it is for, what is right to say, and what was computed here: a value past its bound."""

    kind: str
    chunk: ActionChunk
    right: frozenset
    value: float
    bound: float
    config: ControllerConfig = PLAIN
    from_stance: bool = False
    scene: str = "floor"
    also: frozenset = frozenset()
    first: "Planted | None" = None


@lru_cache(maxsize=1)
def robot():
    spec = g1()
    model = load_pinocchio(spec)
    return spec, model, model.createData(), stance_q(spec, model)


def chunk_of(left=None, right=None, R_left=None, R_right=None):
    """Palm points (H, 3) [m] and rotations (H, 3, 3) of both hands; those of the stance where not given."""
    stance, T = stance_pose(), []
    for side, p, R, p0, R0 in (
        ("left", left, R_left, stance.p_world_lpalm, stance.R_world_lhand),
        ("right", right, R_right, stance.p_world_rpalm, stance.R_world_rhand),
    ):
        poses = np.tile(np.eye(4), (STEPS, 1, 1))
        poses[:, :3, :3] = R0 if R is None else R
        poses[:, :3, 3] = (p0 if p is None else p) - poses[:, :3, :3] @ palm_offset(side)
        T.append(poses)
    fingers = [np.tile(q, (STEPS, 1)) for q in (STANCE.q_lhand, STANCE.q_rhand)]
    return ActionChunk(SPEC.id, 0, 0.0, FPS, *T, *fingers)


def moved(goal, time, start=None):
    """Minimum jerk from the left palm of the stance, or a start, to a goal within a time, (H, 3) [m]."""
    start = stance_pose().p_world_lpalm if start is None else start
    return start + minimum_jerk(TIME / time)[:, None] * (np.asarray(goal) - start)


def mirrored(p):
    return p * [1.0, -1.0, 1.0]


def chain_length(frame, foot):
    """Length of the links between a sole and a frame, all stretched out [m]."""
    _, model, *_ = robot()
    ends = [model.frames[model.getFrameId(name)] for name in (frame, foot)]
    length = sum(float(np.linalg.norm(end.placement.translation)) for end in ends)
    for end in ends:
        joint = end.parentJoint
        while joint > 1:
            length += float(np.linalg.norm(model.jointPlacements[joint].translation))
            joint = model.parents[joint]
    return length


def reach(rng):
    spec, model, data, q = robot()
    pin.framesForwardKinematics(model, data, q)
    tool, foot = spec.tools[0], spec.feet[0]
    sole = data.oMf[model.getFrameId(foot.frame)].translation
    length = chain_length(tool.wrist_frame, foot.frame)
    way = rng.normal(size=3)
    # Upwards by enough that no finger comes near the floor.
    way[0], way[2] = abs(way[0]), abs(way[2]) + 0.3 * float(np.linalg.norm(way))
    goal = sole + (length + np.linalg.norm(palm_offset("left")) + rng.uniform(0.1, 0.4)) * way / np.linalg.norm(way)
    far = np.linalg.norm(goal - sole) - np.linalg.norm(palm_offset("left"))
    return Planted("reach", chunk_of(moved(goal, 1.6)), frozenset({Limit.REACH}), far, length)


def least_error(goals, *, limited=True, enough=0.5, load=0.0, config=NARROW):
    """Least error of both palms from poses, in terms of what counts as done, and the posture.

    The pelvis is that of a robot that may hardly lean or crouch, generously: it floats in a box, and the waist tilts
    the torso by no more than the torso and the pelvis may. With a load in the left hand [kg], the error is at least
    the largest torque of waist and left arm at rest in terms of its effort limit.
    """
    from scipy.optimize import least_squares

    spec, model, data, q0 = robot()
    names = [n for n in model.names if n.startswith("waist_") or any(x in n for x in ("shoulder", "elbow", "wrist"))]
    columns = np.array([model.joints[model.getJointId(n)].idx_q for n in names])
    c, order = config.planner.posture, [spec.joint_names.index(n) for n in names]
    low, high = spec.position_min[order] + c.joint_margin, spec.position_max[order] - c.joint_margin
    high = np.where(["elbow" in n for n in names], np.minimum(high, c.elbow_max), high)
    tilts = np.array([n in ("waist_roll_joint", "waist_pitch_joint") for n in names])
    low, high = np.where(tilts, np.maximum(low, -0.32), low), np.where(tilts, np.minimum(high, 0.32), high)
    if not limited:
        arm = np.array([not n.startswith("waist_") for n in names])
        low, high = np.where(arm, -2.0 * np.pi, low), np.where(arm, 2.0 * np.pi, high)
    low = np.concatenate([[-0.12, -0.12, -0.15, -0.16, -0.16, -0.6], low])
    high = np.concatenate([[0.12, 0.12, 0.03, 0.16, 0.16, 0.6], high])
    frames = [model.getFrameId(tool.palm_frame) for tool in spec.tools]

    def posture(x):
        q = q0.copy()
        q[:3] += x[:3]
        q[3:7] = pin.Quaternion(pin.exp3(x[3:6])).coeffs()
        q[columns] = x[6:]
        return q

    def error(x):
        q = posture(x)
        pin.forwardKinematics(model, data, q)
        es = [pin.updateFramePlacement(model, data, i).actInv(goal) for i, goal in zip(frames, goals, strict=True)]
        error = np.concatenate([part for e in es for part in (e.translation / PALM, pin.log3(e.rotation) / TURN)])
        return np.concatenate([error, np.maximum(arm_shares(q, load) - 0.9, 0.0)]) if load else error

    def size(found):
        now = np.linalg.norm(found.fun[:12].reshape(4, 3), axis=1).max()
        return max(now, arm_shares(posture(found.x), load).max()) if load else now

    best, there, rng = np.inf, q0, np.random.default_rng(0)
    for start in range(TRIES):
        x = np.concatenate([np.zeros(6), rng.uniform(low[6:], high[6:]) if start else q0[columns]])
        found = least_squares(error, np.clip(x, low + 1e-6, high - 1e-6), bounds=(low, high), max_nfev=40)
        now = size(found)
        if now < best:
            best, there = float(now), posture(found.x)
        if best < enough:
            break
    return best, there


def joint_limit(rng):
    """Palms turned so that not all joints of waist and arms can be in their ranges, and could be there without them."""
    stance, mirror = stance_pose(), np.array([-1.0, 1.0, -1.0])
    while True:
        turn = rng.normal(size=3)
        turn *= rng.uniform(2.0, 3.0) / np.linalg.norm(turn)
        goal = rng.uniform([0.2, 0.15, 0.85], [0.35, 0.35, 1.15])
        share = minimum_jerk(TIME / 1.4)[:, None]
        R = rotvec_to_matrix(share * turn) @ stance.R_world_lhand
        S = rotvec_to_matrix(share * turn * mirror) @ stance.R_world_rhand
        goals = [pin.SE3(R[-1], goal), pin.SE3(S[-1], mirrored(goal))]
        value, _ = least_error(goals, enough=1.3)
        if value <= 1.3:
            continue
        error, q = least_error(goals, limited=False)
        if error < 0.5 and clearance(q) > CLEAR:
            chunk = chunk_of(moved(goal, 1.4), mirrored(moved(goal, 1.4)), R, S)
            return Planted("joint_limit", chunk, frozenset({Limit.JOINT_POSITION}), value, 1.0, NARROW)


def forearms():
    """Share of the weight that moves with the palms: of both forearms, wrists and hands."""
    _, model, *_ = robot()
    mass = [model.inertias[i].mass for i, name in enumerate(model.names) if any(x in name for x in ARM)]
    return sum(mass) / pin.computeTotalMass(model)


def acceleration(swing):
    """Largest acceleration of a swing (H, 3) [m/s^2]."""
    return float(np.abs(np.diff(swing, 2, axis=0)).max()) * FPS**2


def sole_corners():
    spec, model, data, q = robot()
    pin.framesForwardKinematics(model, data, q)
    return np.array(
        [data.oMf[model.getFrameId(foot.frame)].act(np.array(x))[:2] for foot in spec.feet for x in foot.points]
    )


def too_fast(rng):
    """Both hands swing sideways together, faster than the soles can hold the body that carries them."""
    stance, rate = stance_pose(), rng.uniform(7.7, 8.2)
    swing = np.zeros((STEPS, 3))
    swing[:, 1] = rng.uniform(17.5, 18.5) / rate**2 * minimum_jerk(TIME / 1.0) * np.sin(rate * TIME)
    chunk = chunk_of(stance.p_world_lpalm + AHEAD + swing, stance.p_world_rpalm + AHEAD + swing)
    # The pressure moves by what their force tips the rest, which can give way by little within half a swing.
    shift = forearms() * acceleration(swing) / 9.81 * stance.p_world_lpalm[2]
    room = 0.5 * np.ptp(sole_corners()[:, 1])
    right = frozenset({Limit.ZMP, Limit.CAPTURE_POINT, Limit.BALANCE})
    return Planted("too_fast", chunk, right, shift, room)


def friction(rng):
    """On a slippery floor the hands swing against each other, and turn the robot about the vertical."""
    stance, rate = stance_pose(), rng.uniform(8.0, 9.0)
    swing = np.zeros((STEPS, 3))
    swing[:, 0] = rng.uniform(15.0, 17.0) / rate**2 * minimum_jerk(TIME / 0.5) * np.sin(rate * TIME)
    apart = np.array([0.0, 0.05, 0.0])
    left, right = stance.p_world_lpalm + AHEAD + apart + swing, stance.p_world_rpalm + AHEAD - apart - swing
    chunk = chunk_of(left, right)
    twist = forearms() * acceleration(swing) / 9.81 * left[0, 1]
    corners = sole_corners()
    lever = float(np.linalg.norm(corners - corners.mean(axis=0), axis=1).max())
    config = ControllerConfig(friction=SLIPPERY)
    right = frozenset({Limit.FRICTION})
    return Planted("friction", chunk, right, twist, SLIPPERY * lever, config)


def waist_torque(rng):
    """Both palms far ahead and low; what the posture that a robot with a strong waist has for it asks of the waist."""
    _, model, data, _ = robot()
    goal = np.array([rng.uniform(0.4, 0.46), rng.uniform(0.15, 0.2), rng.uniform(0.35, 0.55)])
    chunk = chunk_of(moved(goal, 1.4), mirrored(moved(goal, 1.4)))
    q = wholebody.solve(chunk.T_world_lhand[-1], chunk.T_world_rhand[-1]).q
    tau = pin.computeGeneralizedGravity(model, data, q)[model.joints[model.getJointId("waist_pitch_joint")].idx_v]
    config = ControllerConfig(robot=RobotConfig(linkage_effort=WEAK))
    return Planted("waist_torque", chunk, frozenset({Limit.WAIST_TORQUE}), abs(float(tau)), 2.0 * WEAK, config)


def arm_shares(q, load):
    """Torques of waist and left arm at rest in terms of their effort limits, with a load in the left palm [kg]."""
    spec, model, data, _ = robot()
    tau = pin.computeGeneralizedGravity(model, data, q)
    pin.computeJointJacobians(model, data, q)
    J = pin.getFrameJacobian(model, data, model.getFrameId(spec.tools[0].palm_frame), pin.LOCAL_WORLD_ALIGNED)
    names = [n for n in model.names if n.startswith(("waist", "left_shoulder", "left_elbow", "left_wrist"))]
    columns = [model.joints[model.getJointId(n)].idx_v for n in names]
    limits = spec.effort_max[[spec.joint_names.index(n) for n in names]]
    return np.abs((tau + load * 9.81 * J[2])[columns]) / limits


def arm_torque(rng):
    """A hand ahead with a load, which no posture found here gets there within the torques of waist and arm."""
    load = rng.uniform(*LOADS)
    goal = np.array([rng.uniform(0.4, 0.44), rng.uniform(0.2, 0.35), rng.uniform(1.0, 1.15)])
    chunk = chunk_of(moved(goal, 1.4))
    offsets = zip((chunk.T_world_lhand[-1], chunk.T_world_rhand[-1]), ("left", "right"), strict=True)
    goals = [pin.SE3(T[:3, :3], T[:3, 3] + T[:3, :3] @ palm_offset(side)) for T, side in offsets]
    value, _ = least_error(goals, enough=1.0, load=load, config=STIFF)
    config = replace(STIFF, loads=LoadConfig(source="told", left=load))
    return Planted("arm_torque", chunk, frozenset({Limit.WAIST_TORQUE}), value, 1.0, config)


@lru_cache(maxsize=1)
def geometry():
    spec, model, *_ = robot()
    shapes = load_collision(spec, model)
    return shapes, shapes.createData()


def clearance(q):
    """Least distance of the hulls of the left hand from all that its forearm does not carry, at a configuration [m]."""
    import coal

    _, model, data, _ = robot()
    shapes, placed = geometry()
    pin.forwardKinematics(model, data, q)
    pin.updateGeometryPlacements(model, data, shapes, placed)
    items = [(item.name, item.geometry, placed.oMg[i]) for i, item in enumerate(shapes.geometryObjects)]
    mine = [one for one in items if one[0].startswith("left_hand")]
    others = [one for one in items if not one[0].startswith(("left_hand", "left_wrist", "left_elbow"))]
    least = np.inf
    for _, a, A in mine:
        for _, b, B in others:
            result = coal.DistanceResult()
            A1, B1 = (coal.Transform3s(x.rotation, x.translation) for x in (A, B))
            least = min(least, coal.distance(a, A1, b, B1, coal.DistanceRequest(), result))
    return least


def hull_distance(poses, those):
    """Least distance of the hulls of the left hand, its wrist at a pose (4, 4), from those of other bodies [m].

    The hand is moved as a whole: from where the stance has it, with all that hangs on the wrist.
    """
    import coal

    spec, model, data, q = robot()
    shapes, _ = geometry()
    pin.forwardKinematics(model, data, q)
    pin.updateGeometryPlacements(model, data, shapes, geometry()[1])
    pin.framesForwardKinematics(model, data, q)
    least = np.inf
    moves = [
        pin.SE3(T) * data.oMf[model.getFrameId(tool.wrist_frame)].inverse()
        for T, tool in zip(poses, spec.tools, strict=True)
    ]

    def placed(prefix, move):
        for i, item in enumerate(shapes.geometryObjects):
            if item.name.startswith(prefix):
                yield item.geometry, move * geometry()[1].oMg[i]

    mine = [*placed("left_hand", moves[0]), *placed("left_wrist_yaw", moves[0])]
    others = [pair for prefix, move in those for pair in placed(prefix, moves[1] if move else pin.SE3.Identity())]
    for a, A in mine:
        for b, B in others:
            result = coal.DistanceResult()
            A1, B1 = (coal.Transform3s(x.rotation, x.translation) for x in (A, B))
            least = min(least, coal.distance(a, A1, b, B1, coal.DistanceRequest(), result))
    return least


def collision(kind, goal, right, those, config=STIFF, depth=0.03):
    chunk = chunk_of(goal, right)
    poses = [chunk.T_world_lhand[-1], chunk.T_world_rhand[-1]]
    return Planted(kind, chunk, frozenset({Limit.SELF_DISTANCE}), -hull_distance(poses, those), depth, config)


def hand_hand(rng):
    middle = np.array([rng.uniform(0.22, 0.32), 0.0, rng.uniform(0.8, 1.0)])
    left, right = middle + np.array([0.0, rng.uniform(-0.05, 0.02), 0.0]), middle
    start = mirrored(stance_pose().p_world_lpalm)
    those = [("right_hand", True), ("right_wrist_yaw", True)]
    return collision("hand_hand", moved(left, 1.4), moved(right, 1.4, start), those, ControllerConfig())


def arm_torso(rng):
    goal = np.array([rng.uniform(-0.03, 0.03), rng.uniform(-0.03, 0.03), rng.uniform(0.75, 0.95)])
    return collision(
        "arm_torso", moved(goal, 1.4), None, [("torso", False), ("pelvis", False), ("waist", False)], depth=0.045
    )


def arm_thigh(rng):
    goal = np.array([rng.uniform(0.04, 0.08), rng.uniform(0.11, 0.13), rng.uniform(0.38, 0.46)])
    return collision("arm_thigh", moved(goal, 1.4), None, [("left_hip", False), ("left_knee", False)], TALL)


def scene(rng):
    """A hand asked into the board of a table."""
    import coal

    goal = np.array([rng.uniform(0.28, 0.45), rng.uniform(0.1, 0.3), TABLE_HEIGHT + rng.uniform(-0.1, -0.04)])
    chunk = chunk_of(moved(goal, 1.4))
    spec, model, data, q = robot()
    shapes, placed = geometry()
    pin.forwardKinematics(model, data, q)
    pin.updateGeometryPlacements(model, data, shapes, placed)
    wrist = pin.updateFramePlacement(model, data, model.getFrameId(spec.tools[0].wrist_frame))
    move, board = pin.SE3(chunk.T_world_lhand[-1]) * wrist.inverse(), coal.Box(0.5, 1.0, 0.04)
    least, there = np.inf, coal.Transform3s(np.eye(3), np.array([0.45, 0.0, TABLE_HEIGHT - 0.02]))
    for i, item in enumerate(shapes.geometryObjects):
        if item.name.startswith("left_hand"):
            T, result = move * placed.oMg[i], coal.DistanceResult()
            at = coal.Transform3s(T.rotation, T.translation)
            least = min(least, coal.distance(item.geometry, at, board, there, coal.DistanceRequest(), result))
    right = frozenset({Limit.SCENE_DISTANCE})
    return Planted("scene", chunk, right, -least, 0.03, scene="table")


def floor(rng):
    goal = np.array([rng.uniform(0.2, 0.4), rng.uniform(0.15, 0.3), rng.uniform(-0.3, -0.05)])
    chunk = chunk_of(moved(goal, 1.5))
    return Planted("floor", chunk, frozenset({Limit.INTO_FLOOR}), -float(goal[2]), 0.0)


def start(rng):
    way = rng.normal(size=3) * [0.5, 1.0, 0.5]
    jump = rng.uniform(0.35, 0.4) * way / np.linalg.norm(way)
    jump[1] = abs(jump[1])
    chunk = chunk_of(stance_pose().p_world_lpalm + np.tile(jump, (STEPS, 1)))
    value = float(np.linalg.norm(jump))
    return Planted("start", chunk, frozenset({Limit.START}), value, 0.3, from_stance=True)


def hand_speed(rng):
    rate, axis = rng.uniform(6.6, 6.9), 2
    swing = np.zeros((STEPS, 3))
    swing[:, axis] = 2.75 / rate * minimum_jerk(TIME / 1.2) * np.sin(rate * TIME)
    chunk = chunk_of(stance_pose().p_world_lpalm + AHEAD + swing)
    rates = [np.abs(np.diff(swing[:, axis], k)).max() * FPS**k for k in (1, 2, 3)]
    assert rates[1] < 20.0
    assert rates[2] < 600.0
    return Planted("hand_speed", chunk, frozenset({Limit.HAND_SPEED}), float(rates[0]), 2.5)


def jerk(rng):
    """A square wave of accelerations."""
    size, period, axis = rng.uniform(13.0, 17.0), int(rng.choice([8, 10, 12])), int(rng.integers(3))
    a = size * np.where((np.arange(STEPS) + period // 4) // (period // 2) % 2, -1.0, 1.0)
    v = np.cumsum(a) / FPS
    x = np.cumsum(v - v.mean()) / FPS
    swing = np.zeros((STEPS, 3))
    swing[:, axis] = x - np.linspace(x[0], x[-1], STEPS)
    chunk = chunk_of(stance_pose().p_world_lpalm + AHEAD + swing)
    rates = [np.abs(np.diff(swing[:, axis], k)).max() * FPS**k for k in (1, 2, 3)]
    assert rates[0] < 2.5
    assert rates[1] < 20.0
    return Planted("jerk", chunk, frozenset({Limit.HAND_JERK}), float(rates[2]), 600.0)


def finger_range(rng):
    spec, chunk = g1(), chunk_of()
    joint, past = int(rng.integers(7)), rng.uniform(0.1, 2.0)
    i = spec.indices(spec.tools[0].finger_joints)[joint]
    chunk.q_lhand[int(rng.integers(STEPS)), joint] = spec.position_max[i] + past
    right = frozenset({Limit.FINGER_RANGE})
    return Planted("finger_range", chunk, right, spec.position_max[i] + past, spec.position_max[i])


def pair(first, second):
    """Two kinds in one chunk: the second, which is about one hand alone, is done by the right hand."""

    def both(rng):
        one, other = past(KINDS[first], rng), past(KINDS[second], rng)
        alone, chunk = one, deepcopy(one.chunk)
        if second == "finger_range":
            chunk.q_rhand[:] = STANCE.q_rhand
            excess = np.abs(other.chunk.q_lhand - STANCE.q_lhand).max(axis=1).argmax()
            i = g1().indices(g1().tools[1].finger_joints)[0]
            chunk.q_rhand[int(excess), 0] = g1().position_max[i] + other.value - other.bound
        else:
            palm = other.chunk.T_world_lhand[:, :3, 3] + other.chunk.T_world_lhand[:, :3, :3] @ palm_offset("left")
            chunk.T_world_rhand[:, :3, 3] = mirrored(palm) - chunk.T_world_rhand[:, :3, :3] @ palm_offset("right")
        return replace(one, chunk=chunk, kind=f"{first}+{second}", also=other.right, first=alone)

    return both


def past(kind, rng):
    """A case whose value, as computed here, is past its bound."""
    while True:
        one = kind(rng)
        if one.value > one.bound:
            return one


KINDS = {
    "reach": reach,
    "joint_limit": joint_limit,
    "too_fast": too_fast,
    "friction": friction,
    "waist_torque": waist_torque,
    "arm_torque": arm_torque,
    "hand_hand": hand_hand,
    "arm_torso": arm_torso,
    "arm_thigh": arm_thigh,
    "floor": floor,
    "scene": scene,
    "start": start,
    "hand_speed": hand_speed,
    "jerk": jerk,
    "finger_range": finger_range,
}
PAIRS = {
    f"{first}+{second}": pair(first, second)
    for first, second in (
        ("reach", "jerk"), ("reach", "floor"), ("arm_torso", "hand_speed"), ("arm_thigh", "finger_range"),
        ("too_fast", "finger_range"), ("waist_torque", "finger_range"), ("hand_hand", "finger_range"),
        ("friction", "finger_range"), ("scene", "jerk"), ("floor", "hand_speed"),
    )
}  # fmt: skip


def planted(kind, seed):
    """The case of a kind and a seed."""
    every = KINDS | PAIRS
    return past(every[kind], np.random.default_rng([seed, *kind.encode()]))


@lru_cache(maxsize=4)
def holder(config, scene="floor"):
    return FastChecker(config, scene)


def told(one):
    """Causes of a case, the program that they are of, and what is known of it."""
    program, known = program_of(one), NOTHING
    plan = program.judge.judge(one.chunk, program.begin).plan
    if plan.report.slowdown == 1.0:
        known = program.with_motion(plan.knots)
    found, _, known = causes(program, known)
    return found, program, known


def program_of(one):
    judge = holder(one.config, one.scene).judge
    return ChunkProgram(judge, one.chunk, judge.stance() if one.from_stance else None)


def passes_drop_one(one, cause, program):
    """Whether there is no plan with a set alone, and without any one member one that keeps the others."""
    kinds, fresh = frozenset(cause.kinds), program_of(one)
    if not kinds <= EVERY:
        return kinds == {Limit.REACH} or all(member.margin < 0.0 for member in cause.members)
    if fresh.find(kinds, thorough=True)[0] is not None or kinds != set(cause.witnesses):
        return False
    for name, witness in cause.witnesses.items():
        off = witness.knots.T_palms[program.first :, :, :3, 3] - witness.targets.T_palms[program.first :, :, :3, 3]
        broken = {NAMES[margin.code] for margin in program.margins(witness) if margin.share < -1.0}
        if np.linalg.norm(off, axis=2).max() > PALM or broken & (kinds - {name}):
            return False
    return True


def is_done(one, program, motion):
    """Whether a motion does a case: palms, ranges, soles, centre of mass and hulls as computed here, 100 times."""
    spec, model, data, q0 = robot()
    steps = program.targets.steps
    times = np.linspace(steps[program.first], min(steps[-1], TIME[-1]), 100)
    pin.framesForwardKinematics(model, data, q0)
    soles = [data.oMf[model.getFrameId(foot.frame)].copy() for foot in spec.feet]
    corners, shapes = sole_corners(), geometry()[0]
    inside = spec.position_min - 1e-3, spec.position_max + 1e-3
    for time, q in zip(times, curve_through(steps, motion.knots.q, program.begin.body.v)(times)[0], strict=True):
        q[3:7] /= np.linalg.norm(q[3:7])
        pin.framesForwardKinematics(model, data, q)
        for tool, poses in zip(spec.tools, (one.chunk.T_world_lhand, one.chunk.T_world_rhand), strict=True):
            low = min(int(time * FPS), STEPS - 2)
            share = min(time * FPS - low, 1.0)
            p = (1.0 - share) * poses[low, :3, 3] + share * poses[low + 1, :3, 3]
            off = data.oMf[model.getFrameId(tool.wrist_frame)].translation - p
            if np.linalg.norm(off) > PALM:
                return False
        now = [data.oMf[model.getFrameId(foot.frame)] for foot in spec.feet]
        slipped = max(np.linalg.norm(pin.log6(a.actInv(b)).vector) for a, b in zip(soles, now, strict=True))
        com = pin.centerOfMass(model, data, q)[:2]
        balanced = ((com > corners.min(axis=0)) & (com < corners.max(axis=0))).all()
        joints = q[7 + np.array([model.getJointId(n) - 2 for n in spec.joint_names])]
        if slipped > 5e-3 or not balanced or (joints < inside[0]).any() or (joints > inside[1]).any():
            return False
        pin.updateGeometryPlacements(model, data, shapes, geometry()[1])
        pairs = range(len(shapes.collisionPairs))
        if min(pin.computeDistance(shapes, geometry()[1], k).min_distance for k in pairs) < 0.0:
            return False
    return True


def shown_done(one):
    """Whether a search has a motion that does a case of one kind."""
    _, program, known = told(one)
    motion, _ = program.find(EVERY, known)
    return motion is not None and is_done(one, program, motion)


def is_right(one, sets):
    """Whether what was planted is in the first set of kinds; of a pair, whether each is in one."""
    if one.also:
        return all(any(right & set(kinds) for kinds in sets) for right in (one.right, one.also))
    return bool(sets) and bool(one.right & set(sets[0]))


def answered(kind, seed):
    """What is said of a case, as a row."""
    one = planted(kind, seed)
    checker = holder(one.config, one.scene)
    begin = checker.judge.stance() if one.from_stance else checker.judge.first_pose(one.chunk)
    checker.explainer.prover  # noqa: B018 built once a process, as the checker is
    checker.explainer.asked, before, ends = None, perf_counter(), []

    def timed(*args):
        try:
            return causes(*args)
        finally:
            ends.append(perf_counter())

    explainer.causes = timed
    verdict = checker.of_chunk(one.chunk, begin, kind, (False, False), ask_why=True)
    spent, (program, found) = perf_counter() - before, checker.explainer.asked or (None, [])
    tick, right = verdict.tick and asdict(verdict.tick), is_right(one, [cause.codes for cause in verdict.causes])
    return {
        "kind": kind,
        "seed": seed,
        "right": right,
        "done": not right and shown_done(one.first or one),
        "value": one.value,
        "bound": one.bound,
        "sets": ["+".join(cause.codes) for cause in verdict.causes],
        "irreducible": sum(cause.irreducible for cause in verdict.causes),
        "drop_one": sum(passes_drop_one(one, cause, program) for cause in found),
        "complete": verdict.why_complete,
        "would_do": [change.kind for change in verdict.would_do],
        "proven": bool(tick and tick["proven"]),
        "proof": bool(tick and tick["proven"]) and proves(tick),
        "seconds": spent,
        "causes_seconds": (ends or [before])[0] - before,
        "sentence": verdict.causes[0].sentence if verdict.causes else "",
    }


def summary(rows):
    for kind in dict.fromkeys(row["kind"] for row in rows):
        of_kind = [row for row in rows if row["kind"] == kind]
        seconds = [row["seconds"] for row in of_kind]
        right = sum(row["right"] for row in of_kind)
        print(
            f"{kind:26s} {right:3d} of {len(of_kind):3d}; {np.median(seconds):.2f} s median, {max(seconds):.2f} s worst"
        )
    for name, among in (("single causes", KINDS), ("pairs", PAIRS)):
        some = [row for row in rows if row["kind"] in among and not row["done"]]
        if some:
            right, done = sum(row["right"] for row in some), sum(row["done"] for row in rows if row["kind"] in among)
            print(f"{name}: right in {right} of {len(some)}, {100 * right / len(some):.1f} %; {done} can be done")
    sets, proven = sum(len(row["sets"]) for row in rows), sum(row["proven"] for row in rows)
    irreducible, passed, complete = (sum(row[name] for row in rows) for name in ("irreducible", "drop_one", "complete"))
    print(f"sets {sets}: {irreducible} told as irreducible, {passed} pass drop-one")
    print(f"looked for causes and changes to the end in {complete} of {len(rows)}")
    print(f"proofs {proven}: {sum(row['proof'] for row in rows)} verified")
    for name, said in (("causes_seconds", "until the causes are found"), ("seconds", "in all")):
        seconds = [row[name] for row in rows if name in row]
        if seconds:
            print(f"{said}: {np.median(seconds):.2f} s median, {max(seconds):.2f} s worst of {len(seconds)}")


def main(first, last, kinds):
    rows = []
    for seed in range(first, last):
        for kind in kinds or (*KINDS, *PAIRS):
            rows.append(answered(kind, seed))
            print(json.dumps(rows[-1]), flush=True)
    summary(rows)


if __name__ == "__main__":
    if sys.argv[1] == "--from":
        lines = Path(sys.argv[2]).read_text().splitlines()
        summary([json.loads(line) for line in lines if line.startswith("{")])
    else:
        main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
