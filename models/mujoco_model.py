"""The robot in MuJoCo: the same physics as in Pinocchio, torque motors, whole-body collision, and a scene around it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import combinations

import mujoco
import numpy as np

from models.compiled_cache import compiled
from models.scenes import SceneFile, add_scene
from models.spec import FLOOR_FRICTION, PAYLOAD_AHEAD, PAYLOAD_RADIUS, FootSpec, RobotSpec, RobotSpecError
from models.urdf import NEIGHBOUR_JOINTS, JointTree, light_urdf, parse

STANCE_KEY = "stance"
"""Keyframe with the robot in its default stance and everything else where the scene puts it."""

IMU_SITE = "imu"
BASE_JOINT = "base"

_VISUAL_GROUP, _COLLISION_GROUP = 2, 3  # the viewer shows groups 0-2


def load_mujoco(
    spec: RobotSpec,
    *,
    scene: str | SceneFile = "floor",
    timestep: float = 0.002,
    visuals: bool = False,
    payload_kg: tuple[float, float] = (0.0, 0.0),
    friction: float = FLOOR_FRICTION,
) -> mujoco.MjModel:
    """The robot in a scene, ready to be driven by joint torques.

    Actuators are motors in motor order, named like their joints, with the effort limits as control range. The
    keyframe ``stance`` holds the default stance. Sensors of the IMU: ``imu_quat``, ``imu_gyro``, ``imu_accelerometer``.

    Args:
        spec: The robot.
        scene: One of `models.scenes.SCENES`, or a file.
        timestep: Physics step [s].
        visuals: Load the visual meshes too, for rendering (hundreds of MB); without them the hulls are drawn.
        payload_kg: Mass fixed `PAYLOAD_AHEAD` ahead of the left and right palm [kg].
        friction: Coulomb coefficient between the feet and everything they touch.

    Raises:
        RobotSpecError: If the scene does not exist, a number makes no sense, or the cache cannot be written.
    """

    def build() -> mujoco.MjSpec:
        return build_mujoco(
            spec, scene=scene, timestep=timestep, visuals=visuals, payload_kg=payload_kg, friction=friction
        )

    if visuals or isinstance(scene, SceneFile):
        return build().compile()
    return compiled(spec, build, scene=scene, timestep=timestep, payload_kg=payload_kg, friction=friction)


def build_mujoco(
    spec: RobotSpec,
    *,
    scene: str | SceneFile = "floor",
    timestep: float = 0.002,
    visuals: bool = False,
    payload_kg: tuple[float, float] = (0.0, 0.0),
    friction: float = FLOOR_FRICTION,
) -> mujoco.MjSpec:
    """The model of `load_mujoco` before it is compiled, for those who add to it."""
    _check_number("timestep", timestep, "s", positive=True)
    _check_number("friction", friction, "", positive=True)
    mj = _read_urdf(spec, visuals)
    _set_options(mj, timestep)
    _free_base(spec, mj)
    _set_joints(spec, mj)
    _set_collisions(spec, mj, friction)
    _add_sites(spec, mj)
    _add_payload(spec, mj, payload_kg)
    _add_stance_key(spec, mj, add_scene(mj, scene, friction))
    return mj


def _check_number(name: str, value: float, unit: str, *, positive: bool) -> None:
    low_enough = value > 0.0 if positive else value >= 0.0
    if not (low_enough and np.isfinite(value)):
        raise RobotSpecError(
            f"{name} is {value} {unit}, must be finite and {'above' if positive else 'at least'} 0".strip()
        )


def _read_urdf(spec: RobotSpec, visuals: bool) -> mujoco.MjSpec:
    root = parse(light_urdf(spec, visuals=visuals))
    palm_points = {tool.palm_frame for tool in spec.tools}  # sites here, bodies would slow the simulation down
    for element in root.findall("link") + root.findall("joint"):
        if element.get("name", "").removesuffix("_joint") in palm_points:
            root.remove(element)
    # Keep paths, keep every link as a body, leave inertias alone.
    settings = {"strippath": "false", "fusestatic": "false", "balanceinertia": "false"}
    compiler = ET.Element("compiler", settings | {"discardvisual": "false" if visuals else "true"})
    extension = ET.Element("mujoco")
    extension.append(compiler)
    root.insert(0, extension)
    mj = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    mj.modelname = spec.name
    for geom in mj.geoms:
        only_seen = geom.contype == 0 and geom.conaffinity == 0
        geom.group = _VISUAL_GROUP if only_seen or not visuals else _COLLISION_GROUP
    return mj


def _set_options(mj: mujoco.MjSpec, timestep: float) -> None:
    mj.option.timestep = timestep
    mj.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    mj.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    mj.option.impratio = 10.0  # friction ten times stiffer than the normal direction: less creep of the feet


def _free_base(spec: RobotSpec, mj: mujoco.MjSpec) -> None:
    base = mj.body(spec.base_body)
    x, y, z, w = spec.stance.base_quat_xyzw
    base.pos, base.quat = spec.stance.base_position, (w, x, y, z)
    joint = base.add_freejoint()
    joint.name = BASE_JOINT


def _set_joints(spec: RobotSpec, mj: mujoco.MjSpec) -> None:
    for joint in spec.joints:
        hinge = mj.joint(joint.name)
        if hinge is None:
            raise RobotSpecError(f"{spec.urdf.name} has no joint '{joint.name}' of spec '{spec.name}'")
        hinge.range = (joint.position_min, joint.position_max)
        hinge.actfrcrange = (-joint.effort_max, joint.effort_max)
        hinge.armature = joint.armature
        hinge.damping = [joint.damping, 0.0, 0.0]
        hinge.frictionloss = joint.friction_loss
        motor = mj.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        motor.ctrlrange = (-joint.effort_max, joint.effort_max)
        motor.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE


def _set_collisions(spec: RobotSpec, mj: mujoco.MjSpec, friction: float) -> None:
    """Every part collides with every other beyond two joints; the feet decide the friction of their own contacts."""
    solid = [body for body in mj.bodies if any(geom.contype for geom in body.geoms)]
    tree = JointTree(parse(light_urdf(spec)))
    for first, second in combinations([body.name for body in solid], 2):
        if tree.joints_between(first, second) <= NEIGHBOUR_JOINTS:
            mj.add_exclude(bodyname1=first, bodyname2=second)
    for foot in spec.feet:
        soles = [geom for geom in mj.body(foot.frame).geoms if geom.contype]
        _check_soles(foot, soles)
        for geom in soles:
            geom.friction[0] = friction
            geom.priority = 1


def _check_soles(foot: FootSpec, geoms: list) -> None:
    """The spec's contact points are where the URDF's spheres touch the floor.

    Raises:
        RobotSpecError: If they are not.
    """
    lowest = sorted(tuple(np.round(geom.pos - [0.0, 0.0, geom.size[0]], 9)) for geom in geoms)
    expected = sorted(tuple(np.round(point, 9)) for point in foot.contact_points)
    if not np.allclose(lowest, expected, atol=1e-6):
        raise RobotSpecError(f"foot '{foot.frame}': the spec's contact points {expected} are not the URDF's {lowest}")


def _add_sites(spec: RobotSpec, mj: mujoco.MjSpec) -> None:
    mj.body(spec.imu_frame).add_site(name=IMU_SITE)
    for sensor, kind in (
        ("imu_quat", mujoco.mjtSensor.mjSENS_FRAMEQUAT),
        ("imu_gyro", mujoco.mjtSensor.mjSENS_GYRO),
        ("imu_accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
    ):
        mj.add_sensor(name=sensor, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=IMU_SITE)
    for tool in spec.tools:
        mj.body(tool.wrist_frame).add_site(name=tool.palm_frame, pos=tool.palm_offset)
    for foot in spec.feet:
        mj.body(foot.frame).add_site(name=f"{foot.side}_sole", pos=foot.sole_center)


def _add_payload(spec: RobotSpec, mj: mujoco.MjSpec, payload_kg: tuple[float, float]) -> None:
    for tool, mass in zip(spec.tools, payload_kg, strict=True):
        _check_number(f"payload of the {tool.side} hand", mass, "kg", positive=False)
        if mass > 0.0:
            ball = mj.body(tool.palm_body).add_body(name=f"{tool.side}_payload", pos=(PAYLOAD_AHEAD, 0.0, 0.0))
            ball.mass = mass
            ball.inertia = [0.4 * mass * PAYLOAD_RADIUS**2] * 3
            ball.ipos = (0.0, 0.0, 0.0)  # unset, it would be taken from pos
            ball.explicitinertial = True


def _add_stance_key(spec: RobotSpec, mj: mujoco.MjSpec, others: list[float]) -> None:
    """The robot in its stance; ``others`` are the positions of the scene's joints, which come after the robot's."""
    stance = dict(zip(spec.joint_names, spec.stance.joint_positions, strict=True))
    x, y, z, w = spec.stance.base_quat_xyzw
    robot = [joint.name for joint in mj.joints if joint.name == BASE_JOINT or joint.name in stance]
    angles = [stance[name] for name in robot[1:]]
    mj.add_key(name=STANCE_KEY, qpos=[*spec.stance.base_position, w, x, y, z, *angles, *others])
