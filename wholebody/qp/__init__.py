"""The whole-body quadratic program of a tick, readable and compiled, and its solvers.

Begin with `wholebody.qp.formulation.InverseDynamics`, the program to be read; `wholebody.qp.compiled_program` equals
it.
"""
