"""The balanced robot for another program: controller and simulation beside it, targets in, observations out.

Begin with `wholebody.live.served.client.ServedRobot`, then `wholebody.live.served.server.serve`.
"""
