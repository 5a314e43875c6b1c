"""Hypotheses about numbers that are not what they are called, each with its evidence; nothing is changed unasked.

Begin with `policy.suspicion.joint_table.joint_findings`; `policy.suspicion.corrections` applies what a user confirms.
"""
