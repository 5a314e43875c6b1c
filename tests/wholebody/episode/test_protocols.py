"""Strategy: an episode is run through proxies that have the names of the protocols `Plant` and `ChunkExecutor` and no
others; it must go as without them, so the protocols are all that an episode needs.
"""

import pytest

from models import g1
from policy.scripted.library import scripted_policy
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.as_given import AsGiven
from wholebody.execution.chunk_executor import ChunkExecutor
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.plant import Plant
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.recorder import Recorder

SPEC = g1()
SHORT = EpisodeConfig(settle=0.2, hold=0.2)


class Only:
    """What a protocol names of an object, and nothing else."""

    def __init__(self, protocol, made):
        self._names, self._made = protocol.__protocol_attrs__, made

    def __getattr__(self, name):
        if name not in self._names:
            raise AttributeError(f"'{name}' is not in the protocol")
        return getattr(self._made, name)


@pytest.mark.parametrize("follower", [Supervisor, AsGiven])
def test_an_episode_needs_no_more_than_the_protocols_say(follower):
    supervisor, plant = follower(SPEC), MujocoPlant(SPEC)
    results = []
    for pair in ((supervisor, plant), (Only(ChunkExecutor, supervisor), Only(Plant, plant))):
        recorder = Recorder(SPEC)
        policy = scripted_policy("wave")
        result = run_episode(policy, *pair, duration=0.6, config=SHORT, recorder=recorder)
        results.append((result.palms.errors.tolist(), result.seconds, recorder.record()["q"].tolist()))
    assert results[0] == results[1]
    assert results[0][0]


def test_what_exists_has_all_that_the_protocols_say():
    plant = MujocoPlant(SPEC)
    assert isinstance(plant, Plant)
    for supervisor in (Supervisor(SPEC), AsGiven(SPEC)):
        supervisor.reset(plant.reset())
        assert isinstance(supervisor, ChunkExecutor)
