"""Strategy: a capture point is put somewhere by hand, and followed for a while."""

from types import SimpleNamespace

import numpy as np
import pytest

from wholebody.control.reference_packet import COM
from wholebody.execution.feet.loss import AGAIN, FINAL, FINAL_STEPS, LONG, LOST, NEARLY, Loss

EDGE = 0.085


@pytest.fixture
def robot():
    return SimpleNamespace(com=np.array([0.0, 0.0, 0.66]), com_velocity=np.zeros(3))


@pytest.fixture
def loss(robot):
    return Loss(SimpleNamespace(robot=robot, support=SimpleNamespace(margin=lambda point: EDGE - abs(point[0]))))


def test_beyond_the_edge_it_is_lost_at_once(robot, loss):
    robot.com[0] = EDGE + LOST + 1e-3
    assert loss.look(complex(EDGE), 0.0)


def test_near_the_edge_it_is_lost_after_a_while_unless_that_is_planned(robot, loss):
    robot.com[0] = EDGE - 0.5 * NEARLY
    assert not loss.look(complex(0.0), 1.0)
    assert not loss.look(complex(0.0), 1.0 + 0.9 * LONG)
    assert loss.look(complex(0.0), 1.01 + LONG)
    assert not loss.look(complex(EDGE - NEARLY), 2.0)
    assert not loss.look(complex(EDGE - NEARLY), 3.0)


def test_what_has_come_back_begins_anew(robot, loss):
    robot.com[0] = EDGE - 0.5 * NEARLY
    loss.look(complex(0.0), 1.0)
    robot.com[0] = 0.0
    loss.look(complex(0.0), 1.1)
    robot.com[0] = EDGE - 0.5 * NEARLY
    assert not loss.look(complex(0.0), 1.3)
    loss.forget()
    assert not loss.look(complex(0.0), 1.6)


def test_what_was_caught_just_now_is_caught_again_soon(robot, loss):
    robot.com[0] = EDGE - 0.5 * NEARLY
    assert not loss.look(None, 1.0)
    assert loss.look(None, 1.01 + AGAIN)


def test_the_capture_point_of_a_reference_is_ahead_of_a_centre_of_mass_that_moves(loss):
    row = np.zeros(COM + 9)
    row[COM], row[COM + 4] = 0.1, 0.2
    assert loss.planned(row) == pytest.approx(0.1 + 0.2j / np.sqrt(9.81 / 0.66), rel=1e-3)


def test_a_robot_that_takes_no_step_is_given_up_beyond_its_soles(robot, loss):
    robot.com[0] = EDGE + 0.9 * FINAL
    assert not loss.is_final(None)
    robot.com[0] = EDGE + 1.1 * FINAL
    assert loss.is_final(None)


def test_one_that_takes_a_step_is_given_up_beyond_where_that_lands(robot, loss):
    corners = np.array([(-EDGE, -0.1), (0.4, -0.1), (0.4, 0.1), (-EDGE, 0.1)])
    walker = SimpleNamespace(outline=lambda: corners)
    robot.com[0] = 0.4 + 0.9 * FINAL_STEPS
    assert not loss.is_final(walker)
    robot.com[0] = 0.4 + 1.1 * FINAL_STEPS
    assert loss.is_final(walker)
