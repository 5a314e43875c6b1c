"""Strategy: joints that move at random, motors made of the equations of a model beside the observer's own; then what is
no evidence. In the loop it is tested with the watch, `tests/wholebody/control/test_motor_watch.py`.
"""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from models import g1
from wholebody.estimation import motor_response
from wholebody.estimation.kernels import motor_response as kernel
from wholebody.estimation.motor_response import MotorObserver, MotorResponse
from wholebody.robot.second_order import second_order_step
from wholebody.robot.state import Robot
from wholebody.types import JointCommand, RobotState

SPEC, DT = g1(), 0.002
ROBOT = Robot(SPEC)
TO_PIN = ROBOT.motor_to_pin


def observer():
    return MotorObserver([SPEC.joints[motor].group for motor in TO_PIN], ROBOT.pin_to_motor, DT)


class Shaken:
    """A robot whose joints and commands wander; its motors answer as a `MotorResponse` says, and deliver a share."""

    def __init__(self, response, *, share=1.0, noise=0.0, seed=0):
        self.rng, self.noise, self.share, self.response = np.random.default_rng(seed), noise, share, response
        self.sent, n = deque(maxlen=round(response.delay / DT) + 1), SPEC.n_joints
        self.q, self.v, self.filter, self.time = np.zeros(n), np.zeros(n), np.zeros((2, n)), 0.0
        self.tau = np.zeros(n)

    def state(self):
        q, v = np.zeros(7 + len(self.q)), np.zeros(6 + len(self.v))
        q[6], q[7:], v[6:] = 1.0, self.q[TO_PIN], self.v[TO_PIN]
        return RobotState(self.time, q, v, self.tau[TO_PIN])

    def step(self, gains=(SPEC.kp, SPEC.kd)):
        n, rng, r = len(self.q), self.rng, self.response
        command = JointCommand(self.time, *(0.01 * rng.standard_normal((2, n))), rng.standard_normal(n), *gains)
        self.sent.append(command)
        c = self.sent[0]
        asked = c.tau + c.kp * (c.q - self.q) + c.kd * (c.dq - self.v)
        asked += self.noise * rng.standard_normal(n)
        if r.bandwidth > 0.0:
            A, b = second_order_step(2.0 * np.pi * r.bandwidth, motor_response.DAMPING_RATIO, DT)
            self.filter = A @ self.filter + b[:, None] * asked
            asked = self.filter[0].copy()
        elif r.lag > 0.0:
            self.filter[0] += (1.0 - np.exp(-DT / r.lag)) * (asked - self.filter[0])
            asked = self.filter[0].copy()
        self.tau, self.time = self.share * asked, self.time + DT
        self.v = 0.9 * self.v + 0.02 * rng.standard_normal(n)
        self.q = self.q + DT * self.v
        return command


def run(seen, robot, ticks=150, late=0, gains=None):
    """What is believed after so many ticks, and after how many it changed last; states come so many ticks late."""
    states, changed = deque(maxlen=late + 1), 0
    for tick in range(ticks):
        states.append(robot.state())
        if seen.look(states[0], robot.time):
            changed = tick
        seen.sent(robot.step() if gains is None else robot.step(gains))
    return seen.response, changed


@pytest.mark.parametrize(
    "response",
    [
        MotorResponse(),
        MotorResponse(bandwidth=25.0),
        MotorResponse(bandwidth=60.0, delay=0.004),
        MotorResponse(lag=0.01, delay=0.02),
        MotorResponse(delay=0.03),
    ],
)
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_it_finds_how_the_motors_answer_within_a_fifth_of_a_second(response, noise):
    found, changed = run(observer(), Shaken(response, noise=noise))
    assert (found.bandwidth, found.lag) == (response.bandwidth, response.lag)
    assert found.delay == pytest.approx(response.delay)
    assert changed <= 100


def test_a_share_of_the_torque_and_a_late_state_change_nothing():
    response = MotorResponse(bandwidth=25.0, delay=0.006)
    found, _ = run(observer(), Shaken(response, share=0.5), late=5)
    assert (found.bandwidth, round(found.delay, 6)) == (25.0, 0.006)


def test_motors_between_two_models_are_taken_for_one_of_them():
    found, _ = run(observer(), Shaken(MotorResponse(bandwidth=22.0)), ticks=300)
    assert found.bandwidth in (20.0, 25.0)


def test_other_gains_begin_anew_and_find_the_same():
    seen, robot = observer(), Shaken(MotorResponse(delay=0.02))
    run(seen, robot)
    other = 0.5 * SPEC.kp, 0.5 * SPEC.kd
    found, changed = run(seen, robot, gains=other)
    assert found.delay == pytest.approx(0.02)
    assert changed == 0


def test_motors_that_become_quick_again_are_believed_later_than_slow_ones():
    seen = observer()
    slow = Shaken(MotorResponse(delay=0.03))
    _, first = run(seen, slow)
    slow.response = MotorResponse()
    slow.sent = deque(maxlen=1)
    found, second = run(seen, slow, ticks=400)
    assert found == MotorResponse()
    assert first < second


def test_without_torques_or_with_senseless_ones_nothing_is_learned():
    for tau in (None, np.full(SPEC.n_joints, np.nan), np.zeros(3)):
        seen, robot = observer(), Shaken(MotorResponse(delay=0.03))
        for _ in range(150):
            assert not seen.look(replace(robot.state(), tau=tau), robot.time)
            seen.sent(robot.step())
        assert seen.response == MotorResponse()


def test_a_robot_at_rest_says_nothing():
    seen, state = observer(), Shaken(MotorResponse()).state()
    zero = np.zeros(SPEC.n_joints)
    for tick in range(200):
        assert not seen.look(replace(state, time=DT * tick), DT * tick)
        seen.sent(JointCommand(DT * tick, zero, zero, zero, SPEC.kp, SPEC.kd))


def test_missed_states_do_not_mislead():
    seen, robot = observer(), Shaken(MotorResponse(delay=0.01))
    for tick in range(600):
        if tick % 60 != 30:
            seen.look(robot.state(), robot.time)
        seen.sent(robot.step())
    assert seen.response.delay == pytest.approx(0.01)


def test_compiled_and_interpreted_arithmetic_are_the_same():
    compiled, interpreted = observer(), observer()
    interpreted._sent, interpreted._told, interpreted._likeliest = kernel.sent, kernel.told, kernel.likeliest
    for seen in (compiled, interpreted):
        run(seen, Shaken(MotorResponse(bandwidth=40.0)), ticks=40)
        seen._likeliest(seen._memory, motor_response.UNEXPLAINED_MIN, motor_response.ENERGY_MIN)
    a, b = compiled._memory, interpreted._memory
    assert np.array_equal(a.best, b.best)
    np.testing.assert_allclose(a.xx, b.xx, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(a.score, b.score, rtol=1e-6)
