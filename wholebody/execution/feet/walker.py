"""From a walk to what the controller follows: contacts, swing, centre of mass, trunk and palms, a tick at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import acos, atan2, cos

import numpy as np
import pinocchio as pin

from models.pinocchio_model import frame_id
from wholebody.config import ControllerConfig
from wholebody.control.base import Controller
from wholebody.control.controller import WholeBodyController
from wholebody.control.reference_packet import PALM, PackedReference, ReferenceMemory, row_length
from wholebody.control.weights import RECOVERING, WALKING, Weights
from wholebody.errors import ConfigError, InputError
from wholebody.estimation.sole_press import SolePress
from wholebody.execution.feet.carried import about_z, carry, leaning
from wholebody.robot.contact_schedule import Contacts
from wholebody.robot.feet import Feet
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.types import RobotState
from wholebody.walking.catch import Catch, choose
from wholebody.walking.gait import Gait, Phase
from wholebody.walking.places import Place
from wholebody.walking.pressure import Sole
from wholebody.walking.readings import WalkReadings, floor_under, rise
from wholebody.walking.swing import Course, Swing
from wholebody.walking.walk import Walk

STEPS = ("never", "recover", "reach")
"""What `steps` may be."""
EDGE = (0.012, 0.006)
"""Distance of the zero-moment point from the edges of a sole, ahead and to the side [m]; chosen: the sole's own
curvature and half of a centimetre for what is not known."""

LOWER, FAST = 0.02, 0.32
"""How much lower the centre of mass is once hands have kept the body from its steps [m], or the base has gone ahead or
back faster than that [m/s]; measured: longer steps come to straight knees, the capture point up to 0.25 m off its plan
in place of 0.05 m, and 5 of 20 realistic robots fell at 0.4 m/s, 0 of 40 lower."""
ASIDE, TILTED = (0.05, 0.09), (0.16, 0.3)
"""Distances of the capture point from its plan [m], and angles of pelvis and torso from where they are to be [rad], at
which hands begin to give way and have given way; measured: in calm walks 49 mm and 0.14 rad at most."""
LEANS = 0.15
"""Tilt of the torso up to which feet are closed [rad]; measured: pushed with hands still it is at 0.15 by then, once at
0.19; hands that were let go of in the middle of the lissajous left it at 0.15 to 0.35, and closing took eight steps or
had no end."""
TOUCHES = 30.0
"""Force of the floor on a sole from which it touches [N]; measured: a sole that comes down has 1 N at most where the
state is true, 14 where the robot is realistic."""


class Walker:
    """Leads a controller through the steps of a walk, palms and trunk with the base that it follows.

    Args:
        controller: The native one.
        gait: Times and lengths; the defaults if not given.

    Attributes:
        walk: The gait; None before `begin`.
        base: Where its base was at `begin`: what is planned for a stand is planned about that.
        in_world: Whether palms are planned in world instead, and not carried.
        low: Whether it walks lower from now on, since its steps are long.
    """

    def __init__(self, controller: WholeBodyController, gait: Gait | None = None) -> None:
        if not isinstance(controller, WholeBodyController):
            raise InputError("only the native backend walks; set `backend: native`")
        self.controller, self.gait = controller, gait or Gait()
        spec, robot = controller.spec, controller.robot
        self._model, self._data = robot.model, robot.model.createData()
        self._frames = [frame_id(self._model, foot.frame) for foot in spec.feet]
        self._middles = [foot.sole_center for foot in spec.feet]
        half = 0.5 * np.ptp(spec.feet[0].points[:, :2], axis=0)
        narrow = 0.5 * min(np.ptp(spec.feet[0].points[i, 1]) for i in ([0, 1], [2, 3]))
        self._sole = Sole(half[0] - EDGE[0], narrow - EDGE[1])
        self._memory, self._planned = (ReferenceMemory(np.zeros(row_length(robot.n_joints))) for _ in range(2))
        self._press = SolePress(spec, self._model)
        self.base = Place(0j, 0.0)
        self.walk: Walk | None = None
        self.in_world = self.low = False

    def begin(self, state: RobotState, weights: Weights = WALKING) -> None:
        """Stand as measured, palms and trunk where they are; steps are made from the next `reference` on."""
        self.walk, self.in_world, self.low = None, False, False
        seen = self._look(state)
        self.walk = Walk(seen, self._sole, self.gait)
        self.base = self.walk.guide.place
        self._height = Course(float(self._com[2]))
        spec = self.controller.spec
        for tool, palm in zip(spec.tools, self._planned.palms, strict=True):
            T = self._data.oMf[frame_id(self._model, tool.palm_frame)]
            palm[:] = 0.0
            palm[:9], palm[9:12] = T.rotation.ravel(), T.translation
        for body, row in ((spec.base_body, self._planned.pelvis), (spec.torso_body, self._planned.torso)):
            row[:] = 0.0
            row[:9] = self._data.oMf[frame_id(self._model, body)].rotation.ravel()
        self._planned.posture[:] = 0.0
        self._planned.posture[0] = state.q[7:]
        self._below, self._floor = float(self._com[2]) - state.q[2], min(seen.heights)
        self.controller.robot.update(state.q, state.v)
        self._feet = self.controller.contacts.feet
        self.controller.weigh(weights)

    def carry_from_here(self) -> None:
        """Carry along, from now on, what is planned about where the base is now."""
        self.base = self.walk.guide.place

    def room(self) -> float:
        """Share of their weight that hands may have: 1 while the body is where the walk has it, down to 0 off it."""
        memory, spec, aside = self._memory, self.controller.spec, abs(self._dcm - self.walk.dcm)
        share = (ASIDE[1] - aside) / (ASIDE[1] - ASIDE[0])
        for body, row in ((spec.base_body, memory.pelvis), (spec.torso_body, memory.torso)):
            R = self._data.oMf[frame_id(self._model, body)].rotation
            tilt = acos(min(max(0.5 * (float(np.sum(R * row[:9].reshape(3, 3))) - 1.0), -1.0), 1.0))
            share = min(share, (TILTED[1] - tilt) / (TILTED[1] - TILTED[0]))
        return min(max(share, 0.0), 1.0)

    def step_that_catches(self, state: RobotState) -> Catch | None:
        """The step that catches a robot that is on both feet; None where none does."""
        seen = self._look(state)
        return choose(seen.dcm, seen.omega, seen.soles, self._sole, self.gait)

    def catch(self, state: RobotState, step: Catch) -> None:
        """Catch the robot with that step, at once."""
        seen = self._look(state)
        self.walk.catch(seen, step)
        self._feet = self._placed(seen)
        self.controller.weigh(RECOVERING)

    @property
    def stands(self) -> bool:
        """Whether both feet stand and no step is to be made."""
        return self.walk is not None and self.walk.state is Phase.STAND and not self.walk.wanted

    @property
    def pelvis_height(self) -> float:
        """Height of the pelvis over a level floor while steps are made [m]."""
        return self._floor + self.gait.height - self._below - LOWER * self.low

    @property
    def palms(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of both palms as they are told to be: rotation (9), position (3), twist and acceleration, (24,) each."""
        return self._memory.palms

    def end(self) -> None:
        """Weigh as a robot that stands."""
        self.controller.weigh(Weights.standing(self.controller.config))

    def reference(self, state: RobotState, elapsed: float, planned: np.ndarray | None = None) -> PackedReference:
        """What the controller follows in a tick.

        Args:
            state: As measured.
            elapsed: Since the last tick [s].
            planned: A packed reference planned for a stand on `base`, whose palms, trunk and posture are carried along;
                those of `begin` if not given.
        """
        walk = self.walk
        gait, pressed = walk.gait, self._press.look(state)
        touching = None if pressed is None else (pressed[0] > TOUCHES, pressed[1] > TOUCHES)
        seen = replace(self._look(state), touching=touching)
        state_before = walk.state
        walk.advance(seen, elapsed)
        if walk.state is not state_before and walk.state is not Phase.STAND:
            self._feet = self._placed(seen)
        if state_before is Phase.RECOVER and walk.state is not Phase.RECOVER:
            self.controller.weigh(WALKING)
        low = walk.state in (Phase.SHIFT, Phase.SWING, Phase.LAND, Phase.RECOVER)
        floor = min(seen.heights) if walk.swing is None else seen.heights[walk.stance]
        aim = floor + gait.height if low else self._standing_height
        self.low = self.low or abs(walk.guide.aim().way.real) > FAST
        aim -= LOWER * (self.low and low)
        self._height = self._height.towards(Course(aim), max(walk.left, 0.3) if not low else 0.4, elapsed)
        row, memory = self._memory.row, self._memory
        row[:] = 0.0
        omega = seen.omega
        push = omega**2 * (complex(*self._com[:2]) - walk.pressure)
        memory.com[:2], memory.com[3:5] = self._com[:2], self._com_velocity[:2]
        memory.com[6:8] = push.real, push.imag
        memory.com[2], memory.com[5], memory.com[8] = self._height.x, self._height.v, self._height.a
        memory.height[:] = self._height.x - self._below, self._height.v, self._height.a
        if planned is not None:
            self._planned.row[:] = planned
        carry(self._planned, self.base, walk.guide, memory, palms=not self.in_world)
        swing = np.zeros((2, PALM)) if walk.swing is not None else None
        if swing is not None:
            self._lead_foot(swing[1 - walk.stance], walk.swing, 1 - walk.stance)
        return PackedReference(row, Contacts(self._feet, walk.load), swing)

    def outline(self) -> np.ndarray:
        """Contact points of both soles in world, a foot that is up where it is to land, shape (n, 2), [m]."""
        points = []
        for sole, foot in zip(self.walk.stands_on, self.controller.spec.feet, strict=True):
            there = (foot.points - foot.sole_center) @ about_z(sole.heading).T
            points.append(there[:, :2] + (sole.point.real, sole.point.imag))
        return np.vstack(points)

    def feet(self, state: RobotState) -> Feet:
        """Both feet as measured, flat on the floor of the walk."""
        seen = self._look(state)
        return self._flat(seen.soles, sum(sole.point for sole in seen.soles) / 2.0, sum(seen.heights) / 2.0)

    def _look(self, state: RobotState) -> WalkReadings:
        model, data = self._model, self._data
        pin.centerOfMass(model, data, state.q, state.v)
        pin.updateFramePlacements(model, data)
        self._com, self._com_velocity = data.com[0].copy(), data.vcom[0].copy()
        soles, heights, tilts = [], [], []
        for frame, middle in zip(self._frames, self._middles, strict=True):
            T = data.oMf[frame]
            x, y, z = (T.rotation @ middle + T.translation).tolist()
            soles.append(Place(complex(x, y), atan2(T.rotation[1, 0], T.rotation[0, 0])))
            heights.append(z)
            tilts.append(-complex(T.rotation[0, 2], T.rotation[1, 2]) / T.rotation[2, 2])
        if self.walk is None:
            self._standing_height = float(self._com[2])
        floor = heights[self.walk.stance] if self.walk is not None else min(heights)
        omega = natural_frequency(float(self._com[2]) - floor)
        dcm = complex(*(self._com[:2] + self._com_velocity[:2] / omega))
        self._dcm = dcm
        torso = data.oMf[frame_id(model, self.controller.spec.torso_body)].rotation
        leans = float(torso[2, 2]) < cos(LEANS)
        return WalkReadings(dcm, omega, tuple(soles), tuple(heights), None, floor_under(tilts), tuple(tilts), leans)

    def _placed(self, seen: WalkReadings) -> Feet:
        """Both feet where the walk has them: a foot that is up where it is to land."""
        stance = self.walk.stance
        return self._flat(self.walk.soles, self.walk.soles[stance].point, seen.heights[stance])

    def _flat(self, soles: Sequence[Place], point: complex, z: float) -> Feet:
        """Feet whose soles are there, on the floor of the walk that is so high at a point [m]."""
        poses, slope = [], self.walk.slope
        for sole, middle in zip(soles, self._middles, strict=True):
            R, height = leaning(slope) @ about_z(sole.heading), z + rise(slope, sole.point - point)
            poses.append(pin.SE3(R, np.array([sole.point.real, sole.point.imag, height]) - R @ middle))
        return Feet.of(poses)

    def _lead_foot(self, row: np.ndarray, swing: Swing, foot: int) -> None:
        """Pose, twist and acceleration of the foot's frame for its sole's."""
        R, middle = leaning(swing.lean.x) @ about_z(swing.heading.x), self._middles[foot]
        back = -(R @ middle)
        arm = complex(*back[:2])
        rate, change = swing.heading.v, swing.heading.a
        place = swing.way.x + arm
        v = swing.way.v + 1j * rate * arm
        a = swing.way.a + (1j * change - rate * rate) * arm
        row[:9], row[9:12] = R.ravel(), (place.real, place.imag, swing.height.x + back[2])
        tilting, changing = swing.lean.v, swing.lean.a
        row[12:15], row[15:18] = (v.real, v.imag, swing.height.v), (tilting.imag, -tilting.real, rate)
        row[18:21], row[21:24] = (a.real, a.imag, swing.height.a), (changing.imag, -changing.real, change)


def walker_for(controller: Controller, config: ControllerConfig) -> Walker | None:
    """Who leads a robot that may step; None for one that never does.

    Raises:
        ConfigError: If `steps` is unknown, or the other settings do not walk.
    """
    if config.steps not in STEPS:
        raise ConfigError(f"steps is '{config.steps}'; it must be one of {', '.join(STEPS)}", setting="steps")
    if config.steps == "never":
        return None
    if not isinstance(controller, WholeBodyController) or config.robot.torque < 1.0:
        raise ConfigError(
            f"steps is '{config.steps}', and only the native backend with robot.torque 1 steps; set `steps: never`",
            setting="steps",
        )
    return Walker(controller)
