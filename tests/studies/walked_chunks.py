"""Chunks with a base velocity, in MuJoCo, with `steps: reach`: a line for each layout and velocity.

    python -m tests.studies.walked_chunks wbc27 gr00t_g1 openhlm34 in_the_room

Palms are measured at the steps of the chunks against where the layout has them: about the base, or in world.
"""

import argparse

import numpy as np

from tests.support.walked_chunks import LAYOUTS, ROOM, SPEC, Walks
from wholebody.config import ControllerConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.verdict.verdict import verdict_of

VELOCITIES = {
    "ahead": (0.3, 0.0, 0.0),
    "back": (-0.2, 0.0, 0.0),
    "aside": (0.0, 0.12, 0.0),
    "turn": (0.0, 0.0, 0.4),
    "arc": (0.25, 0.0, 0.3),
    "slow": (0.1, 0.0, 0.0),
}
UNTIL, DURATION = 4.0, 7.0
"""Until when they ask for it, and are asked for chunks [s]."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("layouts", nargs="*", default=list(LAYOUTS), choices=[*LAYOUTS, []])
    parser.add_argument("--velocities", nargs="*", default=list(VELOCITIES), choices=list(VELOCITIES))
    parser.add_argument("--steps", default="reach", choices=("never", "recover", "reach"))
    parser.add_argument("--sway", type=float, default=0.1, help="how far hands go up and down [m]")
    given = parser.parse_args()
    config = ControllerConfig(steps=given.steps)
    supervisor, plant = Supervisor(SPEC, config), MujocoPlant(SPEC)
    for name in given.layouts or LAYOUTS:
        for which in given.velocities:
            velocity = np.array(VELOCITIES[which])
            if LAYOUTS[name].slot("base_velocity") is None:
                velocity[:2] = 0.0
            if LAYOUTS[name] is ROOM:
                velocity *= 0.3
            policy = Walks(LAYOUTS[name], velocity, UNTIL, given.sway)
            result = run_episode(policy, supervisor, plant, duration=DURATION, config=EpisodeConfig(hold=3.0))
            verdict, base = verdict_of(name, result), np.array(supervisor.base) if result.fall is None else np.zeros(3)
            off = 1e3 * result.palms.errors
            lags = 1e3 * result.palms.lags
            print(
                f"{name} {which} {velocity.tolist()}: {verdict.verdict}, fall {result.fall}; base went "
                f"({base[0]:.2f}, {base[1]:.2f}, {base[2]:.2f}); palms against the layout "
                f"{np.sqrt((off**2).mean()):.1f} mm RMS, {off.max():.1f} at most, against their command "
                f"{np.sqrt((lags**2).mean()):.2f} and {lags.max():.1f}; {supervisor.state.value}; {verdict.headline}",
                flush=True,
            )


if __name__ == "__main__":
    main()
