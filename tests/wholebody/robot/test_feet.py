"""Strategy: the stance put on feet that stand elsewhere, against where its soles then are."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio, stance_q
from tests.support.grounds import feet_on
from wholebody.robot.feet import Feet

SPEC = g1()
MODEL = load_pinocchio(SPEC)
STANCE = stance_q(SPEC, MODEL)
UPHILL = pin.exp3(np.array([0.0, -np.deg2rad(5.0), 0.0]))
GROUNDS = {
    "uphill": feet_on(SPEC, MODEL, UPHILL),
    "across": feet_on(SPEC, MODEL, pin.exp3(np.array([np.deg2rad(5.0), 0.0, 0.0]))),
    "one foot higher": feet_on(SPEC, MODEL, np.eye(3), step=0.01),
    "turned out": feet_on(SPEC, MODEL, np.eye(3), turn=0.1),
}


def test_the_stance_on_its_own_feet_is_itself():
    assert np.array_equal(Feet.at(SPEC, MODEL, STANCE).stance(SPEC, MODEL), STANCE)


@pytest.mark.parametrize("name", GROUNDS)
def test_the_stance_on_other_feet_has_its_soles_there_and_the_pelvis_upright_over_them(name):
    feet = GROUNDS[name]
    q = feet.stance(SPEC, MODEL)
    assert not Feet.at(SPEC, MODEL, q).differ(feet, 1e-8, 1e-8)
    assert np.allclose(q[3:7], STANCE[3:7], atol=1e-3)
    assert np.allclose(pin.centerOfMass(MODEL, MODEL.createData(), q)[:2], 0.0, atol=0.005)


def test_the_stance_goes_where_the_feet_go():
    there = pin.SE3(pin.exp3(np.array([0.0, 0.0, 1.0])), np.array([3.0, -2.0, 0.5]))
    poses = [there * T for T in Feet.at(SPEC, MODEL, STANCE).poses]
    q = Feet(np.array([T.rotation for T in poses]), np.array([T.translation for T in poses])).stance(SPEC, MODEL)
    assert np.allclose(q[:7], pin.SE3ToXYZQUAT(there * pin.XYZQUATToSE3(STANCE[:7])), atol=1e-7)
    assert np.allclose(q[7:], STANCE[7:], atol=1e-7)


def test_a_robot_that_leans_as_a_whole_stands_on_a_slope_of_that_angle():
    q, turn = STANCE.copy(), pin.exp3(np.array([0.0, np.deg2rad(5.0), 0.0])) @ pin.exp3(np.array([0.0, 0.0, 0.3]))
    q[3:7] = pin.Quaternion(turn).coeffs()
    np.testing.assert_allclose(Feet.at(SPEC, MODEL, q).floor(SPEC).normal, turn[:, 2], atol=1e-6)


def test_a_floor_is_as_steep_and_as_high_as_the_soles_say():
    floor = GROUNDS["uphill"].floor(SPEC)
    assert floor.slope == pytest.approx(np.deg2rad(5.0), abs=1e-6)
    assert float(floor.height(np.array([0.3, 0.1]))) == pytest.approx(0.3 * np.tan(np.deg2rad(5.0)), abs=1e-6)
    assert floor.rise == pytest.approx(0.6 * np.tan(np.deg2rad(5.0)), abs=1e-6)
    level = Feet.at(SPEC, MODEL, STANCE).floor(SPEC)
    assert (level.slope, level.rise) == (0.0, 0.0)
