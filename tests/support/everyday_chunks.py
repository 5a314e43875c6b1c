"""Chunks as somebody would make them who never saw this project: everyday motions, and hands that do no such thing.

``python tests/support/everyday_chunks.py`` judges each by its plans and in a simulation, begun with the hands at its
first step, and prints where the answers differ and the table of both. Rates go from 10 to 50 Hz, lengths from 8 to 100
steps; paths are sums of few points or sines, made before anything was tried on them.
"""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode
from policy.recorded.replay import ReplayPolicy
from policy.scripted.policy import minimum_jerk
from wholebody.episode.run import EpisodeConfig
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker

LEFT, RIGHT = np.array([0.177, 0.197, 0.081]), np.array([0.177, -0.197, 0.081])
"""Wrists of the stance in the pelvis [m]."""
ANSWERS = ("feasible", "feasible_after_repair", "infeasible")


def turn(roll=0.0, pitch=0.0, yaw=0.0):
    return Rotation.from_euler("xyz", [roll, pitch, yaw], degrees=True)


def still(p, R=None):
    return lambda t: (np.asarray(p, float), R or turn())


def via(*points):
    """Rest to rest through (time, position) or (time, position, rotation)."""
    times = [point[0] for point in points]
    turns = Slerp(times, Rotation.concatenate([point[2] if len(point) > 2 else turn() for point in points]))

    def at(t):
        t = min(max(t, times[0]), times[-1])
        k = min(int(np.searchsorted(times, t, side="right")) - 1, len(points) - 2)
        share = float(minimum_jerk(np.array((t - times[k]) / (times[k + 1] - times[k]))))
        p, q = (np.asarray(point[1], float) for point in points[k : k + 2])
        return p + share * (q - p), turns(times[k] + share * (times[k + 1] - times[k]))

    return at


def by(p, x=0.0, z=0.0):
    return p + np.array([x, 0.0, z])


def circle(middle, size, rate, R=None):
    """About a middle, with sizes along the axes and angular rates [rad/s], each from 0."""
    size, rate = np.asarray(size), np.asarray(rate)
    return lambda t: (np.asarray(middle) + size * np.sin(rate * t), R(t) if R else turn())


def box(middle, half, R):
    """Both hands on the sides of a box that goes somewhere [m], turned in some way."""
    sides = [lambda t, s=s: (middle(t)[0] + R(t).apply([0.0, s * half, 0.0]), R(t)) for s in (1.0, -1.0)]
    return tuple(sides)


def flick(p, away, first, last):
    """Somewhere else between two times [s], at once."""
    return lambda t: (np.asarray(p) + np.asarray(away) * (first < t < last), turn())


def motions():
    """Name to steps, rate and both hands."""
    up, head = turn(0, -80, 0), turn(0, -120, 20)
    rest, found = (still(LEFT), still(RIGHT)), {}
    found["drawer"] = (
        40,
        10,
        rest[0],
        via((0, RIGHT), (1.2, [0.38, -0.15, 0.05]), (1.6, [0.38, -0.15, 0.05]), (3, RIGHT)),
    )
    found["wipe"] = 100, 50, rest[0], circle([0.33, -0.12, 0.0], [0.08, 0.1, 0], [3.1, 2.2, 0])
    found["box"] = (
        100,
        30,
        *box(circle([0.32, 0, 0.1], [0, 0.15, 0.1], [0, 1.2, 0.8]), 0.16, lambda t: turn(0, 0, 25 * np.sin(t))),
    )
    found["box rolled"] = 100, 30, *box(still([0.32, 0, 0.1]), 0.16, lambda t: turn(35 * np.sin(1.2 * t)))
    found["box from the floor"] = (
        100,
        20,
        *box(via((0, [0.3, 0, 0.1]), (2.5, [0.35, 0, -0.35]), (5, [0.3, 0, 0.1])), 0.17, lambda t: turn()),
    )
    found["wheel"] = 100, 30, *box(still([0.32, 0, 0.2]), 0.18, lambda t: turn(60 * np.sin(t)))
    found["stir"] = (
        60,
        30,
        rest[0],
        circle([0.3, -0.1, 0.05], [0.05, 0.05, 0], [12.6, 9.4, 0], lambda t: turn(0, 60, 0)),
    )
    found["hand over"] = (
        90,
        30,
        *(via((0, p), (1.4, [0.28, s * 0.06, 0.15], turn(0, 0, -s * 40)), (3, p)) for p, s in ((LEFT, 1), (RIGHT, -1))),
    )
    found["clap"] = 60, 30, *(circle([0.3, s * 0.1, 0.15], [0, -s * 0.08, 0], [0, 6.3, 0]) for s in (1, -1))
    found["behind"] = (
        90,
        30,
        rest[0],
        via((0, RIGHT), (2.5, [-0.2, -0.25, 0.05], turn(0, 90, 0)), (3, [-0.2, -0.25, 0.05], turn(0, 90, 0))),
    )
    found["head"] = (
        90,
        30,
        rest[0],
        via((0, RIGHT), (1.2, [0.3, -0.3, 0.4]), (2.5, [0.12, -0.18, 0.55], head), (3, [0.12, -0.18, 0.55], head)),
    )
    found["across"] = (
        90,
        30,
        rest[0],
        via((0, RIGHT), (2, [0.28, 0.12, 0.2], turn(0, 0, 50)), (3, [0.28, 0.12, 0.2], turn(0, 0, 50))),
    )
    found["both to the left"] = (
        90,
        30,
        via((0, LEFT), (2, [0.15, 0.25, 0])),
        via((0, RIGHT), (2, [0.25, 0.25, 0.2], turn(0, 0, 90))),
    )
    found["drift"] = (
        100,
        10,
        circle(LEFT, [0.2, 0, 0.15], [0.1, 0, 0.1]),
        circle(RIGHT, [0.1, 0.15, -0.1], [0.1, 0.1, 0.1]),
    )
    found["eight steps at 50 Hz"] = 8, 50, via((0, LEFT), (0.16, by(LEFT, 0.05))), rest[1]
    found["eight steps, far"] = 8, 50, via((0, LEFT), (0.1, by(LEFT, 0.25))), rest[1]
    found["eight steps at 10 Hz"] = 8, 10, via((0, LEFT), (0.7, by(LEFT, 0.07))), rest[1]
    found["waves"] = 100, 50, circle(LEFT, [0.08] * 3, [3, 2, 4]), circle(RIGHT, [0.08] * 3, [4, 2, 3])
    found["crank"] = 60, 20, rest[0], circle([0.3, -0.2, 0.12], [0.12, 0, 0.12], [2.5, 0, 2.1])
    found["pour"] = (
        90,
        30,
        rest[0],
        via((0, [0.3, -0.15, 0.2]), (1.5, [0.3, -0.15, 0.2], turn(100)), (3, [0.3, -0.15, 0.2])),
    )
    found["screw"] = 100, 30, rest[0], lambda t: (np.array([0.3, -0.15, 0.2]), turn(120 * t))
    found["hips"] = (
        60,
        30,
        via((0, LEFT), (1.8, [0, 0.25, 0.05], turn(0, 0, -80))),
        via((0, RIGHT), (1.8, [0, -0.25, 0.05], turn(0, 0, 80))),
    )
    found["chest"] = 60, 30, rest[0], via((0, RIGHT), (1.8, [0.17, -0.03, 0.25], turn(0, -20, 85)))
    found["pray"] = (
        60,
        30,
        *(via((0, p), (1.8, [0.2, s * 0.045, 0.2], turn(0, -60, -s * 20))) for p, s in ((LEFT, 1), (RIGHT, -1))),
    )
    found["knee"] = 90, 30, rest[0], via((0, RIGHT), (2.6, [0.2, -0.1, -0.3], turn(0, 60, 0)))
    found["shin"] = 100, 25, rest[0], via((0, RIGHT), (3.6, [0.3, -0.1, -0.55], turn(0, 80, 0)))
    found["floor"] = (
        100,
        20,
        *(via((0, p), (4.5, [0.35, s * 0.15, -0.62], turn(0, 60, 0))) for p, s in ((LEFT, 1), (RIGHT, -1))),
    )
    found["aside"] = 90, 30, via((0, LEFT), (2.5, [0.05, 0.6, 0.25], turn(0, 0, 90))), rest[1]
    found["far aside"] = 90, 30, via((0, LEFT), (2.5, [0, 0.8, 0.25], turn(0, 0, 90))), rest[1]
    found["overhead"] = 90, 30, *(via((0, p), (2.5, [0.2, s * 0.2, 0.65], up)) for p, s in ((LEFT, 1), (RIGHT, -1)))
    found["hammer"] = (
        60,
        30,
        rest[0],
        lambda t: (np.array([0.3, -0.18, 0.15 + 0.1 * np.cos(9.4 * t)]), turn(0, -35 * np.cos(9.4 * t))),
    )
    found["punch"] = 40, 50, rest[0], via((0, RIGHT), (0.35, [0.42, -0.1, 0.25]), (0.7, RIGHT))
    found["fast punch"] = 40, 50, rest[0], via((0, RIGHT), (0.2, [0.42, -0.1, 0.25]), (0.4, RIGHT))
    found["into the belly"] = 60, 30, rest[0], via((0, RIGHT), (1.8, [0.02, -0.1, 0.1]))
    found["one step"] = 1, 30, still([0.3, 0.2, 0.1]), still([0.3, -0.2, 0.1])
    found["far and still"] = 30, 30, still([0.45, 0.2, 0.2]), still([0.45, -0.2, 0.2])
    found["flick"] = 40, 30, rest[0], flick(RIGHT, [0, 0, 0.29], 0.01, 0.31)
    found["flick later"] = 40, 30, rest[0], flick(RIGHT, [0, 0, 0.29], 0.71, 1.01)
    found["jump"] = 40, 30, rest[0], flick(RIGHT, [0.1, 0, 0.25], 0.01, 9.0)
    found["two feet down"] = 20, 30, *(via((0, p), (0.65, by(p, z=-0.35))) for p in (LEFT, RIGHT))
    return found


def everyday_chunk(name):
    """Of a name, in wbc32."""
    steps, fps, *hands = motions()[name]
    spec, anchor = builtin("wbc32"), Anchor.nominal()
    actions = np.zeros((steps, spec.dim))
    for first, hand in zip((0, 9), hands, strict=True):
        for k in range(steps):
            p, R = hand(k / fps)
            matrix = R.as_matrix()
            actions[k, first : first + 9] = [*p, *matrix[:, 0], *matrix[:, 1]]
    actions[:, 18:25], actions[:, 25:] = anchor.q_lhand, anchor.q_rhand
    return decode(spec, actions, anchor, fps=float(fps))


def main():
    fast, checker, count = FastChecker(), Checker(), Counter()
    for name in motions():
        policy = ReplayPolicy(everyday_chunk(name))
        planned = fast.check(policy, name, policy.duration)
        checker.episode = replace(EpisodeConfig(), begin=fast.first_state(policy))
        simulated, _ = checker.check(policy, name, policy.duration)
        count[planned.verdict, simulated.verdict] += 1
        if planned.verdict != simulated.verdict or simulated.fell:
            print(f"{name}: {planned.verdict}, simulated {simulated.verdict}, fell {simulated.fell}", flush=True)
    print(f"\n{'fast, down; simulated':24s}" + "".join(f"{answer:>24s}" for answer in ANSWERS))
    for down in ANSWERS:
        print(f"{down:24s}" + "".join(f"{count[down, across]:24d}" for across in ANSWERS))
    print(f"same answer {sum(n for (a, b), n in count.items() if a == b)} of {sum(count.values())}")


if __name__ == "__main__":
    main()
