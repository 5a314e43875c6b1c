"""A dataset of the G1 in joints, or in another wrist layout, as one of wrists: commanded actions, measured states.

What the recording does not say (the waist, the pelvis) is assumed, and every assumption is written into the result:
``meta/conversion.json`` has source, provenance, assumptions, notes and the error of the way back to joints;
``meta/action_spec.json`` and ``meta/state_spec.json`` have the layouts.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.builtin import as_spec
from policy.action_spec.spec import ActionSpec
from policy.dataset.checks import (
    check_cameras,
    check_images,
)
from policy.dataset.columns import numeric_columns, stored_columns
from policy.dataset.format import ACTION, STATE, Dataset, Episode
from policy.dataset.joint_conversion import JointConversion, RoundTrip, round_trip
from policy.dataset.naming.sources import Source, find_source
from policy.dataset.open import open_dataset, selected
from policy.dataset.pelvis.conversions import Conversion, of_executed, row_conversions
from policy.dataset.pelvis.legs import RecordedLegs, pelvis_taken, recorded_legs
from policy.dataset.pelvis.rows import in_own_pelvis
from policy.dataset.read_as import read_as_corrections
from policy.dataset.report import ConvertedDataset, left_out
from policy.dataset.soundness import sound_episodes
from policy.dataset.stats import in_units, narrow, statistics, widened
from policy.dataset.writer import DatasetWriter, set_column
from policy.errors import DatasetError
from policy.kinematics.forward import kinematics
from policy.suspicion.corrections import HANDS_ONLY

PROVENANCE = {ACTION: "commanded", STATE: "measured"}
"""Whether the joints of a feature were sent to the motors or read from them."""
PROVENANCE_OF_ACTION = {"requested": "commanded", "executed": "measured, a row later"}
"""What the actions of a result are, by the setting ``action``."""
KEPT_PREFIX = "source."
"""Prefix of the names of kept joint columns: LeRobot takes what begins with ``action`` or ``observation`` as input
or output of policies."""
REQUESTED = f"{KEPT_PREFIX}requested"
"""Commanded wrists beside executed ones."""
Progress = Callable[[float, float], None]


@dataclass(frozen=True, kw_only=True)
class DatasetSettings:
    """How a dataset is converted.

    Attributes:
        to: Layout of the result, a built-in name or a spec; its rate becomes the dataset's. The state is the one that
            goes with it, without the pelvis where the source does not say how it moved.
        waist: Joints of the waist, yaw, roll and pitch of the G1, [rad] where they were not recorded; zero if None.
        unit: Unit of the recorded joints, ``rad`` or ``deg``.
        synergy: Map between one closing number and fingers, where only one side has fingers.
        assume: Layout that the user vouches for, where names do not say it.
        episodes: Numbers of the episodes to convert; None for all.
        keep_joints: Keep the joint columns too, as ``source.action`` and ``source.observation.state``.
        check: Go back to joints from every stored frame and report the error.
        least_range: Floor under the ranges that normalisers divide by, in SI; 0 for none.
        link_videos: Hard-link videos instead of copying them.
        without_camera_stats: Accept cameras without statistics.
        robot: The recorded robot; the G1 with Dex3 hands if None.
        action: What the actions are made of: ``requested``, the commanded joints, or ``executed``, the joints that were
            measured a row later; the others are kept as ``source.requested``.
        read_as: What the numbers are instead of what they are called, of `policy.suspicion.corrections.READ_AS`.
    """

    to: str | ActionSpec = "wbc32"
    waist: tuple[float, ...] | None = None
    unit: str = "rad"
    synergy: str | None = None
    assume: ActionSpec | None = None
    episodes: tuple[int, ...] | None = None
    keep_joints: bool = False
    check: bool = True
    least_range: float = 0.0
    link_videos: bool = False
    without_camera_stats: bool = False
    robot: RobotSpec | None = None
    action: Literal["requested", "executed"] = "requested"
    read_as: tuple[str, ...] = ()


def convert_dataset(
    source: str | Path,
    target: str | Path,
    settings: DatasetSettings | None = None,
    *,
    progress: Progress | None = None,
) -> ConvertedDataset:
    """Convert a LeRobot dataset (v3.0, v2.1, v2.0) of joints, or of another wrist layout, to one of wrists (v3.0).

    Args:
        source: Dataset folder.
        target: Folder to write; must not exist.
        settings: How.
        progress: Called with frames done and frames in all.

    An episode that is broken is left out, and named in the result.

    Raises:
        DatasetError: If the dataset cannot be read, is in no layout that is understood, or all its episodes are broken;
            nothing is written.
        SpecError: If the layout cannot be filled from that.
    """
    settings = settings or DatasetSettings()
    kinematics(settings.robot)  # reading the robot's description once is no part of the rate
    began = time.process_time()
    _require(settings)
    dataset = selected(open_dataset(source), settings.episodes)
    spec = dataclasses.replace(as_spec(settings.to, settings.robot), fps=dataset.fps)
    sources = {key: find_source(dataset, key) for key in (ACTION, STATE)}
    hands_only = HANDS_ONLY in settings.read_as
    legs = None if hands_only else recorded_legs(dataset, settings.unit, settings.robot)
    given = {"assume": settings.assume, "unit": settings.unit, "robot": settings.robot}
    conversions = row_conversions(dataset, sources, spec, legs, settings.waist, settings.synergy, given)
    joints = {key: one for key, one in conversions.items() if isinstance(one, JointConversion)}
    sources |= {key: read_as_corrections(sources[key], one.source, settings.read_as) for key, one in joints.items()}
    legs = _corrected(legs, sources[STATE])
    notes = [
        *check_cameras(dataset, without_stats=settings.without_camera_stats),
        *(note for source in sources.values() for note in source.notes),
        *left_out(joints),
    ]
    sound = sound_episodes(dataset, {k: (sources[k], one.source) for k, one in conversions.items()}, settings.read_as)
    work = _Work(dataset, sources, conversions, settings, legs)
    with DatasetWriter(Path(target), work.info(), dataset.tasks, link=settings.link_videos) as writer:
        sound.every(lambda episode: work.convert(episode, writer, progress))
        stats, more = work.stats()
        result = ConvertedDataset(
            folder=Path(target),
            source=sound.dataset,
            left_out=sound.left_out,
            read_as=settings.read_as,
            spec=spec,
            assumptions=pelvis_taken(spec, legs) | conversions[STATE].assumptions | conversions[ACTION].assumptions,
            notes=(*notes, *sound.notes, *more),
            trips=dict(work.trips),
            cpu_seconds=time.process_time() - began,
        )
        writer.finish(stats, _files(result, sources, conversions, settings))
    return result


def _require(settings: DatasetSettings) -> None:
    if settings.action not in PROVENANCE_OF_ACTION:
        raise DatasetError(f"action is '{settings.action}'; possible: {', '.join(PROVENANCE_OF_ACTION)}")
    if not (np.isfinite(settings.least_range) and settings.least_range >= 0.0):
        raise DatasetError(f"least range is {settings.least_range}; it must be at least 0")


def _corrected(legs: RecordedLegs | None, states: Source) -> RecordedLegs | None:
    """Legs read with the corrections of the states that they belong to."""
    if legs is None or legs.feature != STATE or not states.whole:
        return legs
    return dataclasses.replace(legs, correct=states.correct)


def provenance(key: str, settings: DatasetSettings) -> str:
    """Whether the joints of a feature were sent to the motors or read from them."""
    return PROVENANCE_OF_ACTION[settings.action] if key == ACTION else PROVENANCE[key]


class _Work:
    """Statistics and notes gathered over the episodes."""

    def __init__(
        self, dataset: Dataset, sources: Mapping[str, Source], conversions: Mapping[str, Conversion],
        settings: DatasetSettings, legs: RecordedLegs | None,
    ) -> None:  # fmt: skip
        self.dataset, self.sources, self.conversions, self.settings = dataset, sources, conversions, settings
        if settings.action == "executed":
            self.executed = of_executed(conversions, settings.waist, settings.synergy)
        # Wrists in the pelvis that come from joints do not depend on where it is.
        self.legs = None if all(in_own_pelvis(one.target) for one in conversions.values()) else legs
        self.trips: dict[str, RoundTrip] = {}
        self._done = 0
        self._columns: dict[str, list[np.ndarray]] = {}
        self._stored, self._described = stored_columns(dataset), self.info()["features"]

    def info(self) -> dict[str, Any]:
        """The source's description with the converted features in it."""
        features = {key: dict(feature) for key, feature in self.dataset.features.items()}
        for key, conversion in self.conversions.items():
            before = {name: features.pop(name) for name in self.sources[key].features}
            if self.settings.keep_joints:
                features |= {KEPT_PREFIX + name: feature for name, feature in before.items()}
            features[key] = dict(next(iter(before.values())))
            layout = conversion.target
            facts = {"provenance": provenance(key, self.settings), "layout": layout.id, "hash": layout.hash}
            features[key] |= {"dtype": "float32", "shape": [layout.dim], "names": list(layout.feature_names)}
            features[key]["info"] = {**(features[key].get("info") or {}), **facts}
        if self.settings.action == "executed":
            requested = {**features[ACTION].get("info", {}), "provenance": PROVENANCE[ACTION]}
            features[REQUESTED] = {**features[ACTION], "info": requested}
        return {**self.dataset.info, "features": features}

    def convert(self, episode: Episode, writer: DatasetWriter, progress: Progress | None) -> None:
        """Append an episode to the result."""
        rows = self.dataset.table(episode, self._stored)
        check_images(rows, [key for key in self.dataset.cameras if key in self._stored], episode)
        columns: dict[str, np.ndarray] = {}
        measured: dict[str, np.ndarray] = {}
        trips: dict[str, RoundTrip] = {}
        anchors = None if self.legs is None else self.legs.anchors(self.dataset, episode)
        for key, conversion in self.conversions.items():
            source = self.sources[key]
            joints = source.of(rows, episode)
            columns[key] = conversion.forward(joints, anchors).astype(np.float32)
            measured[key] = joints
            if self.settings.check and isinstance(conversion, JointConversion):
                trips[key] = round_trip(conversion, joints, columns[key], anchors)
            split = np.split(joints, np.cumsum(source.widths)[:-1], axis=1)
            for name, part in zip(source.features, split, strict=True):
                if self.settings.keep_joints:
                    rows = set_column(rows, KEPT_PREFIX + name, part)
                if name != key:
                    rows = rows.drop_columns([name])
            rows = set_column(rows, key, columns[key])
        if self.settings.action == "executed":
            rows = set_column(rows, REQUESTED, columns[ACTION])
            after = np.vstack([measured[STATE][1:], measured[STATE][-1:]])
            later = None if anchors is None else [*anchors[1:], anchors[-1]]
            columns[ACTION] = self.executed.forward(after, later).astype(np.float32)
            rows = set_column(rows, ACTION, columns[ACTION])
        rows = writer.numbered(rows)
        others = {key: x for key, x in self._described.items() if key not in self.conversions}
        columns |= dict(numeric_columns(rows, others, episode))
        # Nothing of an episode is kept before all of it is done.
        for key, trip in trips.items():
            self.trips[key] = self.trips[key].merged(trip) if key in self.trips else trip
        for key, values in columns.items():
            self._columns.setdefault(key, []).append(values)
        writer.add(episode, rows, {**{key: statistics(x) for key, x in columns.items()}, **episode.camera_stats})
        self._done += episode.length
        if progress is not None:
            progress(self._done, self.dataset.frames)

    def stats(self) -> tuple[dict[str, Mapping[str, Any]], list[str]]:
        """Statistics over all episodes, and what there is to say about them."""
        found: dict[str, Mapping[str, Any]] = {
            key: statistics(np.concatenate(parts)) for key, parts in self._columns.items()
        }
        notes = []
        for key, conversion in self.conversions.items():
            still = narrow(found[key], conversion.target)
            if len(still):
                notes.append(_still_note(key, [conversion.target.feature_names[i] for i in still], self.settings))
            if self.settings.least_range:
                found[key] = widened(found[key], in_units(conversion.target, self.settings.least_range))
        features, whole = self.dataset.features, self.dataset.stats
        carried = {key: whole[key] for key in whole if key in features and key not in found}
        if self.settings.episodes is not None and any(key in carried for key in self.dataset.cameras):
            notes.append("statistics of the cameras are those of all episodes of the source")
        return {**found, **carried}, notes


def _still_note(key: str, names: list[str], settings: DatasetSettings) -> str:
    some = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
    if settings.least_range:
        return f"{key}: {some} hardly move; their ranges were widened to {settings.least_range:g}"
    return (
        f"{key}: {some} hardly move, so a normaliser would blow noise up to the whole range; --least-range 0.01 puts a "
        "floor under it"
    )


def _files(
    result: ConvertedDataset, sources: Mapping[str, Source], conversions: Mapping[str, Conversion],
    settings: DatasetSettings,
) -> dict:  # fmt: skip
    try:
        release = version("g1-wholebody")
    except PackageNotFoundError:
        release = "unknown"
    facts = {
        "tool": f"g1-wholebody {release}, wholebody convert",
        **result.to_dict(),
        "features": {
            key: {
                "provenance": provenance(key, settings),
                "layout": conversion.target.id,
                "features": list(sources[key].features),
                **conversion.provenance,
                "layout_assumed": settings.assume is not None,
            }
            for key, conversion in conversions.items()
        },
        "statistics": {"over": "all frames alike", "least_range": settings.least_range},
    }
    return {
        "conversion.json": json.dumps(facts, indent=2) + "\n",
        "action_spec.json": conversions[ACTION].target.to_json() + "\n",
        "state_spec.json": conversions[STATE].target.to_json() + "\n",
    }
