"""Strategy: dynamics with loads changed at run time against Pinocchio's model that has them appended, and MuJoCo's."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.conversion import Conversion
from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio, stance_q
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.robot.body_table import body_table
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.hand_loads import HandLoads, Loads
from wholebody.robot.state import Robot
from wholebody.trajopt.robot_tables import RobotTables
from wholebody.types import RobotState

SPEC = g1()
LOADS = (1.3, 0.4)
TOLERANCE = 1e-10


def states(model, count=50):
    rng = np.random.default_rng(0)
    for _ in range(count):
        q = pin.randomConfiguration(model, np.full(model.nq, -2.0), np.full(model.nq, 2.0))
        q[7:] = rng.uniform(-1.5, 1.5, model.nv - 6)
        yield q, rng.uniform(-5.0, 5.0, model.nv)


def difference(found, expected):
    return np.max(np.abs(found - expected) / np.maximum(1.0, np.abs(expected)))


def test_a_robot_with_loads_is_the_one_that_has_them_appended():
    robot, appended = Robot(SPEC), load_pinocchio(SPEC, payload_kg=LOADS)
    robot.loads.carry((4.0, 0.1))
    robot.loads.carry(LOADS)
    assert robot.mass == pytest.approx(pin.computeTotalMass(appended), abs=1e-12)
    data = appended.createData()
    for q, v in states(appended):
        robot.update(q, v)
        M = pin.crba(appended, data, q)
        assert difference(robot.M, np.triu(M) + np.triu(M, 1).T) < TOLERANCE
        assert difference(robot.nle, pin.nonLinearEffects(appended, data, q, v)) < TOLERANCE
        assert difference(robot.com, pin.centerOfMass(appended, data, q)) < TOLERANCE


def test_loads_that_are_gone_leave_the_robot_as_it_was():
    model, before = load_pinocchio(SPEC), load_pinocchio(SPEC)
    (table, _), (bare, _) = body_table(model), body_table(before)
    loads = HandLoads(SPEC, model)
    loads.carry(LOADS, table)
    assert not np.array_equal(table, bare)
    loads.carry((0.0, 0.0), table)
    np.testing.assert_array_equal(table, bare)
    assert pin.computeTotalMass(model) == pin.computeTotalMass(before) == loads.total


def test_the_compiled_tick_has_the_dynamics_with_loads_and_its_torques_are_mujocos():
    controller, appended = WholeBodyController(SPEC), load_pinocchio(SPEC, payload_kg=LOADS)
    mj = load_mujoco(SPEC, payload_kg=LOADS)
    mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    mj_data, data = mujoco.MjData(mj), appended.createData()
    convert, q0 = Conversion(SPEC, appended, mj), stance_q(SPEC, appended)
    controller.carry(LOADS)
    controller.reset(RobotState(0.0, q0, np.zeros(appended.nv)))
    rng, compiled = np.random.default_rng(1), controller.compiled
    for _ in range(20):
        q, v = pin.integrate(appended, q0, rng.uniform(-0.1, 0.1, appended.nv)), rng.uniform(-1.0, 1.0, appended.nv)
        compiled.compute(q, v)
        M = pin.crba(appended, data, q)
        assert difference(compiled.tick.M, np.triu(M) + np.triu(M, 1).T) < TOLERANCE
        assert difference(compiled.tick.nle, pin.nonLinearEffects(appended, data, q, v)) < TOLERANCE
        a = rng.uniform(-20.0, 20.0, appended.nv)
        convert.to_mujoco(q, v, mj_data.qpos, mj_data.qvel)
        mujoco.mj_forward(mj, mj_data)
        convert.acceleration_to_mujoco(q, v, a, mj_data.qacc)
        mujoco.mj_inverse(mj, mj_data)
        theirs = convert.force_to_pinocchio(q, mj_data.qfrc_inverse)
        assert difference((compiled.tick.M @ a + compiled.tick.nle)[6:], theirs[6:]) < TOLERANCE


def test_the_plans_robot_with_loads_is_pinocchios():
    config, full = ControllerConfig(), load_pinocchio(SPEC, payload_kg=LOADS)
    body = RobotTables(SPEC, config.planner.posture)
    body.carry(LOADS)
    locked = [i for i, name in enumerate(full.names) if "_hand_" in name]
    reduced = pin.buildReducedModel(full, locked, stance_q(SPEC, full))
    assert body.mass == body.tables.mass == pytest.approx(pin.computeTotalMass(full), abs=1e-12)
    table, _ = body_table(reduced)
    assert difference(body.tables.bodies[: len(table)], table) < TOLERANCE
    data, other = reduced.createData(), body.model.createData()
    for q, _ in states(reduced, 10):
        ours, theirs = (pin.computeGeneralizedGravity(m, d, q) for m, d in ((body.model, other), (reduced, data)))
        assert difference(ours, theirs) < TOLERANCE


def test_what_one_plans_with_is_made_once_and_another_one_carries_and_stands_independently():
    c = ControllerConfig()
    one, other = (RobotTables.of(SPEC, c.planner.posture, c.friction, c.force_min) for _ in range(2))
    bare, feet = RobotTables(SPEC, c.planner.posture, c.friction, c.force_min), one.footing.feet
    one.carry(LOADS)
    one.stand_on(ContactSchedule.standing(replace(feet, p=feet.p + 0.01)))
    one.proximity.measure(one.q_full, np.arange(3))
    one.proximity.distance[:] = 0.0
    assert one.shapes.vertices is other.shapes.vertices
    assert other.mass == other.tables.mass == bare.mass
    for name, theirs in bare.tables._asdict().items():
        assert np.array_equal(getattr(other.tables, name), theirs), name
    assert np.array_equal(other.shapes.floor, bare.shapes.floor)
    assert np.array_equal(other.proximity.distance, bare.proximity.distance)
    for ours, theirs in zip(other.model.inertias, bare.model.inertias, strict=True):
        assert ours.isApprox(theirs, 0.0)


def test_plans_keep_room_for_the_reserve_and_differ_by_masses_alone():
    loads = Loads((1.0, 0.0), (0.25, 0.25))
    assert loads.most == (1.25, 0.25)
    assert loads.beyond(Loads((0.5, 0.2))) == 0.5
    assert loads.beyond(Loads((1.0, 0.2))) == 0.0
