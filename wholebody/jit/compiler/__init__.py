"""A compiler of kernels: from their source to machine code by LLVM."""
