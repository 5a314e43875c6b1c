"""Controllers by name: ours, placo's dynamics, inverse kinematics alone.

Begin with `wholebody.backends.registry.make_controller`.
"""
