"""What a hand feels and may push with, as one row of numbers that tasks and programs share."""

from __future__ import annotations

SHARE, FORCE, MOMENT, PUSH_MAX, STIFFNESS, MOBILITY, TOLD, TOUCH = 0, 1, 4, 7, 8, 9, 10, 13
"""Where in the row are: how far the hand touches (0 to 1); force [N] and moment [N m] on it at the palm point, in world
axes (3 each); the largest acceleration that it pushes with [m/s^2], its stiffness [1/s^2], one over its apparent mass
[1/kg]; the acceleration with which the hand is told to push, in world axes (3) [m/s^2]; and the row's length."""
TOLD_GIVE = 0.2
"""Share by which a hand pushes harder or less than it is told where it is not at its place [no unit]; chosen: a press
of 10 N within 3 N, and friction that is told is overcome."""
TURN_TOUCHING = 20.0
"""Largest proportional angular acceleration of a hand that touches [rad/s^2]; chosen: a third of a free hand's, so that
a palm lies down on what it meets."""
