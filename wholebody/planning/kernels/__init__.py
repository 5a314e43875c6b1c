"""Arithmetic of a plan around its search; compiled by `wholebody.jit`."""
