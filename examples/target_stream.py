"""One-step targets at 30 Hz, as teleoperation or LeRobot's `send_action` give them, followed in MuJoCo.

The left hand draws a circle of 6 cm, the right one is never told anything and stays. After 4 s the targets end in
mid-motion, and the hand comes to rest. Run it with ``python examples/target_stream.py``.
"""

import numpy as np

from models import g1
from policy import Observation, TargetStream
from wholebody import MujocoPlant, Supervisor, observe

RATE, RADIUS, TURN, ENDS = 30.0, 0.06, 2.0, 4.0

spec = g1()
supervisor, plant, stream = Supervisor(spec), MujocoPlant(spec), TargetStream()
state = plant.reset()
supervisor.reset(state)


def seen() -> Observation:
    """What the robot measures now."""
    return observe(spec, supervisor, state)


start = stream.infer(seen()).T_world_lhand[0]
count, off = 0, []
while state.time < ENDS + 2.0:
    if state.time >= count / RATE - 1e-9:
        angle = TURN * state.time
        target = start.copy()
        target[:3, 3] += RADIUS * np.array([0.0, np.sin(angle), 1.0 - np.cos(angle)])
        if state.time < ENDS:
            stream.put(state.time, lhand=target)
        supervisor.accept(stream.infer(seen()), state.time)
        count += 1
        if 1.0 < state.time < ENDS:
            off.append(np.linalg.norm(supervisor.robot.pose(spec.tools[0].wrist_frame).translation - target[:3, 3]))
    state = plant.step(supervisor.step(state))
print(f"{1e3 * np.sqrt(np.mean(np.square(off))):.1f} mm RMS behind its targets; then {supervisor.status.status.name}")
