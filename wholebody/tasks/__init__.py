"""Tasks: what the robot should do, as weighted rows on the acceleration.

Begin with `wholebody.tasks.base.Task`; one file a task.
"""
