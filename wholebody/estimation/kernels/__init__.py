"""Arithmetic of the estimation that is compiled."""
