"""Strategy: heights of all vertices are the truth for the lowest points, differences are it for the rows.

The closed loops drive hands down with the program alone, at a floor raised to where they reach it.
"""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import load_collision, stance_q
from tests.support.body_cases import point_acceleration, postures, upright
from wholebody.collision.floor_clearance import FloorClearance
from wholebody.config import ControllerConfig, SafetyConfig
from wholebody.control.controller import WholeBodyController
from wholebody.errors import InputError
from wholebody.limits.base import TIME_CONSTANT
from wholebody.limits.floor import FloorLimit
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant

HIGH = 10.0
"""Trigger with which every body counts [m]."""


@pytest.fixture(scope="module")
def robot():
    return Robot(g1())


@pytest.fixture(scope="module")
def geometry(robot):
    return load_collision(robot.spec, robot.model)


@pytest.fixture(scope="module")
def underside(robot, geometry):
    return FloorClearance(robot.spec, robot.model, geometry)


def heights(underside, robot, q):
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    return underside.lowest(data)[:, 2]


def test_forearms_wrists_palms_and_fingers_of_both_arms_are_watched(underside):
    assert len(underside.labels) == 24
    for side in ("left", "right"):
        for body in ("elbow_link", "wrist_yaw_link", "hand_palm_link", "hand_thumb_2_link", "hand_middle_1_link"):
            assert f"floor.{side}_{body}" in underside.labels


def test_the_lowest_points_are_those_of_coal(robot, geometry, underside):
    import coal

    floor, data = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), robot.model.createData()
    for q in postures(robot, 20):
        q[2] += 2.0
        pin.forwardKinematics(robot.model, data, q)
        for k, point in zip(underside.shapes.tolist(), underside.lowest(data), strict=True):
            item, result = geometry.geometryObjects[k], coal.DistanceResult()
            M = data.oMi[item.parentJoint] * item.placement
            here, origin = coal.Transform3s(M.rotation, M.translation), coal.Transform3s()
            found = coal.distance(item.geometry, here, floor, origin, coal.DistanceRequest(), result)
            assert point[2] == pytest.approx(found, abs=1e-6)


def test_rows_are_the_differences_of_the_heights(robot, underside):
    limit, rng, step = FloorLimit(underside, distance=0.012, trigger=HIGH, brake=10.0), np.random.default_rng(1), 1e-6
    for q in postures(robot, 40):
        v = rng.normal(0.0, 1.0, robot.nv)
        robot.update(q, v)
        rows = limit.rows(robot)
        ahead, behind = (heights(underside, robot, pin.integrate(robot.model, q, s * v)) for s in (step, -step))
        np.testing.assert_allclose(-rows.J @ v, (ahead - behind) / (2.0 * step), atol=1e-6)


def test_the_drift_is_the_acceleration_of_the_lowest_point(robot, underside):
    rng, step = np.random.default_rng(6), 1e-6
    for q in postures(robot, 10):
        v = rng.normal(0.0, 1.0, robot.nv)
        robot.update(q, v)
        # From far above, the bound is that of free fall: what is left of it is the drift.
        limit = FloorLimit(underside, distance=-1e3, trigger=2e3, brake=10.0)
        rows, points = limit.rows(robot), underside.lowest(robot.data)
        room = points[:, 2] - limit.distance
        found = rows.upper - (np.sqrt(2.0 * limit.brake * room) - rows.J @ v) / TIME_CONSTANT
        for joint, point, value in zip(underside.joints.tolist(), points, found, strict=True):
            local = robot.data.oMi[joint].actInv(point)
            assert value == pytest.approx(point_acceleration(robot, joint, local, q, v, step)[2], abs=1e-3)


def test_only_bodies_near_the_floor_have_rows_and_each_its_name(robot, underside):
    limit = FloorLimit(underside, distance=0.75, trigger=0.068, brake=10.0)
    robot.update(stance_q(robot.spec, robot.model), np.zeros(robot.nv))
    rows, z = limit.rows(robot), underside.lowest(robot.data)[:, 2]
    assert set(rows.labels) == {name for name, low in zip(underside.labels, z, strict=True) if low < 0.818}
    assert 0 < len(rows.labels) < 24
    assert (rows.upper > 0.0).all()


def test_a_shape_without_corners_is_refused_by_name(robot):
    import coal

    geometry, wrist = pin.GeometryModel(), robot.model.getJointId("left_wrist_yaw_joint")
    geometry.addGeometryObject(pin.GeometryObject("left_hand_0", wrist, pin.SE3.Identity(), coal.Sphere(0.1)))
    with pytest.raises(InputError, match="left_hand_0"):
        FloorClearance(robot.spec, robot.model, geometry)


@pytest.fixture(scope="module")
def plant(robot):
    return MujocoPlant(robot.spec)


@pytest.mark.parametrize(("drop", "seconds"), [(0.3, 0.6), (0.3, 0.1), (1.0, 0.6)])
def test_hands_driven_into_the_floor_stop_above_it(plant, drop, seconds):
    config = ControllerConfig(safety=SafetyConfig(floor_distance=0.68))
    controller = WholeBodyController(plant.spec, config)
    state = plant.reset()
    controller.reset(state)
    start = [controller.robot.pose(tool.palm_frame).copy() for tool in plant.spec.tools]
    least, fallbacks = np.inf, 0
    while state.time < 2.0:
        way = np.array([0.0, 0.0, -drop * min(state.time / seconds, 1.0)])
        poses = [pin.SE3(T.rotation, T.translation + way) for T in start]
        command, report = controller.step(state, upright(controller, poses))
        state = plant.step(command)
        fallbacks += report.level > 0
        least = min(least, float(heights(controller.floor.underside, controller.robot, state.q).min()))
    # 12 mm are kept where the floor really is.
    assert least > 0.68 - 0.010
    assert least < 0.70
    assert fallbacks == 0
    assert np.abs(state.v[6:]).max() < 0.5
