"""Postures of the robot, references that stand still, and the acceleration of a point by differences."""

import numpy as np
import pinocchio as pin

from models.pinocchio_model import stance_q
from wholebody.control.reference_packet import BodyReference, PalmReference


def standing(controller, q, lift=0.0):
    robot = controller.robot
    zero = np.zeros(robot.n_joints)
    palms = []
    for tool in controller.spec.tools:
        T = robot.pose(tool.palm_frame)
        pose = pin.SE3(T.rotation, T.translation + np.array([0.0, 0.0, lift]))
        palms.append(PalmReference(T_world=pose, twist=np.zeros(6), acceleration=np.zeros(6)))
    return BodyReference(
        palms=tuple(palms),
        q=q,
        dq=zero,
        ddq=zero,
        pelvis=(robot.pose("pelvis").rotation.copy(), np.zeros(3), np.zeros(3)),
        torso=(robot.pose("torso_link").rotation.copy(), np.zeros(3), np.zeros(3)),
        height=(q[2], 0.0, 0.0),
        com=(robot.com.copy(), np.zeros(3), np.zeros(3)),
        momentum=(np.zeros(3), np.zeros(3)),
    )


def upright(controller, poses):
    """The stance as a reference, palms elsewhere."""
    zero, q = np.zeros(3), stance_q(controller.spec, controller.robot.model)
    upright = (np.eye(3), zero, zero)
    joints = np.zeros(controller.robot.n_joints)
    palms = tuple(PalmReference(T_world=T, twist=np.zeros(6), acceleration=np.zeros(6)) for T in poses)
    return BodyReference(
        palms=palms,
        q=q,
        dq=joints,
        ddq=joints,
        pelvis=upright,
        torso=upright,
        height=(q[2], 0.0, 0.0),
        com=(np.array([0.0, 0.0, 0.65]), zero, zero),
        momentum=(zero, zero),
    )


def postures(robot, count, seed=7):
    """Half near the stance, half anywhere within the joint limits."""
    rng = np.random.default_rng(seed)
    stance = stance_q(robot.spec, robot.model)
    low, high = robot.model.lowerPositionLimit[7:], robot.model.upperPositionLimit[7:]
    for i in range(count):
        q = pin.integrate(robot.model, stance, rng.normal(0.0, 0.15, robot.nv))
        if i % 2:
            q[7:] = rng.uniform(low, high)
        yield q


def point_acceleration(robot, joint, local, q, v, step):
    """Of a point fixed to a body, for dv = 0: central difference of its velocity."""
    data, velocities = robot.model.createData(), []
    for sign in (1.0, -1.0):
        pin.forwardKinematics(robot.model, data, pin.integrate(robot.model, q, sign * step * v), v)
        M, motion = data.oMi[joint], pin.getVelocity(robot.model, data, joint, pin.LOCAL_WORLD_ALIGNED)
        velocities.append(motion.linear + np.cross(motion.angular, M.rotation @ local))
    return (velocities[0] - velocities[1]) / (2.0 * step)


def leaning(robot, pelvis, waist, roll=0.0):
    """The stance with the pelvis and the waist bent forward, the waist to one side [rad], both feet and the centre of
    mass where they are: configuration (nq,).
    """
    model, spec, stance = robot.model, robot.spec, stance_q(robot.spec, robot.model)
    data, q = model.createData(), stance.copy()
    pin.framesForwardKinematics(model, data, stance)
    feet = [(frame, data.oMf[frame].copy()) for frame in map(robot.frame_id, [foot.frame for foot in spec.feet])]
    com = pin.centerOfMass(model, data, stance)[:2].copy()
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, pelvis, 0.0)).coeffs()
    q[7 + robot.joint_indices(["waist_pitch_joint", "waist_roll_joint"])] = waist, roll
    free = [0, 1, 2, *(6 + i for i, n in enumerate(robot.joint_names) if n.split("_")[1] in ("hip", "knee", "ankle"))]
    for _ in range(50):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        J = [pin.getFrameJacobian(model, data, frame, pin.LOCAL)[:, free] for frame, _ in feet]
        error = [pin.log6(data.oMf[frame].actInv(goal)).vector for frame, goal in feet]
        J = np.vstack([*J, pin.jacobianCenterOfMass(model, data, q)[:2, free]])
        step, error = np.zeros(model.nv), np.concatenate([*error, com - data.com[0][:2]])
        step[free] = J.T @ np.linalg.solve(J @ J.T + 1e-9 * np.eye(len(J)), error)
        q = pin.integrate(model, q, np.clip(step, -0.1, 0.1))
    assert np.abs(error).max() < 1e-6
    return q
