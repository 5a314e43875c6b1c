"""A policy that was learned, and runs without what it was learned with."""

LEARNED = "learned"
"""What a command line calls it."""
