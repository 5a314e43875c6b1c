"""A wbc32 chunk from numpy: both hands 10 cm up from the stance, written as a chunk file and judged."""

import numpy as np

from policy import ReplayPolicy
from wholebody import Checker

actions = np.zeros((50, 32))  # a step: left wrist 9 numbers, right wrist 9, left Dex3 7, right Dex3 7
for wrist, y in ((0, 0.197), (9, -0.197)):
    actions[:, wrist : wrist + 3] = (0.138, y, 0.860)  # from between the soles, x ahead, y left, z up: the stance [m]
    actions[:, wrist + 2] += 0.10 * np.sin(np.linspace(0.0, np.pi / 2.0, 50)) ** 2
    actions[:, wrist + 3 : wrist + 9] = (1, 0, 0, 0, 1, 0)  # R[:, 0], then R[:, 1]: the forearm points ahead
actions[:, 18:] = (0, 0.1, 0.3, -0.3, -0.3, -0.3, -0.3, 0, -0.1, -0.3, 0.3, 0.3, 0.3, 0.3)  # thumb, then fingers [rad]
np.savez("raise.npz", actions=actions, fps=30.0, spec="wbc32")
policy = ReplayPolicy.from_npz("raise.npz")
print(Checker().check(policy, "raise.npz", policy.duration)[0].verdict)
