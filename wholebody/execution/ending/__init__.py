"""How a robot that stands is left, blind or lowered and no longer led, and what keeps it from going on.

Begin with `wholebody.execution.ending.lowering.Lowering`.
"""
