"""What happened in an episode."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from policy.executor.report import ExecutionReport
from wholebody.episode.chunk_seams import ChunkSeam
from wholebody.episode.tracking_error import PalmErrors
from wholebody.sim.fall import Fall
from wholebody.sim.limit_monitor import LimitExcess, StepMade
from wholebody.sim.motor_heat import MotorHeat
from wholebody.types import Reason


@dataclass(frozen=True)
class Refusal:
    """A chunk that was refused, or that never came: simulated time [s], reason, and a sentence."""

    time: float
    reason: Reason
    detail: str


@dataclass(frozen=True)
class Note:
    """What decoding changed in a chunk or found odd: simulated time [s] and a sentence."""

    time: float
    text: str


@dataclass
class EpisodeResult:
    """What happened.

    Attributes:
        fall: Time and cause, or None.
        seconds: Time spent per status name [s].
        reasons: Time spent per reason code [s].
        first_reasons: When each reason was there first [s], and what was said then.
        palms: Palms at the steps of the chunks: asked, commanded and measured.
        orientation_free: Whether the orientation of the left and of the right palm is free.
        time_factor: Time on chunks over chunk time covered.
        contacts: First time at which two bodies of the robot touched, by pair [s].
        scene_contacts: First time at which the robot touched something else, feet on the floor left out [s].
        torques: Body motors asked for more than their effort limit, by joint [N m].
        positions: Joints past a position limit, by joint [rad].
        edge: The centre of pressure at the edge of the soles [m], or None.
        margin: Least distance of the centre of pressure from the edge of the soles [m].
        creep: Largest distance that a sole slid [m].
        steps: Feet that were set down.
        heat: Motors that were heated most, an ankle first.
        tilt: Largest pelvis tilt [rad].
        refusals: Chunks that were refused or never came.
        notes: What decoding changed in the chunks or found odd.
        slowdown: Largest planned slow-down factor, and when that chunk came [s].
        start: When the first chunk was asked for [s].
        start_jump: How far the first chunk began from where the hands were: distance [m] and angle [rad].
        start_palms: Where the palm points were then, shape (2, 3), world [m].
        placed: Whether the robot was put with its hands at the first step, or as near to it as it can stand.
        fps: Steps per second of the chunks [Hz]; 0 before the first.
        seams: Jump of the commanded palms at every chunk.
        execution: What the executor saw.
        executed: Chunks that were followed, however shortly.
    """

    fall: Fall | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    reasons: dict[str, float] = field(default_factory=dict)
    first_reasons: dict[Reason, tuple[float, str]] = field(default_factory=dict)
    palms: PalmErrors = field(default_factory=PalmErrors)
    orientation_free: tuple[bool, bool] = (False, False)
    time_factor: float = 1.0
    contacts: dict[tuple[str, str], float] = field(default_factory=dict)
    scene_contacts: dict[tuple[str, str], float] = field(default_factory=dict)
    torques: dict[str, LimitExcess] = field(default_factory=dict)
    positions: dict[str, LimitExcess] = field(default_factory=dict)
    edge: LimitExcess | None = None
    margin: float = float("inf")
    creep: float = 0.0
    steps: list[StepMade] = field(default_factory=list)
    heat: list[MotorHeat] = field(default_factory=list)
    tilt: float = 0.0
    refusals: list[Refusal] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    slowdown: float = 1.0
    slowed_time: float = 0.0
    start: float = 0.0
    start_jump: tuple[float, float] = (0.0, 0.0)
    start_palms: np.ndarray = field(default_factory=lambda: np.zeros((2, 3)))
    placed: bool = False
    fps: float = 0.0
    seams: list[ChunkSeam] = field(default_factory=list)
    execution: ExecutionReport | None = None
    executed: int = 0

    @property
    def times(self) -> np.ndarray:
        """Times at which the chunk steps were due, shape (n,), [s]."""
        return self.palms.times

    @property
    def errors(self) -> np.ndarray:
        """Palm errors against the chunks at their own times, shape (n, 2), [m]."""
        return self.palms.errors

    @property
    def turns(self) -> np.ndarray:
        """Angles of the palms' orientations to those asked for, shape (n, 2), [rad]."""
        return self.palms.turns

    @property
    def rms(self) -> float:
        """Root mean square palm error [m]; 0 if nothing was scored."""
        return float(np.sqrt(np.mean(self.errors**2))) if self.errors.size else 0.0
