"""What motors the robot stands: slow, late, weak, or deaf to torques; for `docs/limits.md`.

    python benchmarks/motors.py margin
    python benchmarks/motors.py faults|shares [--robot true|realistic] [--seeds FIRST END] [--only PART ...] [--out F]

margin   the loop linearised at its motors, at rest in the stance and at a reach: phase margin, and by bandwidth and
         delay the frequency of the mode that grows
faults   the five reaches and the lissajous with each fault of the motors, which nobody told
shares   60 s of standing and the same of a robot that is sent a share of its torques, the rest as positions, by the
         stiffness of its legs

Cases are lines of JSON in the file, ``motors_TABLE.jsonl`` if not given; those that it has are not run again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import product
from pathlib import Path

import limits
from limits import PLACES, SECONDS, SPEC, Case, Numbers, ran, robot, rows, still

sys.path.insert(0, str(Path(__file__).parents[1]))

from models import RobotSpec
from policy.scripted.library import reach, scripted_policy
from tests.support.resumable import finished
from wholebody.bench.torque_loop import Motors, TorqueLoop, linearised
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.config.robot import LED_BY_POSITION, GainsConfig, RobotConfig
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
SHARES, LEGS = (0.0, 0.25, 0.5, 0.75), (0.0, 150.0, 200.0, 250.0)
"""Of the torques, and how stiff all joints of the legs are [N m/rad]; 0 for the gains of whole torques."""


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


def faults(name: str, seed: int) -> Iterator[Case]:
    """Each fault."""
    for fault, errors in FAULTS.items():
        yield from tried(f"{name}: {fault}", name, seed, errors=errors)


def shares(name: str, seed: int) -> Iterator[Case]:
    """Each share and stiffness."""
    for stiffness, share in product(LEGS, SHARES):
        said = f"{stiffness:g} N m/rad" if stiffness else "gains of whole torques"
        group, led = f"{name}: {share:g}, {said}", (share, stiffness)
        stands = partial(ran, still(1.0), duration=1.0, hold=58.0)
        yield f"{group}, 60 s", f"seed {seed}", partial(case, stands, name, seed, led=led)
        yield from tried(group, name, seed, led=led)


def tried(group: str, name: str, seed: int, **given: object) -> Iterator[Case]:
    """The five reaches, which hold for 4 s, and the lissajous."""
    for place in PLACES[:5]:
        policy = reach(*place)
        moves = partial(ran, policy, duration=policy.duration, hold=1.0)
        yield f"{group}, reaches", f"{place}, seed {seed}", partial(case, moves, name, seed, **given)
    moves = partial(ran, scripted_policy("lissajous"), duration=2.0 + SECONDS)
    yield f"{group}, lissajous", f"seed {seed}", partial(case, moves, name, seed, **given)


def case(
    moves: Callable[..., Numbers],
    name: str,
    seed: int,
    errors: dict[str, object] | None = None,
    led: tuple[float, float] | None = None,
) -> Numbers:
    """Numbers of a robot that moves, with errors of its motors, or led by a share of torques and legs so stiff."""
    spec, chosen = (SPEC, limits.supervisor()) if led is None else led_robot(*led)
    return moves(made=robot(name, seed, errors, spec=spec), chosen=chosen)


@cache
def led_robot(share: float, stiffness: float) -> tuple[RobotSpec, Supervisor]:
    """A robot that is sent a share of its torques; its legs as stiff as that, or with the gains of whole torques."""
    gains = GainsConfig()
    if stiffness:
        parts = {part: replace(getattr(LED_BY_POSITION, part), kp=stiffness) for part in ("hip", "knee", "ankle")}
        gains = replace(LED_BY_POSITION, **parts)
    config = ControllerConfig(robot=RobotConfig(torque=share, position_gains=gains))
    return describe(config.robot), Supervisor(describe(config.robot), config)


TABLES = {"faults": faults, "shares": shares}


def main() -> None:
    """Run what is asked for, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=("margin", *TABLES))
    parser.add_argument("--robot", choices=("true", "realistic"), default="true")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 1), help="first, and the one after the last")
    parser.add_argument("--only", nargs="+", default=[""], help="parts of the faults' names")
    parser.add_argument("--out", type=Path, help="file with a line a case")
    options = parser.parse_args()
    if options.table == "margin":
        margin()
        return
    listed = [one for seed in range(*options.seeds) for one in TABLES[options.table](options.robot, seed)]
    wanted = [one for one in listed if any(part in one[0] for part in options.only)]
    print("\n".join(rows(finished(wanted, options.out or Path(f"motors_{options.table}.jsonl")))))


if __name__ == "__main__":
    main()
