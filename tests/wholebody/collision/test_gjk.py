"""Strategy: coal's distances on thousands of postures are the specification; where the two differ by more than coal's
own accuracy, and for normals and points, the supporting planes found by going through all vertices decide.
"""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import load_collision, load_pinocchio, stance_q
from models.urdf import light_urdf
from wholebody.collision import gjk as core
from wholebody.collision.proximity import Proximity
from wholebody.collision.shapes import shape_table
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.errors import InputError
from wholebody.jit.entry import Entry
from wholebody.types import RobotState

DISTANCE = Entry(core.distance)
POSTURES = 150
"""Each with all 1159 pairs."""
COAL = 3e-6
"""Accuracy of coal's distances, 1e-6 relative for far shapes [m]."""


@pytest.fixture(scope="module")
def robot():
    spec = g1()
    model = load_pinocchio(spec)
    return spec, model, load_collision(spec, model)


@pytest.fixture(scope="module")
def table(robot):
    return shape_table(robot[0], robot[2])


class Measuring:
    """All pairs of the robot, with the memory of the last posture."""

    def __init__(self, robot, table):
        self.model, self.geometry, self.table = robot[1], robot[2], table
        self.pairs = np.array([(pair.first, pair.second) for pair in self.geometry.collisionPairs])
        self.data, self.placed = self.model.createData(), self.geometry.createData()
        self.simplex = np.zeros((len(self.pairs), 4, 6))
        first = table.shapes[:, core.FIRST]
        self.state = np.column_stack([np.zeros(len(self.pairs), dtype=np.int64), first[self.pairs]])
        self.scratch, self.rows = np.zeros(core.SCRATCH), np.zeros((len(self.pairs), 9))
        self._distance = DISTANCE

    def ours(self, q):
        """Distances, NaN where unsure."""
        pin.forwardKinematics(self.model, self.data, q)
        R, p = placements(self)
        return np.array([self.pair(k, R, p) for k in range(len(self.pairs))])

    def pair(self, k, R, p, enough=np.inf):
        t, (i, j) = self.table, self.pairs[k]
        a, c = t.shapes[i, core.BODY], t.shapes[j, core.BODY]
        found, code = self._distance(
            t.shapes[i], t.shapes[j], t.rounds[i], t.rounds[j], t.vertices, t.start, t.neighbours, enough, R[a],
            p[a], R[c], p[c], self.simplex[k], self.state[k], self.scratch, self.rows[k],
        )  # fmt: skip
        self.code = code
        return found if code != core.UNSURE else np.nan

    def coal(self, q):
        pin.computeDistances(self.model, self.data, self.geometry, self.placed, q)
        return np.array([result.min_distance for result in self.placed.distanceResults])

    def reach(self, shape, direction):
        """How far a shape reaches along a world direction, by going through all its vertices [m]."""
        kind, first, count, body = self.table.shapes[shape]
        M, row = self.data.oMi[int(body) + 1], self.table.rounds[shape]
        local = M.rotation.T @ direction
        if kind == core.CYLINDER:
            along = local @ row[3:6]
            far = (
                local @ row[:3]
                + row[core.HALF_LENGTH] * abs(along)
                + row[core.RADIUS] * np.sqrt(max(1.0 - along**2, 0.0))
            )
        else:
            far = np.max(self.table.vertices[first : first + count] @ local)
            far += row[core.RADIUS] if kind == core.SPHERE else 0.0
        return far + direction @ M.translation


def postures(robot, count):
    """Some far apart, some near the last one, half of them anywhere within the joint limits."""
    _, model, _ = robot
    rng, stance = np.random.default_rng(4), stance_q(robot[0], robot[1])
    q = stance
    for i in range(count):
        if i % 3 == 2:
            q = pin.integrate(model, q, rng.normal(0.0, 0.003, model.nv))
        else:
            q = pin.integrate(model, stance, rng.normal(0.0, 0.15, model.nv))
            if i % 3:
                q[7:] = rng.uniform(model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
        yield q


def test_distances_of_all_pairs_are_those_of_coal_and_unsure_ones_overlap(robot, table):
    measuring, compared = Measuring(robot, table), 0
    for q in postures(robot, POSTURES):
        found, wanted = measuring.ours(q), measuring.coal(q)
        sure = np.isfinite(found)
        assert (wanted[~sure] < 1e-6).all()
        # A sphere is measured from its centre, so it is sure even where it overlaps a little.
        assert (wanted[sure] > -0.006).all()
        np.testing.assert_allclose(found[sure], wanted[sure], atol=COAL)
        compared += sure.sum()
    assert compared > 0.99 * POSTURES * len(measuring.pairs)


def test_supporting_planes_prove_each_distance_and_the_nearest_points(robot, table):
    measuring = Measuring(robot, table)
    for q in postures(robot, 12):
        found = measuring.ours(q)
        for k in np.flatnonzero(np.isfinite(found) & (found > 1e-4))[::7].tolist():
            normal, first, second = measuring.rows[k].reshape(3, 3)
            i, j = measuring.pairs[k].tolist()
            # Nothing of the first shape is beyond its point, nothing of the second before its: so they are the nearest.
            assert measuring.reach(i, normal) == pytest.approx(normal @ first, abs=1e-7)
            assert -measuring.reach(j, -normal) == pytest.approx(normal @ second, abs=1e-7)
            np.testing.assert_allclose(second - first, found[k] * normal, atol=1e-10)


def test_a_lower_bound_is_given_only_where_it_is_enough_and_is_one(robot, table):
    measuring, seen = Measuring(robot, table), 0
    for q in postures(robot, 8):
        truth = measuring.ours(q)
        R, p = placements(measuring)
        for k in range(0, len(truth), 5):
            enough = truth[k] * (0.5 + (k % 4) / 4.0)
            if not enough > 1e-3:
                continue
            measuring.state[k, 0] = 0
            found = measuring.pair(k, R, p, enough)
            if measuring.code == core.BEYOND:
                seen += 1
                assert enough <= found <= truth[k] + 1e-9
            else:
                assert found == pytest.approx(truth[k], abs=1e-8)
    assert seen > 250


def placements(measuring):
    data = measuring.data
    return np.array([M.rotation for M in data.oMi[1:]]), np.array([M.translation for M in data.oMi[1:]])


def test_what_was_found_before_changes_the_way_but_not_the_answer(robot, table):
    warm = Measuring(robot, table)
    for q in postures(robot, 6):
        found, alone = warm.ours(q), Measuring(robot, table).ours(q)
        np.testing.assert_allclose(found, alone, atol=1e-8)


def test_the_near_pairs_of_the_compiled_tick_are_those_of_the_readable_one():
    spec, rng = g1(), np.random.default_rng(2)
    controller = WholeBodyController(spec, ControllerConfig())
    compiled_tick, model = controller.compiled, controller.robot.model
    q = stance_q(spec, model)
    controller.reset(RobotState(0.0, q, np.zeros(model.nv)))
    readable = Proximity(spec, model, None, q, controller.config.safety.self_distance)
    limit, zero, data = controller.self_collision, np.zeros(model.nv), model.createData()
    for i in range(200):
        q = pin.integrate(model, q, rng.normal(0.0, 0.02 if i % 20 else 0.2, model.nv))
        q[7:] = np.clip(q[7:], model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
        compiled_tick.solve(q, zero)
        pin.forwardKinematics(model, data, q)
        readable.update(q, data, limit.trigger, limit.least)
        near = readable.near(limit.trigger, limit.most, limit.least)
        count = compiled_tick.tick.n_pairs
        assert abs(count - len(near)) <= 1
        count = min(count, len(near))
        found = limit.proximity
        chosen = compiled_tick.tick.pair_now[:count]
        np.testing.assert_allclose(
            (found.distance - found.margin)[chosen], (readable.distance - readable.margin)[near[:count]], atol=COAL
        )
        truth = np.array(
            [pin.computeDistance(readable.geometry, readable.data, k).min_distance for k in range(0, 1159, 13)]
        )
        assert (found.bound[::13] <= truth + COAL).all()


def test_hands_inside_the_body_have_a_depth_in_the_compiled_tick_too(table):
    spec = g1()
    controller = WholeBodyController(spec, ControllerConfig())
    q = stance_q(spec, controller.robot.model)
    controller.reset(RobotState(0.0, q, np.zeros(controller.robot.nv)))
    bent = {"shoulder_pitch": 0.5, "shoulder_roll": -0.3, "shoulder_yaw": -1.0, "elbow": 0.0}
    for name, angle in bent.items():
        q[7 + controller.robot.joint_names.index(f"left_{name}_joint")] = angle
    controller.compiled.solve(q, np.zeros(controller.robot.nv))
    rows = controller.compiled.tick.pairs[: controller.compiled.tick.n_pairs]
    measuring = Measuring((spec, controller.robot.model, controller.self_collision.proximity.geometry), table)
    depth = measuring.coal(q) - controller.self_collision.proximity.margin
    assert depth.min() < -0.02
    np.testing.assert_allclose(rows[:, 9], np.sort(depth)[: len(rows)], atol=COAL)


def test_damaged_edges_in_the_cache_are_made_again(robot, table, tmp_path, monkeypatch):
    stored = light_urdf(robot[0]).with_name("edges.npz")
    whole = stored.read_bytes()
    copy = tmp_path / stored.name
    monkeypatch.setattr("wholebody.collision.shapes.light_urdf", lambda spec: tmp_path / "robot.urdf")
    for content in (b"", whole[:1000], whole):
        copy.write_bytes(content)
        again = shape_table(robot[0], robot[2])
        np.testing.assert_array_equal(again.neighbours, table.neighbours)
        np.testing.assert_array_equal(again.start, table.start)


def test_a_shape_of_another_kind_is_refused_by_name(robot):
    import coal

    geometry = pin.GeometryModel()
    geometry.addGeometryObject(pin.GeometryObject("egg_0", 1, pin.SE3.Identity(), coal.Ellipsoid(0.1, 0.2, 0.3)))
    with pytest.raises(InputError, match="egg_0"):
        shape_table(robot[0], geometry)
