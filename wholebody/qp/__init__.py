"""The whole-body quadratic program of a tick, readable and compiled, and its solvers."""
