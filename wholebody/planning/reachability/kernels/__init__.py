"""Compiled arithmetic of the map."""
