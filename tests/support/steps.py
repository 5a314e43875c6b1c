"""A supervisor that steps in MuJoCo until something is so; nobody falls on the way."""

import numpy as np

from policy.scripted.library import scripted_policy
from policy.scripted.policy import to_chunk
from wholebody.sim.fall import detect_fall


def run(supervisor, plant, until, longest, look=None):
    """Step until something is so, at most so long [s]; ``look`` is called each time."""
    while not until():
        state = plant.state()
        assert state.time < longest, f"it is {supervisor.state.value}: {supervisor.status}"
        plant.step(supervisor.step(state))
        assert detect_fall(plant, plant.state(), supervisor.status.status) is None
        if look is not None:
            look()


def is_in(supervisor, state):
    """Whether a supervisor is in a state, as a question."""
    return lambda: supervisor.state is state


def held(x, z, t_obs, seq=0):
    """A chunk whose palms are there from its first step on."""
    motion = scripted_policy("walk_reach", x=x, z=z).script(np.full(50, 100.0))
    return to_chunk(motion, "wbc32", seq, t_obs, 30.0, 50)
