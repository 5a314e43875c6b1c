"""In what ways a chunk is planned, in which order, and which of the plans is taken.

Begin with `wholebody.planning.strategies.choice.best`, which goes through `wholebody.planning.strategies.rows`.
"""
