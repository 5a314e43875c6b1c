"""Strategy: palms near and far, and the robot put where it is told to stand: forward kinematics judges.

What is in reach costs no step; what is not is reached from elsewhere, turned if the palms are behind; a start that is
moved and turned with everything else gives the same answer there. Palms that no place reaches are said not to be.
"""

import numpy as np
import pinocchio as pin
import pytest

import wholebody
from models import g1
from models.pinocchio_model import frame_id, load_pinocchio
from wholebody.errors import InputError
from wholebody.planning.reachability.standing_place import StandingPlace, stand_for

SPEC = g1()


def wrists(x, z, y=0.16, heading=0.0, at=(0.0, 0.0)):
    """Wrists whose palm points are ahead of a place by x, fingers ahead."""
    c, s = np.cos(heading), np.sin(heading)
    R, poses = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), []
    for tool, side in zip(SPEC.tools, (y, -y), strict=True):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, R @ (np.array([x, side, z]) - tool.palm_offset) + [*at, 0.0]
        poses.append(T)
    return poses


def off(place, poses):
    """Distance of the wrists from their poses, the robot put there [m]."""
    model = load_pinocchio(SPEC)
    data = model.createData()
    pin.framesForwardKinematics(model, data, place.posture.q)
    x, y, heading = place.base
    T = pin.SE3(pin.exp3(np.array([0.0, 0.0, heading])), np.array([x, y, 0.0]))
    found = [(T * data.oMf[frame_id(model, tool.wrist_frame)]).translation for tool in SPEC.tools]
    return max(np.linalg.norm(p - pose[:3, 3]) for p, pose in zip(found, poses, strict=True))


def test_what_is_in_reach_costs_no_step():
    poses = wrists(0.3, 0.9)
    place = stand_for(*poses)
    assert isinstance(place, StandingPlace)
    assert place.reached
    assert (place.base, place.steps) == ((0.0, 0.0, 0.0), 0)
    assert off(place, poses) < 1e-3
    assert "from where it stands" in str(place)


@pytest.mark.parametrize(("x", "z"), [(0.8, 0.8), (0.8, 0.5), (1.5, 1.1), (-0.8, 0.9)])
def test_palms_out_of_reach_are_reached_from_elsewhere(x, z):
    poses = wrists(x, z)
    assert not wholebody.solve(*poses).reached
    place = stand_for(*poses)
    assert place.reached
    assert place.steps > 0
    assert off(place, poses) < 1e-3
    assert np.hypot(*place.base[:2]) < abs(x) + 0.2
    assert f"with {place.steps} steps" in str(place)


def test_a_start_elsewhere_gives_the_same_place_there():
    start, poses = np.array([2.0, -1.0, 0.5]), wrists(0.3, 0.9, heading=0.5, at=(2.0, -1.0))
    place = stand_for(*poses, start)
    assert place.reached
    assert place.base == tuple(start)


def test_palms_that_no_place_reaches_are_said_not_to_be():
    poses = wrists(0.5, 2.4)
    place = stand_for(*poses)
    assert not place.reached
    assert max(place.posture.position_error) > 0.1
    assert place.posture.reasons


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((np.eye(3), np.eye(4)), "shape"),
        ((np.eye(4), np.full((4, 4), np.nan)), "finite"),
        ((np.eye(4), np.eye(4), (0.0, 1.0)), "heading"),
        ((np.eye(4), np.eye(4), (0.0, 1.0, np.inf)), "heading"),
    ],
)
def test_nonsense_is_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        stand_for(*arguments)
