"""Hands that meet the world: who falls, how hard they push, what a task comes to.

``python -m tests.studies.touch touch --cases 40 --seed 0 --out touch.jsonl`` runs the cases of a kind that the file has
not yet, prints one line each and appends it, then a table of medians and worst. ``--realistic`` takes the realistic
robot, a seed a case; ``--jobs 16`` runs so many at a time, each in a process. The kinds:

touch    a hand or both into the table, a wall, the corridor's walls, a board overhead: direction, hands, speed (0.05 to
         0.4 m/s), depth (5 to 200 mm past the touch), place, fingers and phase are drawn
brush    both thumbs brush a free carton of 1 kg
pulls    a force on a palm that grows slowly, 16 directions at 3 postures, beside what soles and torques allow at rest
told     45 N on the right palm that the script tells, ahead and back, at 3 postures; then 55 N
bumps    5 N s in 20 ms at a wrist, 6 directions at 3 postures
handed   1 kg put into a hand at 3 postures, and taken from it 3 s later, told by nobody
tasks    the scripted tasks, told which forces they meet and untold, and whether they came to what they are for

The answer is 1 if one of them fell.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import defaultdict
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from models.places import BUTTON_TRAVEL, LEVER_TURN
from policy.scripted.contact import SURFACES, touch
from policy.scripted.library import scripted_policy, two_hand_lift
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy
from policy.scripted.waypoints import Waypoint, waypoint_policy
from tests.support.felt import BUMP_TIME, SIDES, SPEC, Run, still_force
from tests.support.resumable import answered
from wholebody.cli.simulated import SCENE_OF

SCENES = {"down": "table", "ahead": "wall", "side": "corridor", "up": "shelf"}
HANDS = ("left", "right", "both")
TOUCHED, LOST = {False: 10.0, True: 15.0}, 0.02
"""Force from which a hand touches, of the true and the realistic robot [N]; distance from the chunk past which it is
lost [m]."""
POSTURES = {"ready": (0.26, 0.20, 0.86), "ahead": (0.42, 0.18, 1.05), "low": (0.40, 0.18, 0.62)}
"""Palm point of the left hand, the right one mirrored [m]; reached at 3 s of the script."""
HANDED = 1.0
"""Mass that is handed over [kg]; the issue's."""
BUMP = 5.0
"""Impulse of a bump [N s]; the issue's."""
RAMP, BEYOND = 8.0, 1.15
"""Time in which a pull grows to what the soles allow [s], and how far beyond that it goes."""
TOLD = 45.0, 55.0
"""Pulls that are told [N]; chosen: past the 40 N of a drawer."""
FRICTION = {False: 0.8, True: 0.6}
"""Of the floor, for the true and the realistic robot."""
LEVEL = [np.array([np.cos(a), np.sin(a), 0.0]) for a in 0.25 * np.pi * np.arange(8)]
UPRIGHT = [np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])]
AXES = [*LEVEL[::2], *UPRIGHT]
"""Ahead, left, back, right, up, down."""
PULLS = [*LEVEL, *UPRIGHT, *((u + s * UPRIGHT[0]) / np.sqrt(2.0) for u in LEVEL[:6:2] for s in (1.0, -1.0))]
"""Eight level directions, up, down, and 45 degrees between those and ahead, left and back."""
TASKS = ("wipe", "press", "pull_drawer", "turn_handle", "lift_box", "hand_over")


def draw_touch(case: int, seed: int) -> dict:
    """Settings of a case of `touch`."""
    rng = np.random.default_rng((seed, case))
    direction = list(SCENES)[case % 4]
    along = {"down": ((-0.06, 0.04), (-0.06, 0.06)), "ahead": ((-0.06, 0.06), (-0.15, 0.20)),
             "side": ((-0.04, 0.08), (-0.15, 0.15)), "up": ((-0.01, 0.03), (-0.06, 0.06))}[direction]  # fmt: skip
    return {
        "direction": direction,
        "hands": HANDS[(case // 4) % 3],
        "speed": round(float(np.exp(rng.uniform(np.log(0.05), np.log(0.4)))), 3),
        "depth": round(float(np.exp(rng.uniform(np.log(0.005), np.log(0.2)))), 4),
        "along": tuple(round(float(rng.uniform(*span)), 3) for span in along),
        "fist": bool(rng.integers(2)),
        "phase": round(float(rng.uniform(0.0, 0.8)), 3),
    }


def run_touch(case: int, seed: int, robot: int | None) -> dict:
    """A case of `touch`."""
    drawn = draw_touch(case, seed)
    phase = drawn.pop("phase")
    policy = touch(**drawn)
    run = Run(policy, SCENES[drawn["direction"]], seed=robot, phase=phase)
    u = SURFACES[drawn["direction"]][0]
    began, late, found = [], [], []
    for hand, side in enumerate(SIDES):
        felt = run.sizes[:, hand] > TOUCHED[robot is not None]
        if drawn["hands"] not in (side, "both") or not felt.any():
            continue
        first = float(run.times[np.argmax(felt)])
        said = run.felt.column(4)[:, hand] & (run.times >= first - 0.1)
        began.append(first)
        late.append(float(run.sizes[run.times > first + 0.3, hand].max(initial=0.0)))
        found.append(float(run.times[np.argmax(said)] - first) if said.any() else float("nan"))
    motion = policy.script(run.times - run.settle)
    palm = motion.p_world_rpalm if drawn["hands"] == "right" else motion.p_world_lpalm
    into = np.abs(palm @ np.abs(u) - (palm @ np.abs(u))[-1]) > 0.5 * np.clip(drawn["depth"], 0.05, 0.10)
    left = float(run.times[np.flatnonzero(into)[-1]]) if into.any() else float("nan")
    mean = run.sizes[run.sizes > 1.0]
    return {"family": drawn["direction"] + (" both" if drawn["hands"] == "both" else " one")} | run.told() | {
        "late_N": round(max(late, default=0.0), 1),
        "mean_N": round(float(mean.mean()), 1) if len(mean) else 0.0,
        "found_ms": round(1e3 * max(found, default=float("nan")), 1),
        "back_s": round(run.back(left), 3),
        "drawn": drawn,
    }  # fmt: skip


def run_brush(case: int, seed: int, robot: int | None) -> dict:
    """A case of `brush`: hands beside the carton, thumbs into it by 0 to 40 mm, up and away again."""
    rng = np.random.default_rng((seed, case))
    x, into = float(rng.uniform(0.38, 0.46)), float(rng.uniform(0.0, 0.04))
    policy = two_hand_lift(x=x, z=0.83, width=2.0 * (0.10 + 0.114 - into), lift=0.10)
    run = Run(policy, "table_carton", seed=robot, phase=float(rng.uniform(0.0, 0.8)))
    return (
        {"family": "brush"} | run.told() | {"back_s": round(run.back(run.settle + 10.5), 3), "into_m": round(into, 3)}
    )


def posture(name: str, seconds: float) -> ScriptedPolicy:
    """Both palms to one of `POSTURES`, held."""
    left = np.array(POSTURES[name])
    return waypoint_policy(name, [Waypoint(3.0, left, left * [1.0, -1.0, 1.0]), Waypoint(3.0 + seconds)])


def run_pulls(case: int, seed: int, robot: int | None) -> dict:
    """A case of `pulls`."""
    name, u = list(POSTURES)[case // len(PULLS) % 3], PULLS[case % len(PULLS)]
    side = SIDES[int(np.random.default_rng((seed, case)).integers(2))]
    policy, begin, most = posture(name, RAMP * BEYOND + 2.0), 1.0 + 4.0, [0.0]

    def force(time: float, q: np.ndarray) -> np.ndarray:
        if most[0] == 0.0 and time >= begin:
            most[0] = still_force(q, side, u, FRICTION[robot is not None])
        return u * most[0] * float(np.clip((time - begin) / RAMP, 0.0, BEYOND))

    run = Run(policy, "floor", seed=robot, pull=(side, force), hold=1.0)
    hand = SIDES.index(side)
    lost = (run.errors[:, hand] > LOST) & (run.times >= begin)
    at = float(run.times[np.argmax(lost)]) if lost.any() else float(run.times[-1])
    fall = run.result.fall
    ends = at, run.times[-1] if fall is None else fall.time
    held = [most[0] * float(np.clip((time - begin) / RAMP, 0.0, BEYOND)) for time in ends]
    return {"family": name} | run.told() | {
        "allowed_N": round(most[0], 1),
        "lost_N": round(float(held[0]), 1),
        "lost_share": round(float(held[0] / max(most[0], 1e-9)), 3),
        "fell_N": round(float(held[1]), 1) if fall is not None else float("nan"),
        "direction": np.round(u, 2).tolist(),
        "side": side,
    }  # fmt: skip


def run_told(case: int, seed: int, robot: int | None) -> dict:
    """A case of `told`: a pull that grows in 3 s, stays for 3 s and is told."""
    name, u = list(POSTURES)[case // 2 % 3], LEVEL[4 * (case % 2)]
    size = TOLD[case // 6 % 2]
    still, phase = posture(name, 8.0), float(np.random.default_rng((seed, case)).uniform(0.0, 0.8))

    def force(t: np.ndarray) -> np.ndarray:
        return size * np.interp(t, (4.0, 7.0, 10.0, 10.5), (0.0, 1.0, 1.0, 0.0))[..., None] * u

    def script(t: np.ndarray) -> ScriptedMotion:
        return replace(still.script(t), f_world_rpalm=force(t))

    pull = "right", lambda time, q: force(np.array(time - 1.0 - phase))
    run = Run(ScriptedPolicy("told", script, still.duration), "floor", seed=robot, phase=phase, pull=pull, hold=1.0)
    on = (run.times > run.settle + 7.0) & (run.times < run.settle + 10.0)
    away = {"away_mm": round(1e3 * float(run.errors[on, 1].max(initial=0.0)), 1)}
    return {"family": name} | run.told() | away | {"direction": u.tolist()}


def run_bumps(case: int, seed: int, robot: int | None) -> dict:
    """A case of `bumps`."""
    rng = np.random.default_rng((seed, case))
    u, name = AXES[case % 6], list(POSTURES)[case // 6 % 3]
    side, at = SIDES[int(rng.integers(2))], 5.0 + float(rng.uniform(0.0, 0.8))
    wrist = SPEC.tool(side).wrist_frame
    run = Run(posture(name, 3.0), "floor", seed=robot, bump=(wrist, u * BUMP / BUMP_TIME, at))
    told = {"away_mm": round(1e3 * float(run.errors[run.times > at].max(initial=0.0)), 1)}
    return (
        {"family": name} | run.told() | told | {"back_s": round(run.back(at), 3), "direction": u.tolist(), "side": side}
    )


def run_handed(case: int, seed: int, robot: int | None) -> dict:
    """A case of `handed`."""
    rng, name = np.random.default_rng((seed, case)), list(POSTURES)[case % 3]
    hand, at = int(rng.integers(2)), 5.0 + float(rng.uniform(0.0, 0.8))
    loads = [(at, tuple(HANDED * (i == hand) for i in (0, 1))), (at + 3.0, (0.0, 0.0))]
    run = Run(posture(name, 6.0), "floor", seed=robot, loads=loads)
    away = [1e3 * float(run.errors[run.times > since].max(initial=0.0)) for since in (at, at + 3.0)]
    back = {"back_s": round(run.back(at), 3), "back_after_s": round(run.back(at + 3.0), 3)}
    drawn = {"side": SIDES[hand]}
    return {"family": name} | run.told() | {"away_mm": round(max(away), 1)} | back | drawn


def untold(policy: ScriptedPolicy) -> ScriptedPolicy:
    """The same motion, without the forces that it expects."""

    def script(t: np.ndarray) -> ScriptedMotion:
        return replace(policy.script(t), f_world_lpalm=np.zeros(3), f_world_rpalm=np.zeros(3))

    return ScriptedPolicy(policy.name, script, policy.duration)


def run_tasks(case: int, seed: int, robot: int | None) -> dict:
    """A case of `tasks`: each told in the even ones, untold in the odd ones."""
    name, rng = TASKS[case // 2 % len(TASKS)], np.random.default_rng((seed, case))
    policy, told = scripted_policy(name), ("told", "untold")[case % 2]
    policy = policy if told == "told" else untold(policy)
    run = Run(policy, SCENE_OF[name], seed=robot, phase=float(rng.uniform(0.0, 0.8)))
    good, measure = done(name, run)
    return (
        {"family": f"{name} {told}"}
        | run.told()
        | {"done": good and run.result.fall is None, "measure": round(measure, 4)}
    )


def done(name: str, run: Run) -> tuple[bool, float]:
    """Whether a task came to what it is for, and by what that is measured."""
    moved = run.felt.column(5)
    if name == "wipe":
        wiping = (run.times > run.settle + 5.0) & (run.times < run.settle + 23.0)
        if wiping.sum() < 50:
            return False, 0.0
        # As a sensor of 10 Hz tells it.
        force = np.convolve(run.forces[wiping, 0, 2], np.ones(50) / 50.0, "valid")
        band = np.abs(force - 10.0) <= 3.0
        share = float(band.mean())
        return share >= 0.95, share
    if name in ("press", "pull_drawer", "turn_handle"):
        most, bound = float(moved.max()), {"press": BUTTON_TRAVEL, "pull_drawer": 0.25, "turn_handle": LEVER_TURN}[name]
        return most >= bound, most
    objects = run.felt.column(6)
    start, end = objects[0], objects[-1]
    target = start[:3] + ([0.0, 0.10, 0.0] if name == "lift_box" else [0.0, 0.0, 0.0])
    lifted = float(objects[:, 2].max() - start[2])
    off = float(np.linalg.norm(end[:3] - target))
    return off <= 0.02 and lifted >= 0.05, off


KINDS = {"touch": (run_touch, 40), "brush": (run_brush, 6), "pulls": (run_pulls, 48), "bumps": (run_bumps, 18)}
KINDS |= {"handed": (run_handed, 12), "told": (run_told, 12), "tasks": (run_tasks, 2 * len(TASKS))}
"""Runs a case of each kind, and how many there are if nothing is said."""


def table(lines: list[dict]) -> str:
    """A row a family: how many fell, then median and worst of each number."""
    families = defaultdict(list)
    for line in lines:
        families[line["family"]].append(line)
    rows = []
    for family, found in sorted(families.items()):
        said = [f"{family:18s} {sum(line['fell'] for line in found)} of {len(found)} fell"]
        if "done" in found[0]:
            said.append(f"{sum(line['done'] for line in found)} done")
        for key, value in found[0].items():
            if isinstance(value, float):
                values = np.array([line[key] for line in found])
                known = values[np.isfinite(values)]
                least = key.endswith("share")
                worst = (known.min() if least else known.max()) if len(known) else float("nan")
                lacking = f" ({len(values) - len(known)} none)" if len(known) < len(values) else ""
                middle = float(np.median(known)) if len(known) else float("nan")
                said.append(f"{key} {middle:.4g} / {worst:.4g}{lacking}")
        rows.append("; ".join(said))
    return "\n".join(rows)


def main() -> int:
    """Run what is not in the file yet; 1 if anything fell."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--cases", type=int, help="how many")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument("--seed", type=int, default=0, help="of what is drawn")
    parser.add_argument("--realistic", action="store_true", help="the realistic robot, a seed a case")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time, each in a process")
    parser.add_argument("--out", type=Path, help="a line of JSON for each case")
    chosen = parser.parse_args()
    run, usual = KINDS[chosen.kind]
    key = ("kind", "case", "seed", "realistic")
    known = {}
    if chosen.out is not None and chosen.out.exists():
        lines = map(json.loads, chosen.out.read_text().splitlines())
        known = {tuple(line[name] for name in key): line for line in lines}
    cases = range(chosen.first, chosen.first + (chosen.cases or usual))
    names = [(chosen.kind, case, chosen.seed, chosen.realistic) for case in cases]
    missing = [name for name in names if name not in known]
    calls = [partial(run, case, seed, case if realistic else None) for _, case, seed, realistic in missing]
    for number, told in answered(calls, chosen.jobs):
        line = known[missing[number]] = dict(zip(key, missing[number], strict=True)) | told
        if chosen.out is not None:
            with chosen.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
        said = {name: value for name, value in told.items() if name not in ("fell", "family")}
        print(line["case"], "FELL" if line["fell"] else "stands", line["family"], said, flush=True)
    found = [known[name] for name in names]
    print(table(found))
    fell = [line["case"] for line in found if line["fell"]]
    print(f"{chosen.kind}: {len(fell)} of {len(found)} fell: {fell}")
    return int(bool(fell))


if __name__ == "__main__":
    sys.exit(main())
