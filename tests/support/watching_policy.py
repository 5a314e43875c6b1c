"""A policy that sees the robot, remembers what it was asked, and answers with where the wrists are."""

import threading

import numpy as np

from policy import ActionChunk, Anchor, builtin


class Reaching:
    """Sees the robot: its chunk holds the measured wrists, and says what it was asked."""

    name, sees_robot, spec = "reaching", True, builtin("wbc32-v1")

    def __init__(self):
        self.resets, self.asked, self.prefixes = [], [], []
        self.gate = threading.Event()
        self.gate.set()
        self.raises = None

    def reset(self, task=""):
        self.resets.append(task)
        self.seq = -1

    def infer(self, observation):
        self.asked.append(observation)
        self.gate.wait()
        if self.raises is not None:
            raise self.raises
        self.seq += 1
        anchor = Anchor.measured(observation)
        poses = {hand: np.tile(anchor.T_world_base @ anchor.poses[hand], (4, 1, 1)) for hand in ("lhand", "rhand")}
        fingers = [np.tile(q, (4, 1)) for q in (anchor.q_lhand, anchor.q_rhand)]
        where = (self.spec.id, self.seq, observation.time, 30.0)
        return ActionChunk(*where, poses["lhand"], poses["rhand"], *fingers, notes=("one", "two"))


class Watching(Reaching):
    """With cameras, as a learned policy has them."""

    def __init__(self, cameras=None):
        super().__init__()
        self.cameras = cameras or {"head": (2, 3), "left_wrist": (2, 3)}
