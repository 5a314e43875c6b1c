"""Where the pelvis of a dataset's robot was in each row, by its recorded legs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.spec import ActionSpec
from policy.action_spec.state import aligned_state, state_layout
from policy.dataset.format import ACTION, STATE, Dataset, Episode, vectors
from policy.dataset.joint_layout import LEGS
from policy.dataset.naming.meaning import meaning, parted_names
from policy.dataset.pelvis.rows import in_own_pelvis
from policy.errors import DatasetError
from policy.joints import joints_of
from policy.kinematics.forward import kinematics

LEVEL_HEIGHT, PARALLEL = 0.03, np.deg2rad(10.0)
"""Differences of both soles in height [m] and in tilt [rad] from which a foot is not on the floor; chosen: past what
encoders and soft ground make, and short of a step."""
OWN = "wrists are in the pelvis of their own frame; over a chunk it is taken to stand still"
STANDS = "taken to stand still in the stance: nothing says how it moved"
BY_LEGS = "of each row, by its legs: both soles are taken to lie flat on a level floor"


@dataclass(frozen=True)
class RecordedLegs:
    """Columns of a dataset that say where the pelvis was over the soles.

    Attributes:
        feature: Key of the feature.
        columns: Of the joints of both legs in motor order.
        scale: Radians in a unit of them.
        robot: Whose legs these are.
        correct: What is made of the feature's numbers first, as of `policy.dataset.naming.sources.Source`.
    """

    feature: str
    columns: np.ndarray
    scale: float = 1.0
    robot: RobotSpec = field(default_factory=g1, repr=False)
    correct: Callable[[np.ndarray], np.ndarray] | None = field(default=None, compare=False, repr=False)

    def anchors(self, dataset: Dataset, episode: Episode) -> list[Anchor]:
        """An anchor for each row of an episode, in a world whose origin is the row's stance.

        Raises:
            DatasetError: If a number is not finite, or a foot is in the air; names the frame.
        """
        width = int(dataset.feature(self.feature)["shape"][0])
        column = dataset.table(episode, [self.feature]).column(self.feature)
        values = vectors(column, width, self.feature, episode)
        values = values if self.correct is None else self.correct(values)
        legs = self.scale * values[:, self.columns].astype(float)
        where = f"{dataset.folder}, episode {episode.index}"
        if not np.isfinite(legs).all():
            frame = int(np.argwhere(~np.isfinite(legs))[0][0])
            raise DatasetError(f"{where}, frame {frame}: a leg joint is not finite", feature=self.feature, frame=frame)
        q_body = np.tile(Anchor.nominal(robot=self.robot).q_body, (len(legs), 1))
        q_body[:, np.concatenate([self.robot.limbs[leg] for leg in LEGS])] = legs
        anchors = Anchor.standing(q_body, self.robot)
        self._check_soles(anchors, q_body, where)
        return anchors

    def _check_soles(self, anchors: list[Anchor], q_body: np.ndarray, where: str) -> None:
        T_world_base = np.stack([anchor.T_world_base for anchor in anchors])
        left, right = (T_world_base @ T for T in kinematics(self.robot).soles(q_body).values())
        step = np.abs(left[:, 2, 3] - right[:, 2, 3])
        tilt = np.arccos(np.clip((left[:, :3, 2] * right[:, :3, 2]).sum(axis=1), -1.0, 1.0))
        frame = int(np.argmax(np.maximum(step / LEVEL_HEIGHT, tilt / PARALLEL)))
        if step[frame] > LEVEL_HEIGHT or tilt[frame] > PARALLEL:
            raise DatasetError(
                f"{where}, frame {frame}: the soles are {1e3 * step[frame]:.0f} mm and {np.rad2deg(tilt[frame]):.0f}° "
                f"apart; up to {1e3 * LEVEL_HEIGHT:.0f} mm and {np.rad2deg(PARALLEL):.0f}° stand on a floor. A foot in "
                "the air does not say where the pelvis is: leave the episode out with --episodes, or --to wbc32-v1",
                feature=self.feature,
                frame=frame,
            )


def recorded_legs(dataset: Dataset, unit: str = "rad", robot: RobotSpec | None = None) -> RecordedLegs | None:
    """Where a dataset has the measured legs: in its state, else in another feature that is no action; None without.

    Args:
        dataset: What to look in.
        unit: Unit of its joints, ``rad`` or ``deg``.
        robot: The robot; the G1 with Dex3 hands if None.
    """
    robot = robot or g1()
    wanted = [name for leg in LEGS for name in joints_of(robot, leg)]
    others = [key for key in dataset.features if key not in (STATE, *dataset.cameras) and ACTION not in key.split(".")]
    for key in (STATE, *others):
        named = parted_names(dataset.features.get(key, {}).get("names"))
        found = [meaning(name, part, robot).name for part, name in named]
        if wanted and all(found.count(name) == 1 for name in wanted):
            columns = np.array([found.index(name) for name in wanted])
            return RecordedLegs(key, columns, np.pi / 180.0 if unit == "deg" else 1.0, robot)
    return None


def state_of(spec: ActionSpec, legs: RecordedLegs | None) -> ActionSpec:
    """Layout of the states beside actions: without the pelvis where nothing says how it moved."""
    return aligned_state(spec) if legs is None else state_layout(spec)


def pelvis_taken(spec: ActionSpec, legs: RecordedLegs | None) -> dict[str, str]:
    """Sentence about the pelvis that is assumed for rows written in a layout."""
    if in_own_pelvis(spec):
        return {"pelvis": OWN}
    return {"pelvis": STANDS if legs is None else BY_LEGS}
