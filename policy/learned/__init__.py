"""Policies that were learned, and run without what they were learned with."""

NAMES = LEARNED, LEARNED_PLACE = "learned", "learned_place"
"""What a command line calls the one that reaches, and the one that puts something down."""
