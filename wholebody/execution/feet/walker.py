"""From a walk to what the controller follows: contacts, swing, centre of mass, trunk and palms, a tick at a time."""

from __future__ import annotations

from cmath import exp
from math import atan2

import numpy as np
import pinocchio as pin

from models.pinocchio_model import frame_id, stance_q
from wholebody.control.controller import WholeBodyController
from wholebody.control.reference_packet import PALM, PackedReference, ReferenceMemory, row_length
from wholebody.control.weights import WALKING, Weights
from wholebody.errors import InputError
from wholebody.robot.contact_schedule import Contacts
from wholebody.robot.feet import Feet
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.types import RobotState
from wholebody.walking.gait import Gait, Phase
from wholebody.walking.guide import Guide
from wholebody.walking.places import Place
from wholebody.walking.pressure import Sole
from wholebody.walking.swing import Course, Swing
from wholebody.walking.walk import Walk, WalkReadings

EDGE = (0.012, 0.006)
"""Distance of the zero-moment point from the edges of a sole, ahead and to the side [m]; chosen: the sole's own
curvature and half of a centimetre for what is not known."""


class Walker:
    """Leads a controller through the steps of a walk, palms with the base that it follows.

    Args:
        controller: The native one, after its `reset`.
        gait: Times and lengths; the defaults if not given.

    Attributes:
        walk: The gait; None before `begin`.
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
        self._memory = ReferenceMemory(np.zeros(row_length(robot.n_joints)))
        self._stance = stance_q(spec, self._model)
        self.walk: Walk | None = None

    def begin(self, state: RobotState) -> None:
        """Stand as measured, palms and trunk where they are; steps are made from the next `reference` on."""
        seen = self._look(state)
        self.walk = Walk(seen, self._sole, self.gait)
        self._base = self.walk.guide.place
        self._height = Course(float(self._com[2]))
        robot, spec = self.controller.robot, self.controller.spec
        poses = [self._data.oMf[frame_id(self._model, tool.palm_frame)] for tool in spec.tools]
        self._palms = [(T.rotation.copy(), T.translation.copy()) for T in poses]
        turn = _about_z(-self._base.heading)
        bodies = (spec.base_body, spec.torso_body)
        self._trunk = [turn @ self._data.oMf[frame_id(self._model, body)].rotation for body in bodies]
        self._below = float(self._com[2]) - state.q[2]
        self._posture = state.q[7:].copy()
        robot.update(state.q, state.v)
        self._feet = self.controller.contacts.feet
        self.controller.weigh(WALKING)

    @property
    def stands(self) -> bool:
        """Whether both feet stand and no step is to be made."""
        return self.walk is not None and self.walk.state is Phase.STAND and not self.walk.wanted

    @property
    def palms(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of both palms as they are told to be: rotation (9), position (3), twist and acceleration, (24,) each."""
        return self._memory.palms

    def end(self) -> None:
        """Weigh as a robot that stands."""
        self.controller.weigh(Weights.standing(self.controller.config))

    def reference(self, state: RobotState, elapsed: float) -> PackedReference:
        """What the controller follows in a tick.

        Args:
            state: As measured.
            elapsed: Since the last tick [s].
        """
        walk, gait = self.walk, self.gait
        seen = self._look(state)
        state_before = walk.state
        walk.advance(seen, elapsed)
        if walk.state is not state_before and walk.state is not Phase.STAND:
            self._feet = self._placed(seen)
        low = walk.state in (Phase.SHIFT, Phase.SWING, Phase.LAND)
        floor = min(seen.heights) if walk.swing is None else seen.heights[walk.stance]
        aim = floor + gait.height if low else float(self._height_standing(floor))
        self._height = self._height.towards(Course(aim), max(walk.left, 0.3) if not low else 0.4, elapsed)
        row, memory = self._memory.row, self._memory
        row[:] = 0.0
        omega = seen.omega
        push = omega**2 * (complex(*self._com[:2]) - walk.pressure)
        memory.com[:2], memory.com[3:5] = self._com[:2], self._com_velocity[:2]
        memory.com[6:8] = push.real, push.imag
        memory.com[2], memory.com[5], memory.com[8] = self._height.x, self._height.v, self._height.a
        memory.height[:] = self._height.x - self._below, self._height.v, self._height.a
        self._lead_trunk(walk.guide)
        self._lead_palms(walk.guide)
        memory.posture[0] = self._posture
        swing = np.zeros((2, PALM)) if walk.swing is not None else None
        if swing is not None:
            self._lead_foot(swing[1 - walk.stance], walk.swing, 1 - walk.stance)
        return PackedReference(row, Contacts(self._feet, walk.load), swing)

    def _height_standing(self, floor: float) -> float:
        return self._standing_height

    def _look(self, state: RobotState) -> WalkReadings:
        model, data = self._model, self._data
        pin.centerOfMass(model, data, state.q, state.v)
        pin.updateFramePlacements(model, data)
        self._com, self._com_velocity = data.com[0].copy(), data.vcom[0].copy()
        soles, heights = [], []
        for frame, middle in zip(self._frames, self._middles, strict=True):
            T = data.oMf[frame]
            x, y, z = (T.rotation @ middle + T.translation).tolist()
            soles.append(Place(complex(x, y), atan2(T.rotation[1, 0], T.rotation[0, 0])))
            heights.append(z)
        if self.walk is None:
            self._standing_height = float(self._com[2])
        floor = heights[self.walk.stance] if self.walk is not None else min(heights)
        omega = natural_frequency(float(self._com[2]) - floor)
        dcm = complex(*(self._com[:2] + self._com_velocity[:2] / omega))
        return WalkReadings(dcm, omega, tuple(soles), tuple(heights), state.stands)

    def _placed(self, seen: WalkReadings) -> Feet:
        """Both feet where the walk has them: a foot that is up where it is to land."""
        poses = []
        for foot, sole in enumerate(self.walk.soles):
            R = _about_z(sole.heading)
            point = np.array([sole.point.real, sole.point.imag, seen.heights[self.walk.stance]])
            poses.append(pin.SE3(R, point - R @ self._middles[foot]))
        return Feet.of(poses)

    def _lead_trunk(self, guide: Guide) -> None:
        turn = _about_z(guide.place.heading)
        for part, R in zip((self._memory.pelvis, self._memory.torso), self._trunk, strict=True):
            part[:9] = (turn @ R).ravel()
            part[11], part[14] = guide.velocity.turn, guide.change[1]

    def _lead_palms(self, guide: Guide) -> None:
        """Palms go with the base, with its velocity and acceleration."""
        base, (velocity, acceleration) = self._base, guide.motion()
        angle, rate, change = guide.place.heading - base.heading, guide.velocity.turn, guide.change[1]
        turn = _about_z(angle)
        for row, (R, point) in zip(self._memory.palms, self._palms, strict=True):
            arm = (complex(*point[:2]) - base.point) * exp(1j * angle)
            place = guide.place.point + arm
            v = velocity + 1j * rate * arm
            a = acceleration + (1j * change - rate * rate) * arm
            row[:9], row[9:12] = (turn @ R).ravel(), (place.real, place.imag, point[2])
            row[12:14], row[17] = (v.real, v.imag), rate
            row[18:20], row[23] = (a.real, a.imag), change

    def _lead_foot(self, row: np.ndarray, swing: Swing, foot: int) -> None:
        """Pose, twist and acceleration of the foot's frame for its sole's."""
        R, middle = _about_z(swing.heading.x), self._middles[foot]
        back = -(R @ middle)
        arm = complex(*back[:2])
        rate, change = swing.heading.v, swing.heading.a
        place = swing.way.x + arm
        v = swing.way.v + 1j * rate * arm
        a = swing.way.a + (1j * change - rate * rate) * arm
        row[:9], row[9:12] = R.ravel(), (place.real, place.imag, swing.height.x + back[2])
        row[12:15], row[17] = (v.real, v.imag, swing.height.v), rate
        row[18:21], row[23] = (a.real, a.imag, swing.height.a), change


def _about_z(angle: float) -> np.ndarray:
    """Rotation about the vertical, shape (3, 3)."""
    turn = exp(1j * angle)
    c, s = turn.real, turn.imag
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
