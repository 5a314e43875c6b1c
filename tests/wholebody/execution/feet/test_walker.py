"""Strategy: the robot walks in MuJoCo by the walker alone, for a few steps; the true one, and a realistic one.

It does not fall, its palms stay where they are told to be, it stands on both feet once it is told to stop, and the
program is solved whole at every tick. `python -m tests.studies.walks` has the long runs.
"""

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from tests.support.walks import START, rms, walk
from tests.support.wide import wide
from wholebody.backends.kinematic.controller import KinematicController
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.control.weights import RECOVERING
from wholebody.errors import InputError
from wholebody.execution.feet.walker import Walker
from wholebody.types import RobotState
from wholebody.walking.gait import Phase
from wholebody.walking.places import Velocity

STOP = START + 2.0


def told(velocity, stop=STOP):
    def tell(one, time):
        wanted = velocity if time < stop else Velocity()
        if one.guide.wanted != wanted:
            one.guide.follow(wanted)

    return tell


@pytest.mark.parametrize("velocity", [Velocity(0.3 + 0j), Velocity(0.1 + 0.1j, 0.3)])
def test_it_walks_stops_and_stands_with_its_palms_in_place(velocity):
    one = walk(told(velocity), STOP + 4.0)
    assert one.fell is None
    assert one.stands
    assert one.made >= 3
    assert one.missed == 0
    assert rms(one.errors) < 2e-3
    assert one.errors.max() < 8e-3
    assert one.errors[-1] < 1e-3
    assert abs(one.middle - one.base) < 0.02
    assert abs(one.base) > 0.15


def test_it_walks_where_the_floor_rises_to_its_side():
    """Its feet were set down level and as high as the one that stands: it fell at its third step."""
    one = walk(told(Velocity(0.3 + 0j)), STOP + 4.0, ground="3 deg aside")
    assert one.fell is None
    assert one.stands
    assert rms(one.errors) < 2e-3


def test_it_steps_up_where_it_is_told_nothing_of_a_slab():
    """A foot that met it went on down: it lifted the robot, tilted it by 8 degrees, and it fell."""
    tilts, heights = [], []

    def look(walker, plant, state):
        tilts.append(2.0 * np.arcsin(np.hypot(*state.q[3:5])))
        heights.append(plant.soles()[:, 2].min())

    one = walk(told(Velocity(0.15j), START + 4.0), START + 5.5, look=look, ground="2 cm")
    assert one.fell is None
    assert heights[-1] > 0.017, "both feet are on it"
    assert max(tilts) < np.deg2rad(5.0)
    assert rms(one.errors) < 2e-3


def test_it_steps_on_the_spot_with_its_palms_in_world():
    states = []

    def tell(one, time):
        one.marches = time < STOP

    def look(walker, plant, state):
        if not states or walker.walk.state is not states[-1]:
            states.append(walker.walk.state)

    one = walk(tell, STOP + 3.5, look=look)
    assert one.fell is None
    assert one.stands
    assert one.made >= 2
    assert abs(one.base) < 1e-6
    assert rms(one.errors) < 1e-3
    assert one.errors.max() < 3e-3
    assert states[:4] == [Phase.STAND, Phase.SHIFT, Phase.SWING, Phase.LAND]
    assert states[-2:] == [Phase.SETTLE, Phase.STAND]


@pytest.mark.parametrize("angle", [225.0, *wide(180.0, 315.0)])
def test_one_that_is_pushed_towards_a_foot_that_lands_goes_on(angle):
    """It fell: the pressure went over to that foot at the plan's pace, and the capture point was beyond it by then."""
    push = 80.0 * np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0])
    one = walk(told(Velocity(0.2 + 0j), START + 3.5), START + 6.5, pushes=[("torso_link", push, START + 2.5, 0.1)])
    assert one.fell is None
    assert one.stands


def test_a_realistic_robot_steps_by_its_estimated_state():
    def tell(one, time):
        one.marches = True

    one = walk(tell, 3.5, seed=1)
    assert one.fell is None
    assert one.made >= 3
    assert one.errors.max() < 0.015
    drift, sure = one.drift
    assert drift < 2.0 * sure < 0.02


@pytest.mark.parametrize(
    ("seed", "velocity", "ground"),
    [(14, 0.4, None), (1, 0.3, "2 cm"), *wide((9, 0.4, None), (3, 0.15j, "3 deg aside"), (2, -0.2, "2 cm"))],
)
def test_realistic_robots_walk_as_fast_as_they_may_and_on_grounds_that_nobody_tells_of(seed, velocity, ground):
    """Their knees came straight, or the ankle of the foot in the air was at its end: these fell or stepped on."""
    one = walk(told(Velocity(complex(velocity)), START + 4.0), START + 8.5, seed=seed, ground=ground)
    assert one.fell is None
    assert one.stands


def test_a_walker_that_ends_leaves_the_weights_of_standing():
    controller, fresh = (WholeBodyController(g1(), ControllerConfig()) for _ in range(2))
    q = stance_q(controller.spec, controller.robot.model)
    state = RobotState(0.0, q, np.zeros(controller.robot.nv))
    for one in (controller, fresh):
        one.reset(state)
    walker = Walker(controller)
    walker.begin(state)
    assert walker.stands
    assert not controller.balance.active
    controller.weigh(RECOVERING)
    assert controller.torso_limit.angle_max > fresh.torso_limit.angle_max
    walker.end()
    assert controller.balance.active
    assert np.array_equal(controller.tasks.com.weight, fresh.tasks.com.weight)
    assert np.array_equal(controller.tasks.posture.weight, fresh.tasks.posture.weight)
    for name in ("pelvis_limit", "torso_limit", "foot_weight"):
        assert np.array_equal(getattr(controller.compiled.tick, name), getattr(fresh.compiled.tick, name)), name
    for limit in ("pelvis_limit", "torso_limit"):
        assert getattr(controller, limit).angle_max == getattr(fresh, limit).angle_max


def test_other_backends_are_refused():
    controller = KinematicController(g1(), ControllerConfig(backend="kinematic", solver="daqp"))
    with pytest.raises(InputError, match="only the native backend walks"):
        Walker(controller)
