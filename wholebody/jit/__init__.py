"""How arithmetic is compiled: kernels, their arguments, and the compiler."""
