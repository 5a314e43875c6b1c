"""Strategy: what bounds a plan on a slope, against sums of forces that the soles there can give."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from tests.support.grounds import feet_on
from wholebody.config import ControllerConfig, TrajectoryConfig
from wholebody.contacts.friction import pyramid_slope
from wholebody.errors import InputError
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.robot.contact_schedule import Contacts, ContactSchedule
from wholebody.robot.state import Robot
from wholebody.trajopt.robot_tables import RobotTables

SPEC, FRICTION = g1(), ControllerConfig.friction
SLOPE = np.deg2rad(8.0)
FULL = TrajectoryConfig(friction_share=1.0)


@pytest.fixture
def body():
    return RobotTables(SPEC, FULL, FRICTION)


def test_standing_on_the_stances_own_feet_changes_no_bit(body):
    before, shapes = body.tables, body.shapes
    body.stand_on(ContactSchedule.standing(body.footing.feet))
    for name in before._fields:
        assert np.array_equal(getattr(before, name), getattr(body.tables, name)), name
    assert np.array_equal(shapes.floor, body.shapes.floor)


def test_what_was_carried_before_does_not_tell_where_feet_stand(body):
    feet, other = feet_on(SPEC, body.full, pin.exp3(np.array([0.05, 0.0, 0.0]))), RobotTables(SPEC, FULL, FRICTION)
    body.carry((1.5, 0.0))
    for one in (body, other):
        one.stand_on(ContactSchedule.standing(feet))
        one.carry((0.0, 0.0))
    for name in other.tables._fields:
        assert np.array_equal(getattr(other.tables, name), getattr(body.tables, name)), name


def test_a_plan_on_feet_that_step_is_refused_and_what_was_stood_on_stays(body):
    both = Contacts(body.footing.feet)
    stepping = ContactSchedule((both, Contacts(both.feet, (1.0, 0.0)), both), (0.5, 1.0))
    planner = ChunkPlanner(SPEC, Robot(SPEC), ControllerConfig())
    before = planner.optimizer.body.footing
    for one in (body, planner, planner.optimizer):
        with pytest.raises(InputError, match="both must stand from its beginning to its end"):
            one.stand_on(stepping)
    assert planner.optimizer.body.footing is before


@pytest.mark.parametrize("direction", [0.0, 2.0])
def test_the_cone_of_friction_on_a_slope_is_within_what_the_soles_give_there(body, direction):
    uphill = pin.exp3(SLOPE * np.array([np.sin(direction), -np.cos(direction), 0.0]))
    body.stand_on(ContactSchedule.standing(feet_on(SPEC, body.full, uphill)))
    cone, rng = body.tables.cone, np.random.default_rng(0)
    # The wrench of a force down the slope through its point over the origin, in the rows that the cone is of.
    for size, inside in ((0.95, True), (1.05, False)):
        down = uphill @ np.array([-size * pyramid_slope(FRICTION), 0.0, 1.0])
        wrench = np.array([0.0, 0.0, down[2], down[0], down[1], 0.0])
        assert ((cone @ wrench).max() <= 0.0) == inside
    assert body.footing.floor.slope == pytest.approx(SLOPE, abs=1e-6)
    points, forces = body.footing.forces(FRICTION, body.foot_load_min)
    assert np.allclose(points @ uphill[:, 2], 0.0, atol=1e-6)
    for _ in range(200):
        shares = rng.dirichlet(np.full(len(forces), 0.2))
        f = shares @ forces
        along = uphill.T @ f
        assert np.abs(along[:2]).max() <= pyramid_slope(FRICTION) * along[2] + 1e-9
