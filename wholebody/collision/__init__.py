"""Shapes of the bodies, and their distances from each other and from the floor."""
