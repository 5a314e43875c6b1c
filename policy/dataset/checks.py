"""What a dataset must be to be converted: columns that are known joints, finite numbers, time that goes on, images."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.spec import ActionSpec
from policy.dataset.format import Dataset, Episode
from policy.dataset.joint_layout import JointLayout, joint_layout
from policy.dataset.naming.sources import Source
from policy.dataset.video import check_video
from policy.errors import DatasetError

if TYPE_CHECKING:
    import pyarrow

RATE_TOLERANCE = 0.01
"""Part by which the rate of an episode's timestamps may differ from the dataset's."""
RECOMPUTE = "lerobot-edit-dataset --operation.type recompute_stats --operation.skip_image_video false"


def column_layout(
    dataset: Dataset, source: Source, *, assume: ActionSpec | None = None, unit: str = "rad",
    robot: RobotSpec | None = None,
) -> JointLayout:  # fmt: skip
    """What the columns of an action or a state are.

    Args:
        dataset: Where it is.
        source: Its columns, by `policy.dataset.naming.sources.find_source`.
        assume: Joint layout that the user vouches for.
        unit: Unit of the joints, ``rad`` or ``deg``.
        robot: The robot; the G1 with Dex3 hands if None.

    Raises:
        DatasetError: If they are no joints, or it is not known which.
    """
    key = source.key
    if named := wrist_layouts(source, robot):
        raise DatasetError(
            f"'{key}' of {dataset.folder} is in the layout {named[0]} already, by the names of its columns; there are "
            f"no joints to convert. If that is meant, --assume-spec {' or '.join(named)} says in which frame",
            feature=key,
        )
    settings = {"assume": assume, "unit": unit, "robot": robot}
    return joint_layout(source.names, source.dim, feature=key, parts=source.parts, **settings)


def wrist_layouts(source: Source, robot: RobotSpec | None = None) -> list[str]:
    """Names of the built-in layouts of a robot's wrists whose features a source is named by; versions share them."""
    named = (name for name in LAYOUTS if source.names == builtin(name, robot).feature_names)
    return [name for name in named if builtin(name, robot).slot("left_wrist_position")]


def check_times(dataset: Dataset, episodes: Iterable[Episode] | None = None) -> list[str]:
    """Refuse time that stands still, goes back, or passes at another rate than the dataset's; else nothing to note.

    Args:
        dataset: Where they are.
        episodes: Which to look at; all if None.

    Raises:
        DatasetError: Naming episode and frame.
    """
    for episode in dataset.episodes if episodes is None else episodes:
        times = _timestamps(dataset, episode)
        gaps = np.diff(times)
        if not np.isfinite(times).all() or not (gaps > 0.0).all():
            frame = int(np.argmax(~np.isfinite(times))) if not np.isfinite(times).all() else int(np.argmin(gaps)) + 1
            raise DatasetError(
                f"{dataset.folder}, episode {episode.index}: the timestamp {times[frame]} s of frame {frame} does not "
                "come after the one before; leave the episode out with --episodes",
                feature="timestamp",
            )
        rate = len(gaps) / (times[-1] - times[0]) if len(gaps) else dataset.fps
        if not abs(rate / dataset.fps - 1.0) <= RATE_TOLERANCE:
            raise DatasetError(
                f"{dataset.folder}, episode {episode.index}: its timestamps pass at {rate:.4g} Hz, meta/info.json says "
                f"fps {dataset.fps:g}: motion would be {dataset.fps / rate:.3g} times as fast; correct the wrong one",
                feature="timestamp",
            )
    return []


def check_videos(dataset: Dataset) -> list[str]:
    """Refuse videos that are missing, cut off, or end before their episodes; nothing to note otherwise.

    Raises:
        DatasetError: Naming the file.
    """
    ends: dict[tuple[Path, str], float] = {}
    for episode in dataset.episodes:
        for key, span in episode.videos.items():
            ends[span.file, key] = max(ends.get((span.file, key), 0.0), span.end)
    for (file, key), end in ends.items():
        check_video(file, end, key)
    return []


def _timestamps(dataset: Dataset, episode: Episode) -> np.ndarray:
    """Times of an episode's frames, shape (n,), [s]."""
    column = dataset.table(episode, ["timestamp"]).column("timestamp")
    try:
        times = np.asarray(column, dtype=float)
    except (ValueError, TypeError) as error:
        raise DatasetError(
            f"{episode.file} has timestamps that are no numbers: {error}", feature="timestamp"
        ) from error
    if times.ndim != 1:
        raise DatasetError(f"{episode.file} has timestamps of shape {times.shape}", feature="timestamp")
    return times


def check_cameras(dataset: Dataset, *, without_stats: bool = False) -> list[str]:
    """Whether the cameras have statistics, which are carried over.

    Raises:
        DatasetError: If they have none and `without_stats` does not accept that.
    """
    missing = [key for key in dataset.cameras if key not in dataset.stats]
    if not missing:
        return []
    if without_stats:
        return [f"no statistics of {', '.join(missing)}: a policy that normalises images cannot be trained with them"]
    raise DatasetError(
        f"{dataset.folder} has no statistics of {missing[0]}, and they cannot be had without decoding every video. "
        f"Policies that normalise images (ACT, Diffusion) need them: let LeRobot make them ({RECOMPUTE}). π0, π0.5 and "
        "SmolVLA do without: go on with --without-camera-stats",
        feature=missing[0],
    )


def check_images(rows: pyarrow.Table, keys: list[str], episode: Episode) -> None:
    """Refuse images that are in files of their own.

    Raises:
        DatasetError: Naming the camera.
    """
    for key in keys:
        images = rows.column(key).combine_chunks()
        if "bytes" not in (field.name for field in getattr(images.type, "fields", ())):
            raise DatasetError(
                f"'{key}' of episode {episode.index} in {episode.file} holds {images.type}; images are expected, as "
                "objects with 'bytes'",
                feature=key,
            )
        if images.field("bytes").null_count:
            raise DatasetError(
                f"'{key}' of episode {episode.index} has images outside of {episode.file}, which are not carried over; "
                "embed them first (LeRobot does so when it saves an episode)",
                feature=key,
            )
