"""What the numbers of an action mean: specs, built-in layouts, encoding and decoding.

Begin with `policy.action_spec.spec.ActionSpec`, then `policy.action_spec.codec.decode`, whose module has the table of
modes.
"""
