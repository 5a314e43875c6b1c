"""How arithmetic is compiled: kernels, their arguments, and the compiler.

Begin with `wholebody.jit.entry.Entry`, which says what a kernel may be written in.
"""
