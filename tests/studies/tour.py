"""The waypoint tour of gaitkeeper 0.5.4: commands, arm walk and punches are drawn there, all else is this project's.

    make test-tour                                     # one seed of each stage
    python -m tests.studies.tour --seeds 0 20 --out tour.jsonl --only punches

A robot goes to 18 places in a disc of 0.75 m, 5 s for each, led by velocities. Its arms are carried along (`own`), or
wander at random (`arms`), or a joint is punched every 5 s besides, in the end with up to 500 N for 0.08 s (`punches`).
It is the G1 in MuJoCo as `MujocoPlant` has it, with true states, commanded at 500 Hz with positions, velocities and
torques; the original moves its robots by position targets at 50 Hz. A tour is complete if the pelvis is never below 0.2
m. A case is a line of JSON, and the file goes on where it ended.
"""

import argparse
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from policy.geometry.se3 import interpolate
from policy.kinematics.forward import kinematics
from tests.support.resumable import finished
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.episode.observation import observation_of
from wholebody.execution.feet.recorded_walks import walk_limits
from wholebody.execution.feet.wanted import FASTEST
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState

STAGES = "own", "arms", "punches"
CONFIG = ControllerConfig(steps="reach")
EVERY, CHUNK, FPS = 0.2, 25, 50.0
"""How often a chunk of wandering arms is sent [s], its length [steps] and rate [Hz]; chosen: longer than until the next
one is planned, and the rate of the tour."""


class WanderingArms:
    """Chunks of arms that wander as the tour has them, about a base that goes as it is told.

    Hands that no walk can have are drawn in to the nearest that one can, and follow no faster than one does.

    Args:
        walk: Times [s] and angles [rad] of each joint.
        robot: The robot.
    """

    def __init__(self, walk: dict[str, list[list[float]]], robot: RobotSpec) -> None:
        anchor, count = Anchor.nominal(robot=robot), len(next(iter(walk.values())))
        q = np.tile(anchor.q_body, (count, 1))
        for name, rows in walk.items():
            q[:, robot.body_joints.index(name)] = np.array(rows)[:, 1]
        poses = kinematics(robot).poses(q)
        hands, limits = np.stack([poses["lhand"], poses["rhand"]]), walk_limits(CONFIG)
        hands[..., :3, 3] = limits.nearest(hands[..., :3, 3])
        hands = np.stack([no_faster(one, *limits.hands) for one in hands])
        self._hands, self._anchor, self._robot, self._seq = anchor.T_world_base @ hands, anchor, robot, -1
        self._model = Robot(robot)

    def chunk(self, elapsed: float, state: RobotState, velocity: np.ndarray) -> ActionChunk:
        """What is due a time after the tour began [s], about soles as seen, for a base that goes on so."""
        self._seq += 1
        first = min(round(elapsed * FPS), self._hands.shape[1] - CHUNK)
        now, T = (
            state.time,
            Anchor.measured(observation_of(self._robot, self._model, state), self._robot).T_world_stance,
        )
        left, right = T @ self._hands[:, first : first + CHUNK]
        q_l, q_r = (np.tile(q, (CHUNK, 1)) for q in (self._anchor.q_lhand, self._anchor.q_rhand))
        way = {"base_velocity": np.tile(velocity, (CHUNK, 1)), "hands_in": "stance"}
        layout = builtin("wbc32", self._robot).id
        return ActionChunk(layout, self._seq, now, FPS, left, right, q_l, q_r, **way)


def no_faster(poses: np.ndarray, speed: float, turn: float) -> np.ndarray:
    """Poses (n, 4, 4) at `FPS` as what comes after them has them, at most so fast [m/s, rad/s]."""
    followed = poses.copy()
    for before, now in pairwise(followed):
        way, angle = now[:3, 3] - before[:3, 3], angle_between(before[:3, :3], now[:3, :3])
        share = min(speed / FPS / max(np.linalg.norm(way), 1e-9), turn / FPS / max(float(angle), 1e-9), 1.0)
        now[:] = interpolate(np.stack([before, now]), np.array([0.0, 1.0]), np.array([share]))[0]
    return followed


def punch(plant: MujocoPlant, pushes: list, elapsed: float) -> None:
    """Put what pushes at a time [s] on the plant until its next period: at a joint, in axes of a link that turns."""
    data = plant.data
    data.xfrc_applied[:] = 0.0
    for push in pushes:
        if push.t <= elapsed < push.t + push.duration:
            body, frame = data.body(push.body), data.body(push.frame)
            force = frame.xmat.reshape(3, 3) @ push.vector
            at = body.xpos + body.xmat.reshape(3, 3) @ push.point
            data.xfrc_applied[body.id] = [*force, *np.cross(at - body.xipos, force)]


def toured(stage: str, seed: int) -> dict[str, float]:
    """A tour: whether and when it fell [s], places reached, and mean errors where it was to be [cm, deg]."""
    from gaitkeeper import tour as theirs

    spec = describe(CONFIG.robot)
    plant, supervisor = MujocoPlant(spec), Supervisor(spec, CONFIG)
    state = plant.reset()
    supervisor.reset(state)
    back, ahead, aside, turn = FASTEST
    limits = {"vx": (back, ahead), "vy_abs": aside, "wz_abs": turn}
    tour, seconds = theirs.WaypointTour(theirs.bench_waypoints(seed), **limits), theirs.BENCH_WAYPOINTS * 5.0
    ranges = {name: tuple(plant.model.joint(name).range) for name in theirs.BENCH_ARMS}
    arms = WanderingArms(theirs.bench_arm_walk(seed, seconds, ranges), spec) if stage != "own" else None
    links = theirs.bench_motor_links(plant.model)
    pushes = theirs.bench_punches(seed, links) if stage == "punches" else []
    fell, told, period = None, -np.inf, round(0.02 / CONFIG.dt)
    for tick in range(round(seconds / CONFIG.dt)):
        elapsed = tick * CONFIG.dt
        if tick % period == 0:
            velocity = tour(elapsed, plant.data.qpos[:7])
            if arms is None:
                supervisor.walk(velocity)
            elif elapsed - told >= EVERY:
                told = elapsed
                supervisor.accept(arms.chunk(elapsed, state, velocity))
        punch(plant, pushes, elapsed)
        state = plant.step(supervisor.step(state))
        if plant.data.qpos[2] < theirs.BENCH_FALL_PELVIS_Z:
            fell = elapsed
            break
    report = tour.report(fell)
    return {
        "fell": float(fell is not None),
        "survived_s": seconds if fell is None else fell,
        "reached": float(report["reached"]),
        "pos_err_cm": report["pos_err_cm"],
        "yaw_err_deg": report["yaw_err_deg"],
    }


def main() -> int:
    """Run what the file has not; 2 if gaitkeeper is not there."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 1), metavar=("FIRST", "END"))
    parser.add_argument("--only", choices=STAGES, help="one stage")
    parser.add_argument("--out", type=Path, default=Path("tour.jsonl"))
    parser.add_argument("--jobs", type=int, default=1, help="tours at a time, each in a process")
    chosen = parser.parse_args()
    try:
        import gaitkeeper.tour  # noqa: F401
    except ImportError as error:
        print(f"{error}: pip install --no-deps gaitkeeper==0.5.4, or make test-tour", file=sys.stderr)
        return 2
    stages = [chosen.only] if chosen.only else STAGES
    cases = [(stage, str(seed), partial(toured, stage, seed)) for stage in stages for seed in range(*chosen.seeds)]
    for stage, found in finished(cases, chosen.out, chosen.jobs).items():
        lines = list(found.values())
        complete = sum(1.0 - line["fell"] for line in lines)
        print(f"{stage}: {complete:.0f} of {len(lines)} complete")
        for key in ("survived_s", "pos_err_cm", "yaw_err_deg"):
            print(f"    {key} {np.nanmean([line[key] for line in lines]):.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
