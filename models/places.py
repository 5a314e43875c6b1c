"""Where things in the scenes are and what they resist with: scenes are built from these numbers, scripts use them."""

from __future__ import annotations

TABLE_HEIGHT = 0.75
"""Height of the table top [m]."""
TABLE_EDGE = 0.20
"""How far ahead of the world origin the table begins [m]."""
SHELF_HEIGHTS = (0.35, 0.80, 1.20)
"""Heights of the shelf boards' upper sides [m]."""
BOARD = 0.04
"""Thickness of the boards of table and shelf [m]."""
WALL_AHEAD = 0.45
"""How far ahead of the world origin the face of the wall is [m]."""
WALL_BESIDE = 0.45
"""How far to either side of the world origin the faces of the corridor are [m]."""
BAR = (0.43, -0.12, 0.78)
"""Middle of the upright bar that drawer and locked door are pulled by [m]; chosen: a drawer under a worktop."""
LEVER = (0.45, -0.12, 0.95)
"""Axis of the door's lever at the height of its bar [m]; the bar points to the left (+y)."""
LEVER_LENGTH, LEVER_RADIUS = 0.13, 0.01
"""Length and radius of the lever's bar [m]; chosen: as of common doors."""
LEVER_TURN = 0.7
"""Angle at which the lever has unlatched the door [rad]; chosen: 40 degrees, as of common doors."""
LEVER_TORQUE = (1.0, 2.0)
"""Torques with which the lever is held up, and at which the door unlatches [N m]; chosen: as of common doors."""
DRAWER_FRICTION = 30.0
"""Dry friction of the drawer [N]; chosen: a full drawer without rollers."""
LOCKED_STIFFNESS = 500.0
"""Stiffness of the handle of the locked door [N/m]; chosen: a door that gives in its frame."""
BUTTON_FORCE = (5.0, 20.0)
"""Forces with which the button is held out, and at which it clicks [N]; chosen: 20 N, a stiff one."""
BUTTON = (0.42, -0.16, 1.05)
"""Middle of the button's cap, out [m]."""
BUTTON_TRAVEL = 0.010
"""How far in the button clicks [m]; chosen: as of an emergency stop."""
ON_TABLE = (0.42, 0.15, TABLE_HEIGHT)
"""Place of an object on the table, middle of its underside [m]; one for two hands: the same at y = 0."""
ON_FLOOR = (0.40, 0.15, 0.0)
"""The same on the floor [m]; chosen: ahead of the feet, where a hand reaches it."""
ON_SHELF = (0.46, 0.15, SHELF_HEIGHTS[1])
"""The same on the middle board of the shelf [m]."""
CRATE_WIDTH, CARTON_WIDTH = 0.30, 0.20
"""Distances of the palms on the crate and on the carton [m]."""
