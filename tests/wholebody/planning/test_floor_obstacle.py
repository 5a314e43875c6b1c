"""Strategy: whole episodes in MuJoCo, hands sent at the floor and through it, fast, fingers first; what touches counts.

The targets go past `planning.floor_projection`, which would lift them: plan and program alone keep the hands off.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from policy.geometry.rotations import rotvec_to_matrix
from policy.scripted.library import reach
from tests.support.wide import wide
from wholebody.episode.run import observe
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.fall import detect_fall
from wholebody.sim.plant import MujocoPlant


@pytest.fixture(scope="module")
def robot():
    spec = g1()
    return Supervisor(spec), MujocoPlant(spec)


START = 4.0
"""When the hands, low by then, begin to go down [s]."""


def sent_down(chunk, height, pitch, seconds):
    """The chunk with both hands turned and brought down to a height within some time from `START` on."""
    share = np.clip((chunk.times - START) / seconds, 0.0, 1.0)
    turn, hands = rotvec_to_matrix(np.outer(share, [0.0, pitch, 0.0])), []
    for T in (chunk.T_world_lhand, chunk.T_world_rhand):
        T = T.copy()  # noqa: PLW2901
        T[:, :3, :3] = turn @ T[:, :3, :3]
        T[:, 2, 3] += share * (height - T[:, 2, 3])
        hands.append(T)
    return replace(chunk, T_world_lhand=hands[0], T_world_rhand=hands[1])


@pytest.mark.parametrize(("height", "pitch", "seconds"), [*wide((0.12, 1.5, 0.4)), (0.1, 1.2, 0.25)])
def test_hands_sent_into_the_floor_never_touch_it(robot, monkeypatch, height, pitch, seconds):
    supervisor, plant = robot
    monkeypatch.setattr("wholebody.planning.preparation.above_floor", lambda chunk, rise: (chunk, 0.0))
    state, policy, least = plant.reset(), reach(0.40, 0.30), np.inf
    supervisor.reset(state)
    policy.reset()
    underside, data = supervisor.controller.floor.underside, supervisor.robot.model.createData()
    for seq in range(9):
        chunk = policy.infer(observe(plant.spec, supervisor, state))
        supervisor.accept(replace(sent_down(chunk, height, pitch, seconds), seq=seq))
        for tick in range(400):
            state = plant.step(supervisor.step(state))
            fall = detect_fall(plant, state, supervisor.status.status)
            assert fall is None, f"{fall.time:.2f} s: {fall.cause}"
            if tick % 10 == 0:
                pin.forwardKinematics(supervisor.robot.model, data, state.q)
                least = min(least, underside.lowest(data)[:, 2].min())
    assert 0.012 < least < 0.05
