"""One hand picks up something upright and puts it down elsewhere."""

from __future__ import annotations

import numpy as np

from policy.scripted.library import OBJECT_IN_PALM
from policy.scripted.policy import ScriptedPolicy, stance_pose
from policy.scripted.waypoints import one_hand, waypoint_policy

CARRIED, BESIDE = 0.08, 0.12
"""How high it is carried, and how far beside it the open hand comes and goes [m]; chosen: clear of the table, and of
the thing with all fingers."""


def place(p_world_object: np.ndarray, p_world_spot: np.ndarray) -> ScriptedPolicy:
    """The left hand closes on an upright cylinder from its side, carries it, puts it down and lets go of it.

    Args:
        p_world_object: Axis of the cylinder at the height to grasp it, (3,) [m].
        p_world_spot: Where that point is to be at the end, (3,) [m].
    """
    stance = stance_pose()
    beside, up = np.array([0.0, BESIDE, 0.0]), np.array([0.0, 0.0, CARRIED])
    at, there = (np.asarray(p) - stance.R_world_lhand @ OBJECT_IN_PALM for p in (p_world_object, p_world_spot))
    home = stance.p_world_lpalm
    return waypoint_policy(
        "place",
        [
            one_hand("left", 1.3, np.array([home[0], (at + beside)[1], home[2]]), 0.0),
            one_hand("left", 2.5, at + beside, 0.0),
            one_hand("left", 4.5, at, 0.0),
            one_hand("left", 6.0, None, 1.0),
            one_hand("left", 7.2, at + up),
            one_hand("left", 8.6, there + up),
            one_hand("left", 9.8, there),
            one_hand("left", 10.8, None, 0.0),
            one_hand("left", 11.8, there + beside),
            one_hand("left", 12.3),
        ],
    )
