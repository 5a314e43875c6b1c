"""Shapes of the bodies, and their distances from each other and from the floor.

Begin with `wholebody.collision.proximity.Proximity`; the distance of two hulls is `wholebody.collision.gjk.distance`.
"""
