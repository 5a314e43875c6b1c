"""Recipes that make policies: outside the packages, since they need LeRobot and time."""
