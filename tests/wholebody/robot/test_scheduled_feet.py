"""Strategy: a foot that is up by a schedule of phases, to both estimators and to what judges a run.

The base of a robot stands still and its right leg swings: an estimator that does not know of it takes the swinging
sole for one that stands, and moves the base; what judges a run takes the swing for a sole that slides. The leg is set
down elsewhere and stands there from then on.
"""

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio, stance_q
from wholebody.estimation.odometry import StanceOdometry
from wholebody.estimation.readings import Readings
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.robot.contact_schedule import Contacts, ContactSchedule
from wholebody.robot.feet import Feet
from wholebody.sim.limit_monitor import LimitMonitor
from wholebody.sim.plant import MujocoPlant
from wholebody.types import JointCommand

SPEC = g1()
MODEL = load_pinocchio(SPEC)
STANCE = stance_q(SPEC, MODEL)
LIFTED, SET_DOWN, DT = 1.0, 1.6, 0.002
HIP, KNEE = (MODEL.joints[MODEL.getJointId(f"right_{name}_joint")].idx_q for name in ("hip_pitch", "knee"))


def swung(time):
    """The stance with its right leg ahead, more and more from when it is lifted until it is set down."""
    q, share = STANCE.copy(), np.clip((time - LIFTED) / (SET_DOWN - LIFTED), 0.0, 1.0)
    q[HIP] -= 0.4 * share
    q[KNEE] += 0.3 * share
    return q


FEET, AHEAD = (Feet.at(SPEC, MODEL, swung(time)) for time in (0.0, SET_DOWN))
SCHEDULE = ContactSchedule(
    (Contacts(FEET), Contacts(FEET, (1.0, 0.0)), Contacts(AHEAD)), (LIFTED - 0.5 * DT, SET_DOWN - 0.5 * DT)
)
"""Contacts change half a period before the readings that see it."""


def moved(estimator):
    """How far the base went by the estimator at the end of the swing, and a second after the foot was set down [m]."""
    places, times = [], np.arange(0.0, SET_DOWN + 1.0, DT)
    for time in times:
        q = swung(time)
        dq = (swung(time + DT) - swung(time - DT))[7:] / (2.0 * DT)
        up = np.array([0.0, 0.0, 9.81])
        readings = Readings(time, np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), q[7:], dq, None, up)
        places.append(estimator.estimate(readings).q[:3])
    went = np.linalg.norm(np.array(places) - places[0], axis=1)
    return went[np.searchsorted(times, SET_DOWN - DT)], went[-1]


def put(plant, q):
    """Put a plant's robot into a configuration, at rest, and let one control period pass without torques."""
    plant.data.qpos[:3], plant.data.qpos[3:7], plant.data.qvel[:] = q[:3], q[[6, 3, 4, 5]], 0.0
    for name, angle in zip(list(MODEL.names)[2:], q[7:], strict=True):
        plant.data.qpos[plant.model.joint(name).qposadr[0]] = angle
    none = np.zeros(SPEC.n_joints)
    plant.step(JointCommand(0.0, plant.joint_positions().copy(), none, none, none, none))


@pytest.mark.parametrize("kind", [StateEstimator, StanceOdometry])
def test_the_base_stays_where_it_is_while_a_foot_that_is_known_to_be_up_swings(kind):
    told, untold = kind(SPEC), kind(SPEC)
    told.expect(SCHEDULE)
    knows, later = moved(told)
    assert knows < 1e-3
    assert later < 2e-3
    assert moved(untold)[0] > 0.05


def test_without_a_schedule_the_estimators_are_as_before():
    one, other = StateEstimator(SPEC), StateEstimator(SPEC)
    one.expect(SCHEDULE)
    one.expect(None)
    assert moved(one) == moved(other)


def test_a_foot_that_is_up_by_the_schedule_does_not_slide():
    creep = {}
    for schedule in (None, SCHEDULE):
        plant = MujocoPlant(SPEC)
        plant.reset()
        monitor = LimitMonitor(plant)
        for time in np.arange(0.0, 2.0, 0.1):
            put(plant, swung(time))
            monitor.look(time, schedule)
        creep[schedule is None] = monitor.creep
    assert creep[False] < 1e-3 < 0.05 < creep[True]


def test_pressure_on_the_inner_edge_of_the_sole_that_carries_alone_has_no_room():
    margins, roll = [], 0.02
    for schedule in (None, SCHEDULE):
        plant = MujocoPlant(SPEC)
        plant.reset()
        monitor, q = LimitMonitor(plant), swung(LIFTED + 0.4)
        q[3:7] = np.sin(0.5 * roll), 0.0, 0.0, np.cos(0.5 * roll)
        put(plant, q)
        q[2] -= plant.contact_points()[:, 2].min() + 5e-4
        put(plant, q)
        monitor.look(LIFTED + 0.4, schedule)
        margins.append(monitor.margin)
    both, alone = margins
    assert alone < 1e-3 < 0.03 < both


def test_one_entry_for_ever_is_as_no_schedule():
    plant, found = MujocoPlant(SPEC), []
    for schedule in (None, ContactSchedule.standing(FEET)):
        plant.reset()
        monitor = LimitMonitor(plant)
        q = STANCE.copy()
        q[0] += 0.01
        put(plant, q)
        monitor.look(0.1, schedule)
        found.append((monitor.creep, monitor.margin))
    assert found[0] == found[1]
    assert found[0][0] == pytest.approx(0.01, abs=1e-3)
