"""Does the fast verdict say what a simulation says? One chunk a case, begun in the stance, judged both ways.

``python tests/support/verdict_agreement.py FIRST LAST [MOTIONS] [--load KG]`` prints a line for each of the cases FIRST
to LAST - 1, and the table of both answers. Cases go round: a hostile chunk of each family, hands sent to random places
at random speeds, and, where MOTIONS names a folder of recorded motions (.csv), a chunk of one of them. With ``--load``
both hands carry a mass that both ways are told of.
"""

import argparse
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from time import thread_time

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from policy.action_spec.builtin import builtin
from policy.chunk import ActionChunk
from policy.geometry.rotations import rotvec_to_matrix
from policy.recorded.replay import ReplayPolicy, open_recording
from policy.scripted.policy import minimum_jerk, palm_offset, stance_pose
from tests.support.hostile_chunks import FAMILIES, FPS, STEPS, hostile_chunk
from wholebody.config import ControllerConfig, LoadConfig
from wholebody.episode.run import EpisodeConfig
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker

HOSTILE = [kind for kind in FAMILIES if kind != "nan"]
ANSWERS = ("feasible", "feasible_after_repair", "infeasible")


def sent(rng):
    """Both hands go from the stance to random places ahead, turned at random, within a random time."""
    stance, T = stance_pose(), []
    time = rng.uniform(0.5, 1.5)
    share = minimum_jerk(np.arange(STEPS) / FPS / time)[:, None]
    free = rng.random() < 0.5
    for side, p, R in (
        ("left", stance.p_world_lpalm, stance.R_world_lhand),
        ("right", stance.p_world_rpalm, stance.R_world_rhand),
    ):
        sign = 1.0 if side == "left" else -1.0
        goal = np.array([rng.uniform(0.15, 0.6), sign * rng.uniform(0.0, 0.45), rng.uniform(0.3, 1.4)])
        turn = rng.normal(size=3) * (0.2 if free else 0.6)
        poses = np.tile(np.eye(4), (STEPS, 1, 1))
        poses[:, :3, :3] = rotvec_to_matrix(share * turn) @ R
        poses[:, :3, 3] = p + share * (goal - p) - poses[:, :3, :3] @ palm_offset(side)
        T.append(poses)
    fingers = [np.tile(q, (STEPS, 1)) for q in (stance.q_lhand, stance.q_rhand)]
    return ActionChunk(builtin("wbc32").id, 0, 0.0, FPS, *T, *fingers)


def recorded(rng, folder):
    """A chunk from anywhere in a recorded motion."""
    episode = open_recording(rng.choice(sorted(map(str, Path(folder).glob("*.csv"))))).episode
    first = int(rng.integers(0, len(episode) - STEPS))
    window = {name: value[first : first + STEPS] for name, value in episode.arrays().items()}
    return replace(episode, t_obs=0.0, seq=0, **window)


def case(number, folder):
    """Kind and chunk of a case."""
    rng = np.random.default_rng(number)
    if number % 3 == 0:
        kind = HOSTILE[(number // 3) % len(HOSTILE)]
        return kind, replace(hostile_chunk(kind, rng, 0, 0.0), spec_id=builtin("wbc32").id)
    return ("recorded", recorded(rng, folder)) if number % 3 == 1 and folder else ("sent", sent(rng))


def main(first, last, folder, load):
    told = ControllerConfig(loads=LoadConfig(source="told", left=load, right=load)) if load else ControllerConfig()
    fast = FastChecker(told)
    checker = Checker(config=told, episode=EpisodeConfig(settle=0.1, hold=1.0), payload_kg=(load, load))
    table, times = Counter(), {"preview": [], "plan": []}
    for number in range(first, last):
        kind, chunk = case(number, folder)
        policy = ReplayPolicy(chunk)
        begin = thread_time()
        quick = fast.check(policy, kind, policy.duration, start="stance")
        times[quick.decided_by].append(thread_time() - begin)
        slow, _ = checker.check(ReplayPolicy(chunk), kind, policy.duration)
        table[quick.verdict, slow.verdict] += 1
        why = ", ".join(f"{one.code} {one.value:.3g}" for one in (quick.violations[:1] + slow.violations[:1]))
        same = "same" if quick.verdict == slow.verdict else "DIFFERS"
        print(f"{number} {kind} {quick.verdict} {slow.verdict} {same} fell {slow.fell}: {why}", flush=True)
    print(f"\n{'fast, down; simulated':26s}" + "".join(f"{answer:>24s}" for answer in ANSWERS))
    for mine in ANSWERS:
        print(f"{mine:26s}" + "".join(f"{table[mine, theirs]:24d}" for theirs in ANSWERS))
    same = sum(table[answer, answer] for answer in ANSWERS)
    chunks = sum(map(len, times.values()))
    print(f"same answer {same} of {last - first}; told by a preview {len(times['preview'])} of {chunks}")
    for name, spent in times.items():
        if spent:
            print(f"{name}: median {1e3 * np.median(spent):.1f} ms, worst {1e3 * max(spent):.1f} ms of CPU time")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", type=int, nargs=2, metavar=("FIRST", "LAST"))
    parser.add_argument("motions", nargs="?", default="")
    parser.add_argument("--load", type=float, default=0.0, metavar="KG")
    chosen = parser.parse_args()
    main(*chosen.cases, chosen.motions, chosen.load)
