"""The bodies of the robot that can reach the floor, and the lowest point of each."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.collision.proximity import joint_supports
from wholebody.collision.shapes import hull_corners
from wholebody.errors import InputError


class FloorClearance:
    """Hulls of the bodies below the elbows, of which the lowest vertex is their distance to the floor ``z = 0``.

    Bounds on the height and the tilt of the pelvis keep the others of a robot that stands away from the floor.

    Args:
        spec: The robot; of an arm without an elbow all bodies count.
        model: Of the robot.
        geometry: Shapes of the robot, as `models.pinocchio_model.load_collision` has them.

    Attributes:
        labels: ``floor.<body>`` for each of the n hulls.
        shapes: Index of each in the geometry, shape (n,).
        joints: Joint that carries each, shape (n,).
        supports: Which velocities move each, shape (n, nv), 0 or 1.
        vertices: Of each, in the axes of its joint, shape (k, 3) each, [m].
        reach: Largest distance of a vertex from the origin of that joint, shape (n,), [m].

    Raises:
        InputError: If one of those bodies is neither a hull nor a box.
    """

    def __init__(self, spec: RobotSpec, model: pin.Model, geometry: pin.GeometryModel) -> None:
        low = _low_joints(spec, model)
        items = [(i, item) for i, item in enumerate(geometry.geometryObjects) if item.parentJoint in low]
        names = [item.name.rpartition("_")[0] for _, item in items]
        self.labels = tuple(f"floor.{name}" for name in names)
        self.shapes = np.array([i for i, _ in items], dtype=np.int64)
        self.joints = np.array([item.parentJoint for _, item in items], dtype=np.int64)
        self.supports = joint_supports(model)[self.joints]
        self.vertices = [_vertices(item) for _, item in items]
        self.reach = np.array([np.linalg.norm(vertices, axis=1).max() for vertices in self.vertices])

    def lowest(self, data: pin.Data) -> np.ndarray:
        """Lowest point of each hull in world, shape (n, 3), for data with the joint placements of a configuration."""
        points = np.zeros((len(self.joints), 3))
        for point, joint, vertices in zip(points, self.joints.tolist(), self.vertices, strict=True):
            M = data.oMi[joint]
            point[:] = M.act(vertices[np.argmin(vertices @ M.rotation[2])])
        return points


def _low_joints(spec: RobotSpec, model: pin.Model) -> set[int]:
    """Joints of the arms from the elbows on, and those that hang on them."""
    elbows, first = spec.parts("elbow"), []
    for arm in (spec.limbs["left_arm"], spec.limbs["right_arm"]):
        first += [spec.joint_names[i] for i in ([i for i in arm if elbows[i]] or arm)[:1]]
    return {joint for name in first for joint in model.subtrees[model.getJointId(name)]}


def _vertices(item: pin.GeometryObject) -> np.ndarray:
    corners = hull_corners(item.geometry)
    if corners is None:
        kind = type(item.geometry).__name__
        raise InputError(f"shape '{item.name}' is a {kind}; heights over the floor are known for hulls and boxes")
    return corners @ item.placement.rotation.T + item.placement.translation
