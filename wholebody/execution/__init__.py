"""Between chunk and joint command: the supervisor and the plan follower."""
