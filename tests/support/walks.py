"""Walks in MuJoCo by the native controller and a walker: what became of them."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from models import g1
from tests.support.grounds import Ground, RealisticGround
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.feet.walker import Walker
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.standing import has_lost_standing
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant
from wholebody.sim.sensors import REALISTIC_READINGS, Sensors
from wholebody.walking.gait import Phase

START = 0.3
"""Time at which a walk is told to begin [s]."""
GROUNDS = {
    "2 cm": {"scene": str(Path(__file__).parent / "scenes" / "ring_of_2_cm.xml")},
    "3 deg ahead": {"slope": np.deg2rad(3.0)},
    "3 deg aside": {"slope": np.deg2rad(3.0), "direction": 0.5 * np.pi},
    "friction 0.5": {"friction": 0.5},
    "0.5 kg a hand": {"payload_kg": (0.5, 0.5)},
}
"""Worlds that a walk is told nothing of: a slab all around from 0.35 to 0.85 m, floors that rise, and others."""


@dataclass
class Walked:
    """What became of a walk.

    Attributes:
        fell: When it fell [s], or None.
        errors: Distance of the worse palm from where it was to be, a tick each [m]; by the true state.
        made: Steps made.
        stands: Whether it stood on both feet at the end, no step to make.
        stopped: From when on it stood for good [s]; infinite if it did not.
        base: The base that it followed; soles: where they are.
        missed: Ticks without an answer of the whole program.
        load: Largest force of the floor [N].
        drift: How far the estimated place of the base has gone from the true one, and how far by its covariance, a
            standard deviation [m]; zeros where the state is true.
    """

    fell: float | None
    errors: np.ndarray
    made: int
    stands: bool
    stopped: float
    base: complex
    middle: complex
    missed: int
    load: float
    heading: float
    drift: tuple[float, float]


def worlds(seed, spec, ground=None):
    """The realistic robot of a seed, on a ground of `GROUNDS`, and what its controller is told of it."""
    readings = replace(REALISTIC_READINGS, seed=seed)
    sensors = Sensors(spec, readings, 0.002, StateEstimator(spec))
    world = dict(GROUNDS.get(ground, {}))
    errors = replace(REALISTIC_ROBOT, seed=seed, floor_friction=world.pop("friction", REALISTIC_ROBOT.floor_friction))
    kind = RealisticGround if "slope" in world else RealisticPlant
    return kind(spec, errors, encoders=sensors, **world), sensors


def true_plant(spec, ground=None, timestep=0.002):
    """The robot as its model is, on a ground of `GROUNDS`."""
    world = GROUNDS.get(ground, {})
    return (Ground if "slope" in world else MujocoPlant)(spec, timestep=timestep, **world)


def walk(tell, seconds, *, seed=None, estimated=False, pushes=(), gait=None, timestep=0.002, look=None, ground=None):
    """Walk for some time.

    Args:
        tell: Called with the walk and the time at each tick from `START` on.
        seconds: How long [s].
        seed: Of a realistic world with an estimated state; the true robot and state if None.
        estimated: Whether the true robot's state is estimated from clean readings.
        pushes: Body, force (3,) [N], start and duration [s] of each.
        gait: Times and lengths.
        timestep: Of the physics [s].
        look: Called with walker, plant and state after each tick.
        ground: Of `GROUNDS`; a level floor of friction 0.8, or 0.6 in a realistic world, if not given.
    """
    spec = g1()
    sensors = None
    if seed is not None:
        plant, sensors = worlds(seed, spec, ground)
    else:
        plant = true_plant(spec, ground, timestep)
    if estimated:
        sensors = Sensors(spec, replace(REALISTIC_READINGS, **_CLEAN), 0.002, StateEstimator(spec))
    state = plant.reset()
    if sensors is not None:
        sensors.reset()
    measured = state if sensors is None else sensors.measure(state)
    controller = WholeBodyController(spec, ControllerConfig())
    controller.reset(measured)
    walker = Walker(controller, gait)
    walker.begin(measured)
    for body, force, start, duration in pushes:
        plant.push(body, np.array(force), start=start, duration=duration)
    robot, errors, missed, load, stopped = controller.robot, [], 0, 0.0, np.inf
    begin = measured.q[:3] - state.q[:3]
    fell, stands = None, None
    while state.time < seconds - 1e-9:
        if state.time >= START:
            tell(walker.walk, state.time)
        reference = walker.reference(measured, 0.002)
        if sensors is not None and reference.contacts.stands != stands:
            stands = reference.contacts.stands
            sensors.estimator.expect(ContactSchedule((reference.contacts,)))
        command, report = controller.step(measured, reference, 0.002)
        missed += report.level.name != "FULL"
        state = plant.step(command)
        errors.append(_off(walker, spec, robot, state, measured))
        measured = state if sensors is None else sensors.measure(state)
        load = max(load, plant.foot_load()[0])
        if walker.walk.state is not Phase.STAND:
            stopped = np.inf
        elif not np.isfinite(stopped):
            stopped = state.time
        if look is not None:
            look(walker, plant, state)
        if has_lost_standing(state):
            fell = state.time
            break
    middle = plant.soles()[:, :2].mean(axis=0)
    one, drift = walker.walk, float(np.linalg.norm(measured.q[:3] - state.q[:3] - begin))
    sure = 0.0 if sensors is None else float(np.sqrt(np.trace(measured.covariance[6:, 6:])))
    return Walked(
        fell,
        np.array(errors),
        one.made,
        walker.stands,
        stopped,
        one.guide.place.point,
        complex(*middle),
        missed,
        load,
        one.guide.place.heading,
        (drift, sure),
    )


_CLEAN = dict.fromkeys(
    ("imu_bias", "imu_noise", "gyro_noise", "encoder_offset", "encoder_noise", "speed_noise", "velocity_cutoff",
     "gyro_bias", "yaw_drift", "acc_noise", "acc_bias", "lost"), 0.0
)  # fmt: skip


def _off(walker, spec, robot, state, measured):
    """Distance of the worse palm from its reference: of the true robot, its base taken as the controller sees it."""
    q = state.q.copy()
    q[:7] = measured.q[:7]
    robot.place(q, state.v)
    places = [robot.pose(tool.palm_frame).translation for tool in spec.tools]
    wanted = [row[9:12] for row in walker.palms]
    return max(float(np.linalg.norm(a - b)) for a, b in zip(places, wanted, strict=True))


def rms(errors):
    """Root of the mean square [in the unit of the errors]."""
    return float(np.sqrt(np.mean(np.square(errors))))
