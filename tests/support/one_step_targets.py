"""One-step targets of a script through `TargetStream`, and how late and how far off the palms are.

``python -m tests.studies.streams targets`` prints the table.
"""

from dataclasses import dataclass

import numpy as np

from policy.scripted.library import scripted_policy
from policy.scripted.policy import to_chunk
from policy.targets.stream import TargetStream
from tests.support.chunk_streams import Stream
from wholebody.episode.run import observe

SHIFTS = np.arange(0.0, 0.121, 0.004)
"""Lags that are tried [s]."""
SCORED_FROM = 0.3
"""Age of a stream from which on it is scored [s]."""


@dataclass
class Followed:
    """How palms followed a stream.

    Attributes:
        rms: After the best constant shift [m].
        shift: That shift [s].
        drift: Largest distance of a palm from where it was when the script came to rest [m].
        fall: The fall, or None.
    """

    rms: float
    shift: float
    drift: float
    fall: object


def follow(supervisor, plant, name, seconds, *, rate=30.0, rests_from=None, known=None):
    """Follow a script that is told one step at a time.

    Args:
        supervisor: Plans beside the loop.
        plant: The robot.
        name: Of the script.
        seconds: For how long.
        rate: Targets a second [Hz].
        rests_from: Time from which on the script rests and drift counts [s]; the last tenth if not given.
        known: Steps of the script that are told instead, from now on, as if they had been foretold without error.
    """
    script, loop, stream, count = scripted_policy(name).script, Stream(supervisor, plant), TargetStream(), 0
    begin, times, palms = loop.state.time, [], []
    while loop.state.time < begin + seconds and loop.fall is None:
        if loop.state.time >= begin + count / rate - 1e-9:
            times_told = loop.state.time - begin + np.arange(known or 1) / rate
            told = to_chunk(script(times_told), "wbc32", count, loop.state.time, rate, known or 1)
            target = {"lhand": told.T_world_lhand[0], "rhand": told.T_world_rhand[0]}
            stream.put(loop.state.time, **target, q_lhand=told.q_lhand[0], q_rhand=told.q_rhand[0])
            chunk = told if known else stream.infer(observe(plant.spec, supervisor, loop.state))
            supervisor.accept(chunk, loop.state.time)
            count += 1
        loop.tick()
        times.append(loop.state.time - begin)
        robot = supervisor.robot
        robot.update(loop.state.q, loop.state.v)
        palms.append([robot.pose(tool.palm_frame).translation.copy() for tool in plant.spec.tools])
    times, palms = np.array(times), np.array(palms)
    scored = times > SCORED_FROM
    errors = []
    for shift in SHIFTS:
        asked = script(times[scored] - shift)
        off = palms[scored] - np.stack([asked.p_world_lpalm, asked.p_world_rpalm], axis=1)
        errors.append(float(np.sqrt((off**2).sum(axis=2).mean())))
    best, last = int(np.argmin(errors)), palms[times >= (0.9 * seconds if rests_from is None else rests_from)]
    drift = float(np.linalg.norm(last - last[:1], axis=2).max(initial=0.0))
    return Followed(errors[best], float(SHIFTS[best]), drift, loop.fall)
