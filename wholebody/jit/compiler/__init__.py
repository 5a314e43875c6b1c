"""A compiler of kernels: from their source to machine code by LLVM.

Begin with `wholebody.jit.compiler.program.Program`; statements are translated in `wholebody.jit.compiler.translate`.
"""
