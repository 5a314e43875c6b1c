"""From an action chunk to a plan: hand paths and a whole-body trajectory.

Begin with `wholebody.planning.chunk_planner.ChunkPlanner`; `docs/planner.md` explains every stage.
"""
