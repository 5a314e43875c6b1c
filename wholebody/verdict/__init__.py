"""The checker: is a chunk feasible, and which constraint says no."""
