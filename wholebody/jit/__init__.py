"""How arithmetic is compiled with numba."""
