"""The robot and its shapes as tables for the compiled plan, from Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, palm_frame_ids, stance_q
from models.spec import RobotSpec
from wholebody.collision import gjk
from wholebody.collision.floor_clearance import FloorClearance
from wholebody.collision.proximity import Proximity
from wholebody.collision.shapes import ShapeTable, shape_table
from wholebody.config import ControllerConfig, TrajectoryConfig
from wholebody.contacts.friction import pyramid_slope
from wholebody.errors import InputError
from wholebody.planning.trajopt.arrays import Shapes, Tables
from wholebody.planning.trajopt.layout import LOWER, N_BODY, N_FLOOR, N_JOINTS, UPPER
from wholebody.robot.body_table import body_table
from wholebody.robot.hand_loads import HandLoads
from wholebody.robot.kernels.bodies import PLACEMENT_P
from wholebody.robot.support_polygon import SupportPolygon, convex_polygon

HALF_SOLE = 0.1
"""Lever at which a moment counts as much as a force [m]; from the URDF: half of the G1's sole of 0.17 m, rounded."""

ARM_ROOM = 0.1
"""Share of the torque of an arm that plans leave for each kg of its load, up to 1 kg; chosen: a plan may exceed its
bound by 0.08, and where that is all that the program has, no hand is held."""


class RobotTables:
    """The robot without its fingers, whose feet stay where the stance has them.

    Configurations and velocities here are the body's, (36,) and (35,): the fingers are locked in the dynamics, and
    where the caller has them for the distances.

    Args:
        spec: The robot. config: Limits and margins. friction: Coefficient that the controller counts on.
        force_min: Least normal force that the controller keeps at each contact point [N].

    Attributes:
        model: Pinocchio's model of the body.
        full: The model with fingers.
        body: Entries of the body in the full configuration. columns: The same in the full velocity.
        fingers: Entries of the fingers in the full configuration, hand by hand.
        finger_order: Which of those the fingers are in the order of their bodies.
        support: The support polygon. pressure_offsets: How far the centre of pressure goes towards its edges [m].
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
        locked = [i for i, name in enumerate(names) if "_hand_" in name]
        model = self.model = pin.buildReducedModel(full, locked, self.q_full)
        self.data, self.palms = model.createData(), palm_frame_ids(spec, model)
        kept = [i - 2 for i in range(2, len(names)) if i not in locked]
        self.body, self.columns = (np.concatenate([np.arange(n), n + np.array(kept)]) for n in (7, 6))
        self.fingers = np.array([7 + names.index(n) - 2 for tool in spec.tools for n in tool.finger_joints], int)
        self.finger_order = np.argsort(self.fingers, kind="stable")
        self._loads, self.mass = HandLoads(spec, model), float(pin.computeTotalMass(full))
        points = max(len(foot.points) for foot in spec.feet)
        self.foot_load_min = points * force_min / (self.mass * float(np.linalg.norm(full.gravity.linear)))
        self.tables, self.support, self.pressure_offsets = _tables(
            spec, config, friction, model, self.q_full[self.body].copy(), self.mass, self.foot_load_min
        )
        self._tau_max, upper = self.tables.tau_max.copy(), list(model.names)[2 + N_JOINTS - UPPER :]
        self._arms = [np.array([name.startswith(f"{tool.side}_") for name in upper]) for tool in spec.tools]
        bodies = self._place_fingers(locked)
        self.proximity = Proximity(spec, full, None, self.q_full, config.self_distance)
        table = shape_table(spec, self.proximity.geometry)
        low = _low(FloorClearance(full, self.proximity.geometry), table, bodies, self.tables, config)
        self.shapes = _shapes(table, bodies, self.proximity, low)

    def carry(self, loads: Sequence[float]) -> None:
        """Count on these masses in the left and right hand from now on [kg]."""
        self._loads.carry(loads, self.tables.bodies)
        self.mass = self._loads.total
        for arm, load in zip(self._arms, loads, strict=True):
            self.tables.tau_max[arm] = (1.0 - ARM_ROOM * min(load, 1.0)) * self._tau_max[arm]
        self.tables = self.tables._replace(mass=self.mass)

    def _place_fingers(self, locked: list[int]) -> np.ndarray:
        """Put the fingers behind the bodies of the plan; the plan's number of each body of the full model."""
        table, parent = body_table(self.full)
        order = [i - 1 for i in range(1, self.full.njoints) if i not in locked] + [i - 1 for i in locked]
        number = np.argsort(order)
        fingers = np.array(locked, dtype=int) - 1
        self.tables = self.tables._replace(
            bodies=np.concatenate([self.tables.bodies, table[fingers]]),
            parent=np.concatenate([self.tables.parent, number[parent[fingers]]]),
        )
        return number


def _tables(
    spec: RobotSpec, c: TrajectoryConfig, friction: float, model: pin.Model, q: np.ndarray, mass: float, least: float
) -> tuple[Tables, SupportPolygon, np.ndarray]:
    """Without fingers; the support, and how far the centre of pressure goes towards its edges."""
    bodies, parent = body_table(model)
    ids = [*palm_frame_ids(spec, model), *(model.getFrameId(name) for name in (spec.torso_body, spec.base_body))]
    ids += [model.getFrameId(foot.frame) for foot in spec.feet]
    frames = [model.frames[i] for i in ids]
    carries = _carries(model, [frame.parentJoint for frame in frames])
    if model.nv != N_BODY or carries[4:, LOWER:].any() or not carries[4:, :LOWER].any(0).all():
        raise InputError(
            f"the optimiser needs {N_BODY} velocities, base and legs first, as the G1 has them: {spec.name} has "
            f"{model.nv}, '{list(model.names)[2]}' first"
        )
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    feet = [data.oMf[i] for i in ids[4:]]
    corners = [[foot.act(np.array(x))[:2] for x in part.points] for foot, part in zip(feet, spec.feet, strict=True)]
    support = convex_polygon(np.concatenate(corners))
    pressure = _pressure_offsets(support, *np.array(corners), least)
    tables = Tables(
        bodies=bodies,
        parent=parent,
        frame_body=np.array([frame.parentJoint - 1 for frame in frames]),
        frame_R=np.array([frame.placement.rotation for frame in frames]),
        frame_p=np.array([frame.placement.translation for frame in frames]),
        carries=carries,
        R_feet=np.array([foot.rotation for foot in feet]),
        p_feet=np.array([foot.translation for foot in feet]),
        q_stance=q,
        com_stance=pin.centerOfMass(model, data, q)[:2].copy(),
        gravity=np.array(model.gravity.linear),
        mass=mass,
        load_min=c.load_min,
        limits=np.array([c.torso_tilt, c.pelvis_tilt, c.height_min]),
        **_limits(spec, c, list(model.names[2:])),
        normals=support.normals.copy(),
        com_offsets=support.offsets - c.com_margin,
        zmp_offsets=pressure - c.zmp_margin,
        capture_offsets=pressure - c.capture_margin,
        cone=_cone(support, c.friction_share * friction, least),
        capture_time=c.capture_time,
        approach_time=c.approach_time,
    )
    return tables, support, pressure


def _pressure_offsets(support: SupportPolygon, left: np.ndarray, right: np.ndarray, least: float) -> np.ndarray:
    """How far the centre of pressure goes towards each edge while both feet, corners (k, 2), carry their least load."""
    shares = np.array([least, 1.0 - least])[:, None]
    offsets = [(foot @ support.normals.T).max(0) for foot in (left, right)]
    return (shares * offsets[0] + (1.0 - shares) * offsets[1]).max(0)


def _cone(support: SupportPolygon, friction: float, least: float) -> np.ndarray:
    """Sides (N_FRICTION, 6) of the cone of wrenches that soles give without sliding, the edges of the pressure aside.

    Exact for a rectangle and the pyramid of `wholebody.contacts.friction`; the largest rectangle in the support of the
    proportions of the box around it is taken. So it is inside the cone of `ContactFeasibility`, which has the same
    pyramids at the corners of the whole support: an optimiser needs few sides, a judge the truth.

    Source:
        Caron, Pham and Nakamura 2015, "Stability of Surface Contacts for Humanoid Robots: Closed-Form Formulae of the
        Contact Wrench for Rectangular Support Areas", ICRA.
    """
    low, high = support.vertices.min(axis=0), support.vertices.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    room = support.offsets - support.normals @ middle
    half = half * np.min(room / (np.abs(support.normals) @ half)) * (1.0 - 2.0 * least)
    (x, y), mu = half, pyramid_slope(friction)
    # Moments about the middle, as columns by ZMP_FORCE, VERTICAL, HORIZONTAL, YAW.
    turn_x, turn_y = np.array([0.0, 1.0, -middle[1], 0.0, 0.0, 0.0]), np.array([-1.0, 0.0, middle[0], 0.0, 0.0, 0.0])
    twist = np.array([0.0, 0.0, 0.0, middle[1], -middle[0], 1.0])
    load, along, across = np.eye(6)[2:5]
    sides = [sign * force - mu * load for force in (along, across) for sign in (1.0, -1.0)]
    for sign, a, b in product((1.0, -1.0), repeat=3):
        shears = a * (y * along + sign * mu * turn_x) + b * (x * across + sign * mu * turn_y)
        sides.append(sign * twist + shears - mu * (x + y) * load)
    sides = np.array(sides)
    # All in terms of a force.
    size = np.linalg.norm(sides * [HALF_SOLE, HALF_SOLE, 0.0, 1.0, 1.0, HALF_SOLE], axis=1)
    return sides / size[:, None]


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
    order = np.array([spec.joint_names.index(name) for name in names])
    q_min, q_max = spec.position_min[order] + c.joint_margin, spec.position_max[order] - c.joint_margin
    q_min[[name.endswith("knee_joint") for name in names]] = c.knee_min
    waist = [name.startswith("waist_") for name in names]
    acceleration = np.where(waist, c.waist_acceleration, c.acceleration)
    elbows = [name.endswith("elbow_joint") for name in names]
    q_max[elbows] = np.minimum(q_max[elbows], c.elbow_max)
    return {
        "q_min": q_min,
        "q_max": q_max,
        "speed_max": c.speed_share * spec.velocity_max[order],
        "acceleration_max": np.minimum(acceleration, spec.acceleration_max[order]),
        "tau_max": c.torque_share * spec.effort_max[order[N_JOINTS - UPPER :]],
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
            axis = around[gjk.AXIS : gjk.AXIS + 3] * around[gjk.HALF]
            points = around[:3] + np.array([axis, -axis])
        grown = 0.0 if kind == gjk.HULL else around[gjk.RADIUS]
        centre[i] = 0.5 * (points.max(0) + points.min(0))
        half[i] = 0.5 * (points.max(0) - points.min(0)) + grown
        radius[i] = np.linalg.norm(points - centre[i], axis=1).max() + grown
    return Shapes(
        shapes, table.rounds, table.vertices, table.start, table.neighbours, centre, half, radius,
        proximity.pairs.astype(np.int64), proximity.margin, *low,
    )  # fmt: skip
