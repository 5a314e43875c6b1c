"""Streams of chunks and of targets: how soon a target is reached, who falls, how late the palms are.

``python -m tests.studies.streams reach`` prints the time to reach a target 0.42 m away by the time between two chunks,
``mixed --seeds 0 20`` a line a stream of a minute of hostile, calm, late, lost and doubled chunks, ``targets`` how far
off and how late the palms are that are told one step at a time, and how far they drift in a minute of rest, ``hostile``
who falls by single targets that jump, are out of reach or too fast. With
``--out FILE`` lines are appended to a file, and what the file has already is left out.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

from models import g1
from tests.support.chunk_streams import FAR, THERE, MixedStream, time_to_reach
from tests.support.one_step_targets import follow, hostile_targets
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

SCRIPTS, RATES = (("reach", 6.0), ("wave", 8.0), ("lissajous", 8.0)), (10.0, 30.0, 100.0)
"""What is told one step at a time, for how long [s], and how often [Hz]."""
KNOWN = (15, 30)
"""Steps of the lissajous that are told at once, for what a perfect foretelling would give."""
EVERY = (0.1, 0.25, 0.5, 1.6)
"""Times between two chunks [s]."""


def reach(robot: tuple[Supervisor, MujocoPlant], _: range, done: set[str]) -> Iterator[dict]:
    """Time to reach each of the targets at each rate [s]."""
    for name, way in FAR.items():
        for every in EVERY:
            case = f"{name} every {every} s"
            if case not in done:
                yield {"case": case, "reached_s": round(time_to_reach(*robot, way, every), 3)}


def mixed(robot: tuple[Supervisor, MujocoPlant], seeds: range, done: set[str]) -> Iterator[dict]:
    """What became of the stream of each seed."""
    for seed in seeds:
        if str(seed) not in done:
            result = MixedStream(*robot, seed).run()
            missed = sum(x > THERE for x in result.calm)
            counts = {"calm": len(result.calm), "missed": missed, "fell": result.fall is not None}
            yield {"case": str(seed), **counts, "said": str(result)}


def targets(robot: tuple[Supervisor, MujocoPlant], _: range, done: set[str]) -> Iterator[dict]:
    """How palms follow each script that is told at each rate, and the reach held for a minute."""
    cases = {f"{name} at {rate:g} Hz": (name, seconds, rate) for name, seconds in SCRIPTS for rate in RATES}
    cases["reach held for 60 s"] = ("reach", 65.0, 30.0)
    known = {f"lissajous, its next {steps / 30.0:g} s known": steps for steps in KNOWN}
    cases |= dict.fromkeys(known, ("lissajous", 8.0, 30.0))
    for case, (name, seconds, rate) in cases.items():
        if case not in done:
            result = follow(*robot, name, seconds, rate=rate, rests_from=5.0, known=known.get(case))
            millis = {"rms_mm": 1e3 * result.rms, "late_ms": 1e3 * result.shift, "drift_mm": 1e3 * result.drift}
            drift = {} if name != "reach" else {"drift_mm": round(millis["drift_mm"], 3)}
            rounded = {key: round(value, 2) for key, value in millis.items() if key != "drift_mm"}
            yield {"case": case, **rounded, **drift, "fell": result.fall is not None}


def hostile(robot: tuple[Supervisor, MujocoPlant], seeds: range, done: set[str]) -> Iterator[dict]:
    """What became of single targets that are hostile, between swings, for 20 s each."""
    for seed in seeds:
        if str(seed) not in done:
            fall, fast = hostile_targets(*robot, seed)
            yield {"case": str(seed), "fell": fall is not None, "fast_s": round(fast, 2), "said": str(fall)}


PARTS = {"reach": reach, "mixed": mixed, "targets": targets, "hostile": hostile}


def summary(part: str, lines: list[dict]) -> str:
    """The last line."""
    if part == "reach":
        return f"slowest {max(line['reached_s'] for line in lines):.2f} s of {len(lines)}"
    if part in ("targets", "hostile"):
        return f"{sum(line['fell'] for line in lines)} of {len(lines)} fell"
    falls, missed, calm = (sum(line[key] for line in lines) for key in ("fell", "missed", "calm"))
    return f"{falls} of {len(lines)} fell; {missed} of {calm} calm targets not within {1e3 * THERE:.0f} mm after 3 s"


def main() -> None:
    """Print a line a case, and what all of them say together."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--seeds", nargs=2, type=int, default=(0, 20))
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    lines = []
    if chosen.out is not None and chosen.out.exists():
        lines = [json.loads(line) for line in chosen.out.read_text().splitlines()]
    done = {line["case"] for line in lines}
    for line in PARTS[chosen.part]((Supervisor(g1()), MujocoPlant(g1())), range(*chosen.seeds), done):
        print(json.dumps(line), flush=True)
        lines.append(line)
        if chosen.out is not None:
            with chosen.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
    print(summary(chosen.part, lines))


if __name__ == "__main__":
    main()
