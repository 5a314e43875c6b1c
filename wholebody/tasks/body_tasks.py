"""The tasks of a controller by name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.tasks.base import Task
from wholebody.tasks.com import ComTask
from wholebody.tasks.foot import FootTask
from wholebody.tasks.hand import HandTask
from wholebody.tasks.height import HeightTask
from wholebody.tasks.momentum import AngularMomentumTask
from wholebody.tasks.orientation import OrientationTask
from wholebody.tasks.posture import PostureTask


@dataclass(frozen=True, kw_only=True)
class BodyTasks:
    """Every task by name.

    Attributes:
        feet: Left and right foot, each followed while it is up.
        fingers: The finger joints, Pinocchio order.
        extra: Tasks that no reference is read for: a new task is added here, in `make_tasks`, and nowhere else.
    """

    palms: tuple[HandTask, ...]
    pelvis: OrientationTask
    torso: OrientationTask
    height: HeightTask
    com: ComTask
    momentum: AngularMomentumTask
    posture: PostureTask
    feet: tuple[FootTask, ...]
    fingers: np.ndarray
    extra: tuple[Task, ...] = ()

    @property
    def body(self) -> tuple[Task, ...]:
        """All but those of the hands and further ones; the posture last."""
        return self.com, self.momentum, self.torso, self.pelvis, self.height, self.posture
