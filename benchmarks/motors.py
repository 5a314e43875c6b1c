"""What motors the robot stands: slow, late, weak, or deaf to torques; for `docs/limits.md`.

    python benchmarks/motors.py margin
    python benchmarks/motors.py faults [--robot true|realistic] [--seeds FIRST END] [--only PART] [--out FILE]

margin   the loop linearised at its motors, at rest in the stance and at a reach: phase margin, and by bandwidth and
         delay the frequency of the mode that grows
faults   60 s of standing, the five reaches and the lissajous with each fault of the motors, which nobody told

Cases of ``faults`` are lines of JSON in the file, ``motors_faults.jsonl`` if not given; those that it has are not run
again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from limits import PLACES, SPEC, Case, lissajous, ran, reached, robot, rows, still

sys.path.insert(0, str(Path(__file__).parents[1]))

from policy.scripted.library import reach
from tests.support.resumable import finished
from wholebody.bench.torque_loop import Motors, TorqueLoop, linearised
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

BANDWIDTHS, DELAYS = (0.0, 100.0, 60.0, 40.0, 30.0, 25.0, 20.0, 15.0), (0, 4, 8, 16, 20, 24, 30, 40)
"""Of second-order motors at a damping ratio of 0.5, 0 for motors that answer at once [Hz]; of commands [ms]."""
ANKLES, WAIST = ".*_ankle_pitch_joint", "waist_pitch_joint"
FAULTS: dict[str, dict[str, object]] = {
    "none": {},
    **{f"{hz} Hz": {"motor_bandwidth": float(hz)} for hz in (60, 40, 30, 25, 20, 15)},
    **{f"lag {ms} ms": {"torque_lag": 1e-3 * ms} for ms in (5, 10, 15)},
    **{f"delay {ms} ms": {"command_delay": (1e-3 * ms, 1e-3 * ms)} for ms in (8, 16, 20, 24, 30)},
    **{f"feed-forward x {share:g}": {"feed_forward": share} for share in (0.0, 0.5, 0.8, 1.2, 1.3)},
    **{f"ankle pitch x {share:g}": {"delivered": ((ANKLES, share),)} for share in (0.8, 0.65, 0.5)},
    **{f"waist pitch x {share:g}": {"delivered": ((WAIST, share),)} for share in (0.8, 0.65, 0.5)},
}
"""Errors of the motors by name, as of `RobotErrors`."""


def loop(place: tuple[float, float] | None = None) -> TorqueLoop:
    """The loop at rest in the stance, or with both palms at a place."""
    supervisor, plant = Supervisor(SPEC), MujocoPlant(SPEC)
    policy = still(1.0) if place is None else reach(*place)
    run_episode(policy, supervisor, plant, duration=policy.duration, config=EpisodeConfig(hold=2.0))
    return linearised(supervisor.controller, plant, supervisor._follower.row)


def margin() -> None:
    """Print what the linearised loop stands."""
    for said, place in (("stance", None), ("reach 0.45 0.60", PLACES[1])):
        found = loop(place)
        print(f"\n{said}: phase margin {found.phase_margin():.0f} degrees\n")
        print("| | " + " | ".join(f"{ms} ms" for ms in DELAYS) + " |")
        print("|---" * (len(DELAYS) + 1) + "|")
        for hz in BANDWIDTHS:
            cells = []
            for ms in DELAYS:
                size, frequency, joint = found.worst(Motors(bandwidth=hz, delay=round(1e-3 * ms / found.dt)))
                cells.append("stands" if size <= 1.0001 else f"{joint.split('_', 1)[1][:-6]} {frequency:.0f} Hz")
            print(f"| {f'{hz:g} Hz' if hz else 'at once'} | " + " | ".join(cells) + " |", flush=True)


def faults(name: str, seeds: range, only: str) -> Iterator[Case]:
    """Standing, reaches and lissajous with each fault."""
    for (fault, errors), seed in ((one, seed) for one in FAULTS.items() for seed in seeds):
        if only not in fault:
            continue
        given = {"name": name, "seed": seed, "errors": errors}
        yield f"{name}: {fault}, 60 s", f"seed {seed}", partial(stood, **given)
        for place in PLACES[:5]:
            yield f"{name}: {fault}, reaches", f"{place}, seed {seed}", partial(reached, place, **given)
        yield f"{name}: {fault}, lissajous", f"seed {seed}", partial(lissajous, **given)


def stood(name: str, seed: int, errors: dict[str, object]) -> dict[str, float]:
    """A minute with the hands where they are."""
    return ran(still(1.0), robot(name, seed, errors), 1.0, hold=58.0)


def main() -> None:
    """Run what is asked for, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=("margin", "faults"))
    parser.add_argument("--robot", choices=("true", "realistic"), default="true")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 1), help="first, and the one after the last")
    parser.add_argument("--only", default="", help="a part of the faults' names")
    parser.add_argument("--out", type=Path, help="file with a line a case", default=Path("motors_faults.jsonl"))
    options = parser.parse_args()
    if options.table == "margin":
        margin()
        return
    print("\n".join(rows(finished(faults(options.robot, range(*options.seeds), options.only), options.out))))


if __name__ == "__main__":
    main()
