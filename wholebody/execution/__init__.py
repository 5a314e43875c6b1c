"""Between chunk and joint command: the supervisor and the plan follower.

Begin with `wholebody.execution.supervisor.Supervisor`; its states are the table of `wholebody.execution.states`.
"""
