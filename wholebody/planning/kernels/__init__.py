"""Arithmetic of a plan around its search; compiled with numba."""
