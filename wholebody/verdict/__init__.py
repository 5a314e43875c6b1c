"""The checker: is a chunk feasible, and which constraint says no.

Begin with `wholebody.verdict.check.Checker`, and `wholebody.verdict.fast.FastChecker`, which simulates nothing.
"""
