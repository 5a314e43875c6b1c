"""One-step targets of a script through `TargetStream`, and how late and how far off the palms are.

``python -m tests.studies.streams targets`` prints the table.
"""

from dataclasses import dataclass

import numpy as np

from policy.errors import ChunkError
from policy.scripted.library import scripted_policy
from policy.scripted.policy import stance_pose, to_chunk
from policy.targets.stream import TargetStream
from tests.support.chunk_streams import MIRROR, Stream
from tests.support.hostile_chunks import FAMILIES, STEPS
from wholebody.episode.run import observe

SHIFTS = np.arange(0.0, 0.121, 0.004)
"""Lags that are tried [s]."""
SCORED_FROM = 0.3
"""Age of a stream from which on it is scored [s]."""
SWINGS, AMPLITUDE, HURRY = (1.0, 4.0), (0.05, 0.3), (1.0, 12.0)
"""How long hands swing between hostile targets [s], how far [m] and how fast [rad/s]."""


@dataclass
class Followed:
    """How palms followed a stream.

    Attributes:
        rms: After the best constant shift [m].
        shift: That shift [s].
        drift: Largest distance of a palm from where it was when the script came to rest [m].
        strain: Largest excess over a bound of a plan since then, in terms of its tolerance.
        fall: The fall, or None.
    """

    rms: float
    shift: float
    drift: float
    strain: float
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
    begin, times, palms, strain = loop.state.time, [], [], 0.0
    rests_from = 0.9 * seconds if rests_from is None else rests_from
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
        if supervisor.plan is not None and times[-1] >= rests_from:
            strain = max(strain, supervisor.plan.report.violation)
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
    best, last = int(np.argmin(errors)), palms[times >= rests_from]
    drift = float(np.linalg.norm(last - last[:1], axis=2).max(initial=0.0))
    return Followed(errors[best], float(SHIFTS[best]), drift, strain, loop.fall)


def led_away(supervisor, plant, seconds=2.0, speed=0.7, way=0.6):
    """Hands on a fast circle that then leave ahead and up: the fall, or None, and whether hands were fast, by tick.

    Args:
        supervisor: Plans beside the loop.
        plant: The robot.
        seconds: Time on the circle, and again after the way [s].
        speed: Of the hands [m/s].
        way: How far they go [m].
    """
    loop, stream, count, fast = Stream(supervisor, plant), TargetStream(), 0, []
    begin, pose = loop.state.time, stance_pose()
    one = to_chunk(pose, "wbc32", 0, 0.0, 30.0, 1)
    wrists = [T.reshape(4, 4) for T in (one.T_world_lhand, one.T_world_rhand)]
    while (now := loop.state.time - begin) < 2.0 * seconds + way / speed and loop.fall is None:
        if now >= count / 30.0 - 1e-9:
            angle, gone = speed / 0.1 * min(now, seconds), min(max(now - seconds, 0.0) * speed, way)
            off = np.array([0.05 + 0.7 * gone, 0.1 * np.sin(angle), 0.1 * (1.0 - np.cos(angle)) + 0.7 * gone])
            targets = [T.copy() for T in wrists]
            for T in targets:
                T[:3, 3] += off
            stream.put(loop.state.time, lhand=targets[0], rhand=targets[1])
            supervisor.accept(stream.infer(observe(plant.spec, supervisor, loop.state)), loop.state.time)
            count += 1
        loop.tick()
        fast.append(supervisor._ahead.fast)
    return loop.fall, np.array(fast)


def hostile_targets(supervisor, plant, seed, seconds=20.0, rate=30.0):
    """One-step targets of hostile families between swings that are fast: the fall, or None, and the time it was fast.

    Args:
        supervisor: Plans beside the loop.
        plant: The robot.
        seed: Of what is drawn.
        seconds: For how long.
        rate: Targets a second [Hz]; one in twenty is lost, one in twenty is not a number.
    """
    rng, loop, stream = np.random.default_rng(30_000 + seed), Stream(supervisor, plant), TargetStream()
    pose, begin, count, due, fast, turn = stance_pose(), loop.state.time, 0, 0.0, 0.0, False
    palms = np.stack([pose.p_world_lpalm, pose.p_world_rpalm])
    one = to_chunk(pose, "wbc32", 0, 0.0, rate, 1)
    wrists = [T.reshape(4, 4) for T in (one.T_world_lhand, one.T_world_rhand)]
    away = [T[:3, 3] - p for T, p in zip(wrists, palms, strict=True)]
    while loop.state.time < begin + seconds and loop.fall is None:
        now = loop.state.time - begin
        if now >= due:
            turn = not turn
            due = now + (rng.uniform(*SWINGS) if turn else rng.uniform(0.2, STEPS / rate))
            middle = rng.uniform([0.2, 0.1, 0.6], [0.4, 0.35, 1.2])
            swing = rng.uniform(*AMPLITUDE, 3), rng.uniform(*HURRY, 3), rng.uniform(0.0, 6.0, 3)
            family, since = str(rng.choice(list(FAMILIES))), now
            rows = [FAMILIES[family](rng, p) for p in palms]
        if now >= count / rate - 1e-9:
            count, k = count + 1, min(int((now - since) * rate), STEPS - 1)
            target = {}
            for i, name in enumerate(("lhand", "rhand")):
                T = wrists[i].copy()
                if turn:
                    T[:3, 3] = (middle + swing[0] * np.sin(swing[1] * now + swing[2])) * (MIRROR if i else 1.0) + away[
                        i
                    ]
                else:
                    p, R = rows[i]
                    T[:3, 3], T[:3, :3] = p[k] + away[i], (R if R.ndim == 2 else R[k]) @ T[:3, :3]
                target[name] = T
            fate = rng.uniform()
            if fate < 0.05:
                target["lhand"][0, 3] = np.nan
            try:
                if fate < 0.95:
                    stream.put(loop.state.time, **target)
            except ChunkError:
                assert fate < 0.05
            supervisor.accept(stream.infer(observe(plant.spec, supervisor, loop.state)), loop.state.time)
        loop.tick()
        fast += supervisor._ahead.fast * 0.002
    return loop.fall, fast
