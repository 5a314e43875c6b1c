"""The robot and its shapes as tables for the compiled plan, from Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import lru_cache

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, palm_frame_ids, stance_q
from models.spec import RobotSpec
from wholebody.collision import gjk
from wholebody.collision.floor_clearance import FloorClearance
from wholebody.collision.proximity import Proximity
from wholebody.collision.shapes import ShapeTable, shape_table
from wholebody.config import ControllerConfig, TrajectoryConfig
from wholebody.errors import InputError
from wholebody.robot.body_table import body_table
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.feet import Feet
from wholebody.robot.hand_loads import HandLoads
from wholebody.robot.kernels.bodies import PLACEMENT_P
from wholebody.robot.kernels.frames import PALM_FRAME, SOLE_FRAME
from wholebody.trajopt.arrays import Shapes, Tables
from wholebody.trajopt.footing import Footing
from wholebody.trajopt.layout import LOWER, N_FLOOR, N_JOINTS, UPPER, WAIST
from wholebody.trajopt.limbs import ARM, real, with_room

ARM_ROOM = 0.1
"""Share of the torque of an arm that plans leave for each kg of its load, up to 1 kg; chosen: a plan may exceed its
bound by 0.08, and where that is all that the program has, no hand is held."""
BETWEEN_SHARE = 0.95
"""Share of what a motor gives that plans ask for between knots at most; chosen: what the cost buys beyond it, twice the
scale of the bound, is still given."""
IDLE = 1e3
"""Bound of all that a joint that the robot lacks could do [rad, rad/s, rad/s^2, N m]; chosen: it stays at zero, and is
never the one with the least room."""


class RobotTables:
    """The robot without its fingers, on feet that stand: where the stance has them, or where `stand_on` is told.

    Configurations and velocities here are the body's, (36,) and (35,): the fingers are locked in the dynamics, and
    where the caller has them for the distances. Joints that a robot lacks are there, and idle (`limbs`).

    Args:
        spec: The robot. config: Limits and margins. friction: Coefficient that the controller counts on.
        force_min: Least normal force that the controller keeps at each contact point [N].

    Attributes:
        spec: The robot. model: Pinocchio's model of the body, with room for all limbs.
        full: The robot's own model, with fingers.
        real: Which of the joints of the body the robot has, shape (29,).
        fingers: Entries of the fingers in the full configuration, hand by hand.
        finger_order: Which of those the fingers are in the order of their bodies.
        footing: Where it stands.
        mass: Of the robot with what it carries [kg]. foot_load_min: Least share of the weight on each foot.
        tables, shapes: What compiled code works on.
        proximity: Distances by coal, for shapes that touch.
    """

    def __init__(
        self,
        spec: RobotSpec,
        config: TrajectoryConfig,
        friction: float = ControllerConfig.friction,
        force_min: float = ControllerConfig.force_min,
    ) -> None:
        full = self.full = load_pinocchio(spec)
        self.q_full = stance_q(spec, full)
        names = list(full.names)
        locked = [i for i, name in enumerate(names) if name not in spec.body_joints and i > 1]
        model = self.model = with_room(spec, pin.buildReducedModel(full, locked, self.q_full))
        self.data, self.palms, self.real = model.createData(), palm_frame_ids(spec, model), real(model)
        kept = np.array([names.index(name) - 2 if name in names else 0 for name in list(model.names)[2:]])
        self._entries, self._columns = (np.concatenate([np.arange(n), n + kept]) for n in (7, 6))
        self.fingers = np.array([7 + names.index(n) - 2 for tool in spec.tools for n in tool.finger_joints], int)
        self.finger_order = np.argsort(self.fingers, kind="stable")
        self._loads, self.mass = HandLoads(spec, model), float(pin.computeTotalMass(full))
        points = max(len(foot.points) for foot in spec.feet)
        self.foot_load_min = points * force_min / (self.mass * float(np.linalg.norm(full.gravity.linear)))
        self.spec, self._config, self._friction = spec, config, friction
        q = self.body_of(self.q_full)
        there = ContactSchedule.standing(Feet.at(spec, model, q, self.data))
        self.footing = Footing.of(spec, there, self.foot_load_min)
        placed = self.footing.tables(config, friction, self.foot_load_min)
        self.tables = _tables(spec, config, model, q, self.mass, placed)
        self._tau_max = self._full_tau_max = self.tables.tau_max.copy()
        self._arms = [slice(WAIST, WAIST + ARM), slice(WAIST + ARM, UPPER)]
        bodies = self._place_fingers(locked)
        self.proximity = Proximity(spec, full, None, self.q_full, config.self_distance)
        table = shape_table(spec, self.proximity.geometry)
        low = _low(FloorClearance(spec, full, self.proximity.geometry), table, bodies, self.tables, config)
        self.shapes = _shapes(table, bodies, self.proximity, low)

    @classmethod
    def of(cls, spec: RobotSpec, config: TrajectoryConfig, friction: float, force_min: float) -> RobotTables:
        """Cached tables of the last robot, as a copy whose loads and feet can be changed: 1 ms, not 80."""
        made = _made(spec, config, friction, force_min)
        other, t = copy(made), made.tables
        other.model, other.proximity = made.model.copy(), made.proximity.copy()
        other.data, other._loads = other.model.createData(), HandLoads(spec, other.model)
        other.tables = t._replace(bodies=t.bodies.copy(), tau_max=t.tau_max.copy(), between_max=t.between_max.copy())
        return other

    def body_of(self, q: np.ndarray) -> np.ndarray:
        """Configurations of the body (..., 36) in those of the robot (..., nq); joints that it lacks are at 0."""
        # Row after row in memory, however many there are: kernels are compiled for the layout that they see first.
        body = q.take(self._entries, axis=-1)
        body[..., 7:][..., ~self.real] = 0.0
        return body

    def rates_of(self, v: np.ndarray) -> np.ndarray:
        """Velocities of the body (..., 35) in those of the robot (..., nv)."""
        body = v.take(self._columns, axis=-1)
        body[..., 6:][..., ~self.real] = 0.0
        return body

    def put(self, q: np.ndarray, body: np.ndarray) -> None:
        """Write configurations of the body (..., 36) into those of the robot (..., nq)."""
        has = np.concatenate([np.ones(7, dtype=bool), self.real])
        q[..., self._entries[has]] = body[..., has]

    def put_rates(self, v: np.ndarray, body: np.ndarray) -> None:
        """Write velocities of the body (..., 35) into those of the robot (..., nv)."""
        has = np.concatenate([np.ones(6, dtype=bool), self.real])
        v[..., self._columns[has]] = body[..., has]

    @property
    def effort_max(self) -> np.ndarray:
        """Torques that the motors of waist and arms give, whatever hands carry, shape (UPPER,), [N m]."""
        return self._tau_max / self._config.torque_share

    def carry(self, loads: Sequence[float]) -> None:
        """Count on these masses in the left and right hand from now on [kg]."""
        self._loads.carry(loads, self.tables.bodies)
        self.mass = self._loads.total
        self.tables.tau_max[:], self.tables.between_max[:] = self._tau_max, BETWEEN_SHARE * self.effort_max
        for arm, load in zip(self._arms, loads, strict=True):
            self.tables.tau_max[arm] = (1.0 - ARM_ROOM * min(load, 1.0)) * self._tau_max[arm]
        self.tables = self.tables._replace(mass=self.mass)

    def weaken(self, torques: np.ndarray | None) -> None:
        """Shares of their torques that motors have from the next `carry` on, motor order (n_joints,); None for all."""
        self._tau_max = self._full_tau_max
        if torques is not None:
            of = dict(zip(self.spec.joint_names, torques.tolist(), strict=True))
            upper = list(self.model.names)[-len(self._tau_max) :]
            self._tau_max = self._full_tau_max * [of.get(name, 1.0) for name in upper]

    def stand_on(self, contacts: ContactSchedule) -> None:
        """The feet are there from now on; an `InputError` for a schedule in which one steps."""
        self.footing = Footing.of(self.spec, contacts, self.foot_load_min)
        q = self.body_of(self.footing.feet.stance(self.spec, self.full))
        floor, c = self.shapes.floor.copy(), self._config
        floor[0] = c.floor_distance + self.footing.floor.rise
        self.shapes = self.shapes._replace(floor=floor)
        self.tables = self.tables._replace(
            q_stance=q,
            com_stance=self._com_stance_bare(q),
            **self.footing.tables(c, self._friction, self.foot_load_min),
        )

    def _com_stance_bare(self, q: np.ndarray) -> np.ndarray:
        """Centre of mass of the stance with empty hands, whatever they carry now."""
        carried = self._loads.present
        self._loads.carry((0.0, 0.0))
        com = _com_stance(self.model, self.data, q)
        self._loads.carry(carried)
        return com

    def _place_fingers(self, locked: list[int]) -> np.ndarray:
        """Put the fingers behind the bodies of the plan; the plan's number of each body of the full model."""
        table, parent = body_table(self.full)
        fingers = np.array(locked, dtype=int) - 1
        number = np.array([0] + [self.model.getJointId(name) - 1 for name in list(self.full.names)[2:]])
        number[fingers] = 1 + N_JOINTS + np.arange(len(fingers))
        self.tables = self.tables._replace(
            bodies=np.concatenate([self.tables.bodies, table[fingers]]),
            parent=np.concatenate([self.tables.parent, number[parent[fingers]]]),
        )
        return number


@lru_cache(maxsize=1)
def _made(spec: RobotSpec, config: TrajectoryConfig, friction: float, force_min: float) -> RobotTables:
    return RobotTables(spec, config, friction, force_min)


def _tables(
    spec: RobotSpec, c: TrajectoryConfig, model: pin.Model, q: np.ndarray, mass: float, placed: dict[str, np.ndarray]
) -> Tables:
    """Without fingers, in the stance ``q``; ``placed`` is what `Footing` says."""
    bodies, parent = body_table(model)
    ids = [*(model.getFrameId(foot.frame) for foot in spec.feet), *palm_frame_ids(spec, model)]
    ids += [model.getFrameId(name) for name in (spec.base_body, spec.torso_body)]
    frames = [model.frames[i] for i in ids]
    carries = _carries(model, [frame.parentJoint for frame in frames])
    feet = carries[SOLE_FRAME:PALM_FRAME]
    if feet[:, LOWER:].any() or not feet[:, :LOWER].any(0).all():
        raise InputError(f"the optimiser needs legs that move the feet of {spec.name}, and nothing else that does")
    return Tables(
        bodies=bodies,
        parent=parent,
        frame_body=np.array([frame.parentJoint - 1 for frame in frames]),
        frame_R=np.array([frame.placement.rotation for frame in frames]),
        frame_p=np.array([frame.placement.translation for frame in frames]),
        carries=carries,
        q_stance=q,
        com_stance=_com_stance(model, model.createData(), q),
        gravity=np.array(model.gravity.linear),
        mass=mass,
        load_min=c.load_min,
        limits=np.array([c.torso_tilt, c.pelvis_tilt, c.height_min]),
        **_limits(spec, c, list(model.names[2:])),
        capture_time=c.capture_time,
        approach_time=c.approach_time,
        **placed,
    )


def _com_stance(model: pin.Model, data: pin.Data, q: np.ndarray) -> np.ndarray:
    """Where the centre of mass of a configuration is over the floor, shape (2,), [m]."""
    return pin.centerOfMass(model, data, q)[:2].copy()


def _carries(model: pin.Model, joints: list[int]) -> np.ndarray:
    """Which velocities move a body, shape (len(joints), nv)."""
    out = np.zeros((len(joints), model.nv), dtype=bool)
    for row, parent in zip(out, joints, strict=True):
        for joint in list(model.supports[parent])[1:]:
            start = model.joints[joint].idx_v
            row[start : start + model.joints[joint].nv] = True
    return out


def _limits(spec: RobotSpec, c: TrajectoryConfig, names: list[str]) -> dict[str, np.ndarray]:
    """Bounds on the joints, in their order, that the plan uses."""
    has = np.array([name in spec.joint_names for name in names])
    order = np.array([spec.joint_names.index(name) if name in spec.joint_names else 0 for name in names])
    low, high, speed, acceleration, torque = (
        np.where(has, values[order], IDLE)
        for values in (-spec.position_min, spec.position_max, spec.velocity_max, spec.acceleration_max, spec.effort_max)
    )
    q_min, q_max = -low + c.joint_margin, high - c.joint_margin
    q_min[has & spec.parts("knee")[order]] = c.knee_min
    elbows = has & spec.parts("elbow")[order]
    q_max[elbows] = np.minimum(q_max[elbows], c.elbow_max)
    waist = np.isin(np.arange(N_JOINTS), N_JOINTS - UPPER + np.arange(WAIST))
    return {
        "q_min": q_min,
        "q_max": q_max,
        "speed_max": c.speed_share * speed,
        "acceleration_max": np.minimum(
            np.where(has, np.where(waist, c.waist_acceleration, c.acceleration), IDLE), acceleration
        ),
        "tau_max": c.torque_share * torque[N_JOINTS - UPPER :],
        "between_max": BETWEEN_SHARE * torque[N_JOINTS - UPPER :],
    }


def _low(
    underside: FloorClearance, table: ShapeTable, number: np.ndarray, tables: Tables, c: TrajectoryConfig
) -> tuple[np.ndarray, ...]:
    """What `Shapes` says of bodies that can reach the floor."""
    if len(underside.labels) > N_FLOOR:
        raise InputError(f"{len(underside.labels)} bodies below the elbows; the optimiser has room for {N_FLOOR}")
    bodies = number[underside.joints - 1]
    anchor, reach = bodies.copy(), underside.reach.copy()
    while (anchor > N_JOINTS).any():
        fingers = anchor > N_JOINTS
        reach[fingers] += np.linalg.norm(tables.bodies[anchor[fingers], PLACEMENT_P : PLACEMENT_P + 3], axis=1)
        anchor[fingers] = tables.parent[anchor[fingers]]
    first = table.shapes[underside.shapes, gjk.FIRST]
    return bodies, anchor, reach, first, np.array([c.floor_distance, c.floor_trigger])


def _shapes(table: ShapeTable, number: np.ndarray, proximity: Proximity, low: tuple[np.ndarray, ...]) -> Shapes:
    """Shapes on the plan's bodies, with spheres and boxes around them."""
    shapes = table.shapes.copy()
    shapes[:, gjk.BODY] = number[shapes[:, gjk.BODY]]
    centre, half, radius = np.zeros((len(shapes), 3)), np.zeros((len(shapes), 3)), np.zeros(len(shapes))
    for i, ((kind, first, count, _), around) in enumerate(zip(shapes, table.rounds, strict=True)):
        points = table.vertices[first : first + count]
        if kind != gjk.HULL:
            axis = around[gjk.AXIS : gjk.AXIS + 3] * around[gjk.HALF_LENGTH]
            points = around[:3] + np.array([axis, -axis])
        grown = 0.0 if kind == gjk.HULL else around[gjk.RADIUS]
        centre[i] = 0.5 * (points.max(0) + points.min(0))
        half[i] = 0.5 * (points.max(0) - points.min(0)) + grown
        radius[i] = np.linalg.norm(points - centre[i], axis=1).max() + grown
    return Shapes(
        shapes, table.rounds, table.vertices, table.start, table.neighbours, centre, half, radius,
        proximity.pairs.astype(np.int64), proximity.margin, *low,
    )  # fmt: skip
