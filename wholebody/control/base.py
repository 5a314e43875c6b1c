"""What every controller has: tasks that read their references where its program does, and feet that stay."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.contacts.foot import FootContact
from wholebody.control.reference_packet import BodyReference, PackedReference, ReferenceMemory, row_length
from wholebody.control.task_set import make_feet, make_tasks
from wholebody.control.tick_report import TickReport
from wholebody.control.torque_share import TorqueShare
from wholebody.errors import StateError
from wholebody.limits.balance import CapturePointLimit
from wholebody.qp.compiled_program import CompiledBody
from wholebody.robot.contact_schedule import Contacts
from wholebody.robot.feet import Feet
from wholebody.robot.state import Robot
from wholebody.robot.support_polygon import SupportPolygon, convex_polygon
from wholebody.robot.touch import FORCE, PUSH_MAX, SHARE, TOUCH
from wholebody.types import JointCommand, RobotState

INTEGRATED_MAX = 0.02
"""Longest time over which a tick integrates [s]; chosen: ten periods at 500 Hz. After a longer gap the robot is
elsewhere than its last command said."""


class Controller(ABC):
    """Tasks, contacts and support of one robot, for a controller to build its program from.

    Attributes:
        tasks: By name.
        balance: The support, and how to keep inside; no support before the first reset.
        contacts: Which feet stand, and where; None before the first reset.
        compiled: The program in compiled form, or None: then the readable one is solved.
        swings: Whether a foot that is up follows a swing that the reference has.
        touch: What both hands feel, rows as in `wholebody.robot.touch`, shape (2, TOUCH).
        lean: How far the centre of mass is leant against it, shape (2,), [m].
        braced: How many times more the place of the centre of mass weighs then, shape (1,).
        tipped: How far it moves the centre of pressure, shape (2,), [m].
        tau: Feed-forward torques of the last tick, Pinocchio order, shape (n_joints,), [N m].
        command: What the last tick sent; None after a reset.
        effort_max: Torques that motors have, tau_max: those that the program uses, Pinocchio order, (n_joints,), [N m].
        added: Torques that are sent beside those of the program, motor order, shape (n_joints,), [N m]; None for none.
        factor: Of those of the program then, shape (n_joints,).
    """

    def __init__(self, spec: RobotSpec, config: ControllerConfig) -> None:
        self.spec, self.config, self.robot = spec, config, Robot(spec)
        self.effort_max = spec.effort_max[self.robot.motor_to_pin]
        self.tau_max = config.safety.torque_share * self.effort_max
        self.tasks, self.feet = make_tasks(spec, config, self.robot), make_feet(spec, config)
        self.palms = self.tasks.palms
        self.balance = CapturePointLimit(margin=config.safety.balance_margin, gain=config.safety.balance_gain)
        self.compiled: CompiledBody | None = None
        self._elapsed, self.swings = config.dt, False
        self.contacts: Contacts | None = None
        self.command: JointCommand | None = None
        self.added: np.ndarray | None = None
        self.factor: np.ndarray | None = None
        self._share = TorqueShare(spec, config.robot.torque) if config.robot.torque < 1.0 else None
        self.touch, self.lean, self.tipped, self.braced = np.zeros((2, TOUCH)), *np.zeros((2, 2)), np.zeros(1)

    def bind_references(self) -> None:
        """Tasks read their references where the program does."""
        compiled = self.compiled
        if compiled is not None:
            tick = compiled.tick
            self.touch, self.lean, self.tipped, self.braced = tick.touch, tick.lean, tick.tipped, tick.braced
        row = np.zeros(row_length(self.robot.n_joints)) if compiled is None else compiled.reference
        trust = np.ones(2) if compiled is None else compiled.trust
        memory = self._reference = ReferenceMemory(row)
        swing = np.zeros((len(self.feet), 24)) if compiled is None else compiled.tick.foot_ref
        self._swing = swing
        for foot, row_of_foot in zip(self.tasks.feet, swing, strict=True):
            foot.bind(row_of_foot)
        for i, palm in enumerate(self.palms):
            palm.bind(memory.palms[i], trust[i : i + 1], self.touch[i])
        self.tasks.com.bind(memory.com, self.lean, self.braced)
        self.balance.tipped = self.tipped
        for name in ("momentum", "pelvis", "torso", "height", "posture"):
            getattr(self.tasks, name).bind(getattr(memory, name))

    def set_reference(self, reference: BodyReference | PackedReference) -> None:
        """Hand a reference to the tasks and stand as it says; an `InputError` if a number of it is not finite."""
        self._reference.take(reference)
        contacts = reference.contacts
        if contacts is not None and not (self.contacts is contacts or contacts.same(self.contacts)):
            self.stand_on(contacts) if self._anew(contacts) else self._relieve(contacts)
        if (reference.swing is not None) != self.swings:
            self._lead(reference.swing is not None)
        if self.swings:
            self._swing[:] = reference.swing

    def step(
        self, state: RobotState, reference: BodyReference | PackedReference, elapsed: float | None = None
    ) -> tuple[JointCommand, TickReport]:
        """One tick.

        Args:
            state: Measured state; finite, and not changed afterwards.
            reference: What to follow.
            elapsed: Time since the last tick [s], over which the answer is integrated, at most `INTEGRATED_MAX`; the
                control period if not given.

        Raises:
            StateError: If the controller was never reset.
            InputError: If a number of the reference is not finite.
        """
        _ = self.support
        self.set_reference(reference)
        self._elapsed = self.config.dt if elapsed is None else min(elapsed, INTEGRATED_MAX)
        command, report = self._tick(state)
        if self.added is not None:
            command = replace(command, tau=command.tau * self.factor + self.added)
        self.command = command if self._share is None else self._share.of(command)
        return self.command, report

    @property
    def support(self) -> SupportPolygon:
        """Convex hull of the soles that stand; a `StateError` before the first reset."""
        if self.balance.support is None:
            raise StateError("`step` before `reset`: the controller does not know yet where the feet stand")
        return self.balance.support

    def set_down(self, q: np.ndarray, v: np.ndarray) -> None:
        """Keep the feet from now on where a configuration (nq,) has them; torques hold gravity and ``v``."""
        robot, self.command = self.robot, None
        robot.update(q, v)
        self.tau = robot.nle[6:].copy()
        self._keep_feet(Contacts(Feet.of(robot.pose(foot.frame) for foot in self.feet)))
        if self.compiled is not None:
            self.compiled.palms[:] = self._palm_frames() - q[:3]
            self.compiled.q[:] = q

    def stand_on(self, contacts: Contacts) -> None:
        """The feet that stand stay there from now on, on the floor that they make; the others may move."""
        self._keep_feet(contacts)
        self.stand_on_floor(contacts.feet)

    def _anew(self, contacts: Contacts) -> bool:
        """Whether others of the feet stand than before, or elsewhere; else only what each may carry has changed."""
        before = self.contacts
        return before is None or before.stands != contacts.stands or not contacts.feet.same(before.feet)

    def _lead(self, swings: bool) -> None:
        """Whether a foot that is up follows a swing from now on, or moves as suits the rest."""
        self.swings = swings
        if self.compiled is not None:
            self.compiled.tick.swings = swings

    def _relieve(self, contacts: Contacts) -> None:
        """Each foot has its share of the load from now on; the same ones stand."""
        self.contacts = contacts
        for foot, load in zip(self.feet, contacts.load, strict=True):
            foot.load = load
        if self.compiled is not None:
            self.compiled.bound_loads()

    def stand_on_floor(self, feet: Feet) -> None:
        """Count on the floor that these feet make: friction about its normal, and how high it comes where hands do."""
        for foot in self.feet:
            foot.slope(feet.floor(self.spec).slope)

    @property
    def standing(self) -> list[FootContact]:
        """Contacts of the feet that stand."""
        return [foot for foot in self.feet if foot.load > 0.0]

    def _keep_feet(self, contacts: Contacts) -> None:
        """The feet that stand stay where they are, inside whose outline the robot balances."""
        self.contacts = contacts
        for foot, T, load in zip(self.feet, contacts.feet.poses, contacts.load, strict=True):
            foot.T_world_ref, foot.load = T, load
        places = [(foot.points, foot.T_world_ref) for foot in self.standing]
        points = np.vstack([points @ T.rotation.T + T.translation for points, T in places])
        self.balance.support = convex_polygon(points[:, :2])
        if self.compiled is not None:
            self.compiled.reset()

    def carry(self, loads: Sequence[float]) -> None:
        """Count on these masses in the left and right hand from the next tick on [kg]."""
        self.robot.loads.carry(loads, *([] if self.compiled is None else [self.compiled.tick.bodies]))

    def limit_torques(self, most: np.ndarray) -> None:
        """Motors have no more than this from the next tick on, motor order, shape (n_joints,), [N m]."""
        self.effort_max[:] = most[self.robot.motor_to_pin]
        self.tau_max[:] = self.config.safety.torque_share * self.effort_max

    @abstractmethod
    def reset(self, state: RobotState) -> None:
        """Start from a measured state: the feet stay where they are."""

    @abstractmethod
    def _tick(self, state: RobotState) -> tuple[JointCommand, TickReport]:
        """Follow the reference for one tick."""

    def pushed(self) -> np.ndarray:
        """Generalised force of what the hands feel, at the last `Robot.update`, shape (nv,)."""
        force = np.zeros(self.robot.nv)
        for palm, touch in zip(self.palms, self.touch, strict=True):
            if touch[SHARE] > 0.0:
                force += self.robot.jacobian(palm.frame).T @ touch[FORCE:PUSH_MAX]
        return force

    def palm_positions(self) -> np.ndarray:
        """Palm points in world at the configuration that the last tick began with, shape (2, 3), [m]."""
        compiled = self.compiled
        return self._palm_frames() if compiled is None else compiled.palms + compiled.q[:3]

    def _palm_frames(self) -> np.ndarray:
        return np.array([self.robot.pose(palm.frame).translation for palm in self.palms])

    def trust_hands(self, left: float, right: float) -> None:
        """Weigh the hands by these from now on, 0 to 1."""
        for palm, trust in zip(self.palms, (left, right), strict=True):
            palm.trust = trust
