"""Policies beside the control loop: latency, late answers, ensembles.

Begin with `policy.executor.executor.Executor`, which a control loop polls; `docs/timing.md` has its rules.
"""
