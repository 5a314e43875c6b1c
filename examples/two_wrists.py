"""Two wrist poses: a still, balanced posture for them, and the way there in MuJoCo."""

import numpy as np

from models import g1
from wholebody import MujocoPlant, Supervisor, path_to, solve

left, right = np.eye(4), np.eye(4)  # in world: forearms ahead, palms facing each other
left[:3, 3], right[:3, 3] = (0.30, 0.20, 0.60), (0.30, -0.20, 0.60)
posture = solve(left, right)
print(posture)

supervisor, plant = Supervisor(g1()), MujocoPlant(g1())
state = plant.reset()
supervisor.reset(state)
supervisor.accept(path_to(posture, state, duration=2.0).chunk)
while state.time < 3.0:
    state = plant.step(supervisor.step(state))
supervisor.robot.update(state.q, state.v)
reached = supervisor.robot.pose("left_wrist_yaw_link").translation
print(f"left wrist {1e3 * np.linalg.norm(reached - left[:3, 3]):.1f} mm off")
