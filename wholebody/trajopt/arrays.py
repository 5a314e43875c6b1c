"""What compiled code is given: the robot, its shapes, what is asked of the plan and what that weighs, by names."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Tables(NamedTuple):
    """The robot; bodies 0 to 29 are those of the plan, then come the fingers.

    Frames are in the order of `wholebody.robot.kernels.frames`.
    """

    bodies: np.ndarray  # (44, 25), as in fixed_feet_kinematics
    parent: np.ndarray  # (44,)
    frame_body: np.ndarray  # (6,)
    frame_R: np.ndarray  # (6, 3, 3)
    frame_p: np.ndarray  # (6, 3)
    carries: np.ndarray  # (6, N_BODY) bool, which velocities move a frame
    R_feet: np.ndarray  # (2, 3, 3) where they stay
    p_feet: np.ndarray  # (2, 3)
    q_stance: np.ndarray  # (36,)
    com_stance: np.ndarray  # (2,)
    gravity: np.ndarray  # (3,)
    mass: float
    load_min: float  # share of the weight
    limits: np.ndarray  # (3,) tilt of torso and of pelvis, height
    q_min: np.ndarray  # (29,)
    q_max: np.ndarray  # (29,)
    speed_max: np.ndarray  # (29,)
    acceleration_max: np.ndarray  # (29,)
    tau_max: np.ndarray  # (UPPER,)
    between_max: np.ndarray  # (UPPER,) torques that a plan may ask for between its knots
    normals: np.ndarray  # (E, 2) of the support's edges
    com_offsets: np.ndarray  # (E,)
    zmp_offsets: np.ndarray  # (E,)
    capture_offsets: np.ndarray  # (E,)
    cone: np.ndarray  # (N_FRICTION, 6) sides of the cone of friction, by ZMP_FORCE, VERTICAL, HORIZONTAL, YAW
    capture_time: float  # in which the capture point may reach them
    approach_time: float  # for which bodies may go on approaching each other


class KnotTargets(NamedTuple):
    """What is asked of K knots."""

    T_palms: np.ndarray  # (K, 2, 4, 4)
    q_fingers: np.ndarray  # (K, n_fingers) in the order of their bodies
    v_start: np.ndarray  # (N_BODY,)
    offset: np.ndarray  # (K, 12) of the palms on the curve from those at its control points
    dt: float
    between: bool  # whether torques between knots count
    spent: np.ndarray  # (UPPER,) excess over the bounds on torques that is excused at the first knot
    pushed: bool  # whether anything pushes the palms
    pushes: np.ndarray  # (K, 6) forces on the left and the right palm, world axes


class Shapes(NamedTuple):
    """Convex shapes of the robot, as in `collision.shapes`; which pairs of them count, and which near the floor."""

    shapes: np.ndarray
    rounds: np.ndarray
    vertices: np.ndarray
    start: np.ndarray
    neighbours: np.ndarray
    centre: np.ndarray  # (n, 3) of a box around each, in the axes of its body
    half: np.ndarray  # (n, 3) half its sides
    radius: np.ndarray  # (n,) of a sphere about the same centre
    pairs: np.ndarray  # (pairs, 2)
    margin: np.ndarray  # (pairs,) distance to keep
    low_body: np.ndarray  # (low,) of those that can reach the floor
    low_anchor: np.ndarray  # (low,) the same, or for fingers the last body of the plan before it
    low_reach: np.ndarray  # (low,) from the origin of that one, however the fingers are bent
    low_first: np.ndarray  # (low,) first of their vertices
    floor: np.ndarray  # (2,) height to keep, and height beyond it from which they count


class TrajectoryWeights(NamedTuple):
    """Weights of the squares [1 / scale^2]; of palms the scales, and the errors past which no gradient grows."""

    position: float
    position_give: float
    orientation: float
    orientation_give: float
    com: float
    torso: float
    pelvis: float
    height: float
    posture: float
    zmp: float
    waist: float
    slide: float
    smooth: float
    speed: float
    legs: float
