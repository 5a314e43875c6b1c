"""A motion that is played: recorded, a chunk, or a script."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from lerobot_robot_wholebody.config_teleoperators import WholebodyMotionConfig
from lerobot_robot_wholebody.hands_teleoperator import Hands, HandsTeleoperator

if TYPE_CHECKING:
    from lerobot_robot_wholebody.wholebody_g1 import WholebodyG1
    from policy.chunk import ActionChunk

logger = logging.getLogger(__name__)

APPROACH_SPEED, APPROACH_MIN = 0.3, 0.8
"""Mean speed at which palms go to where a motion begins [m/s], and the least time that it takes [s]; chosen: a hand
that is in view of people."""


class WholebodyMotion(HandsTeleoperator):
    """Plays a motion in an episode, from where the hands are; goes back in a reset. Its last step is kept.

    Args:
        config: Settings.
    """

    config_class = WholebodyMotionConfig
    name = "wholebody_motion"

    def connect(self, calibrate: bool = True) -> None:
        """Read the motion.

        Raises:
            PolicyError: If there is none of that name, or it is malformed.
        """
        self._motion = _read(self.config)
        super().connect(calibrate)

    def _meet(self, robot: WholebodyG1) -> None:
        """Take note of how the robot stands, and of whether it is told of forces."""
        super()._meet(robot)
        if any(self._motion.pushes) and not robot.numbers.forces:
            logger.warning(
                "%s: the forces that palms are to meet are not told; with --robot.forces=true they are",
                self.config.motion,
            )

    def _begin(self, robot: WholebodyG1) -> None:
        """Set off to the motion, or back."""
        import numpy as np

        self._start, self._back = replace(self.last, forces=None), robot.phase == "reset"
        end = self._rest if self._back else self._played(0.0)
        far = float(np.linalg.norm(end.palms - self._start.palms, axis=1).max())
        self._takes = max(far / APPROACH_SPEED, APPROACH_MIN)

    def _at(self, time: float) -> Hands:
        end = self._rest if self._back else self._played(max(time - self._takes, 0.0))
        return end if time >= self._takes else _between(self._start, end, time / self._takes)

    def _played(self, time: float) -> Hands:
        """Hands of the motion at a time of it [s]."""
        import numpy as np

        from lerobot_robot_wholebody.target import palm_of
        from policy.geometry.se3 import inverse
        from policy.recorded.resample import resampled
        from policy.targets.parts import FORCES, rows_of

        row = resampled(self._motion, self._motion.t_obs + time, 1)
        T_stance_world = inverse(self._anchor.T_world_stance)
        T = T_stance_world @ np.stack([row.T_world_lhand[0], row.T_world_rhand[0]])
        forces = np.array([rows_of(row)[name][0] for name in FORCES]) @ T_stance_world[:3, :3].T
        sides = zip(T, ("left", "right"), strict=True)
        palms = np.array([palm_of(wrist, side, self._robot.numbers) for wrist, side in sides])
        return Hands(palms, T[:, :3, :3], (row.q_lhand[0], row.q_rhand[0]), forces)


def _between(start: Hands, end: Hands, share: float) -> Hands:
    """Hands on the straight way from ``start`` to ``end``, after a share of its time [no unit]."""
    import numpy as np

    from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix
    from policy.scripted.policy import minimum_jerk

    way = float(minimum_jerk(share))
    R = rotvec_to_matrix(way * matrix_to_rotvec(end.R @ np.swapaxes(start.R, 1, 2))) @ start.R
    left, right = (a + way * (b - a) for a, b in zip(start.fingers, end.fingers, strict=True))
    return Hands(start.palms + way * (end.palms - start.palms), R, (left, right))


def _read(config: WholebodyMotionConfig) -> ActionChunk:
    """The whole motion, anchored at the nominal stance; what is to be said of it is logged."""
    import numpy as np

    from policy.recorded.replay import open_recording
    from policy.scripted.library import scripted_policy
    from policy.scripted.policy import to_chunk

    if Path(config.motion).suffix:
        episode = open_recording(config.motion, fps=config.fps).episode
    else:
        script = scripted_policy(config.motion)
        times = np.arange(int(np.ceil(script.duration * script.fps)) + 1) / script.fps
        motion, spec = script.script(times), script.spec
        episode = to_chunk(motion, spec.id, 0, 0.0, script.fps, len(times), robot=spec.robot)
    for note in episode.notes:
        logger.warning("%s: %s", config.motion, note)
    return episode
