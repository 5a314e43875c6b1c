"""Limits: rows that bound the acceleration, so that a margin, a speed or a distance is kept.

Begin with `wholebody.limits.base.ProgramLimit`; one file a limit.
"""
