"""Kernels: lowered equations as LLVM IR that is written here, compiled, kept, and called with
checked arrays.
"""
