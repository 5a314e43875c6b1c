"""The trajectory: whole-body motion along the hands' path, found for all of it at once.

Begin with `wholebody.trajopt.formulation.Formulation`, the problem to be read, and
`wholebody.trajopt.gauss_newton.optimise`.
"""
