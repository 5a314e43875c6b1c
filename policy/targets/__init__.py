"""Targets of the palms that come one at a time: how they become action chunks.

Begin with `policy.targets.stream.TargetStream`.
"""
