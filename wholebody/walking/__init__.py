"""Walking: footsteps, the plan of the capture point through them, its adjustment, the swing, and the gait's states.

Begin with `wholebody.walking.walk.Walk`; `docs/walking.md` has the equations.
"""
