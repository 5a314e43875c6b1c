"""The closed loop on the wall clock: plant, control loop, planner and policy, each for itself.

Begin with `wholebody.live.session.Session`; the loop itself is `wholebody.live.loop.ControlLoop`.
"""
