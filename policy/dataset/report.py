"""What a converted dataset is, for people and for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from policy.action_spec.describe import called
from policy.action_spec.spec import ActionSpec
from policy.dataset.format import Dataset
from policy.dataset.joint_conversion import JointConversion, RoundTrip
from policy.errors import PolicyError
from policy.reading import listed

POSITION_BAR, ROTATION_BAR = 1e-4, np.deg2rad(0.01)
"""Error of the way back that counts as none [m], [rad]."""
_NOTES_SHOWN = 8


@dataclass(frozen=True)
class ConvertedDataset:
    """Outcome of a conversion.

    Attributes:
        folder: The dataset that was written.
        source: The one that was read, with the episodes that were chosen.
        spec: Layout of the actions.
        assumptions: What is in the result and not in the source.
        notes: What was odd.
        trips: Error of the way back to joints by feature; empty if it was not gone.
        cpu_seconds: Processor time of all of it [s].
        left_out: Why episodes are not in it, by their number.
        read_as: What the numbers were read as instead of what they are called.
    """

    folder: Path
    source: Dataset
    spec: ActionSpec
    assumptions: Mapping[str, float | str]
    notes: tuple[str, ...]
    trips: Mapping[str, RoundTrip]
    cpu_seconds: float
    left_out: Mapping[int, PolicyError] = field(default_factory=dict)
    read_as: tuple[str, ...] = ()

    @property
    def frames_per_second(self) -> float:
        """Frames converted, and checked if asked for, a second of processor time."""
        return self.source.frames / max(self.cpu_seconds, 1e-9)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; no paths, which mean nothing elsewhere."""
        source = self.source
        return {
            "source": {
                "folder": source.folder.resolve().name,
                "format": source.version,
                "fps": source.fps,
                "robot_type": source.info.get("robot_type"),
                "episodes": [episode.index for episode in source.episodes],
            },
            "layout": {"name": self.spec.name, "id": self.spec.id, "hash": self.spec.hash},
            "episodes_left_out": {str(index): str(error) for index, error in self.left_out.items()},
            "read_as": list(self.read_as),
            "frames": source.frames,
            "assumptions": dict(self.assumptions),
            "notes": list(self.notes),
            "round_trip": {key: _trip(trip) for key, trip in self.trips.items()},
            "frames_per_cpu_second": round(self.frames_per_second, 1),
        }

    def lines(self) -> list[str]:
        """A few lines for a terminal."""
        source = self.source
        lines = [
            f"{source.folder} ({source.version}): {len(source.episodes)} episodes, {source.frames} frames at "
            f"{source.fps:g} Hz to {called(self.spec)}",
        ]
        lines += [f"  left out episode {index}: {error}" for index, error in self.left_out.items()]
        lines += [f"  read as {code}" for code in self.read_as]
        lines += [f"  assumed {name}: {value}" for name, value in self.assumptions.items()]
        lines += [f"  note: {note}" for note in self.notes[:_NOTES_SHOWN]]
        if len(self.notes) > _NOTES_SHOWN:
            lines.append(f"  and {len(self.notes) - _NOTES_SHOWN} more notes in meta/conversion.json")
        lines += [
            f"  {key} and back: wrists within {1e3 * trip.position:.4f} mm and {np.rad2deg(trip.rotation):.5f} deg, "
            f"fingers within {trip.fingers:.2g} rad, {trip.unreached} of {trip.frames} frames not reached"
            for key, trip in self.trips.items()
        ]
        lines.append(f"  {self.frames_per_second:.0f} frames a second of processor time; wrote {self.folder}")
        return lines


def left_out(conversions: Mapping[str, JointConversion]) -> list[str]:
    """A sentence for each reason for which columns are not in the result."""
    notes = []
    for key, conversion in conversions.items():
        used = {conversion.source.names[i] for i in conversion.source.columns}
        rest = [name for name in conversion.source.names if name and name not in used]
        for reason, names in conversion.source.left_out.items():
            notes.append(f"{key}: {listed(names, 6)} left out: {reason}")
        if rest:
            notes.append(f"{key}: {', '.join(rest)} are left out, '{conversion.target.name}' has no place for them")
    return notes


def _trip(trip: RoundTrip) -> dict[str, Any]:
    return {
        "frames": trip.frames,
        "position_mm": 1e3 * trip.position,
        "rotation_deg": float(np.rad2deg(trip.rotation)),
        "fingers_rad": trip.fingers,
        "joints_rad": trip.joints,
        "not_reached": trip.unreached,
        "within_bars": bool(trip.position <= POSITION_BAR and trip.rotation <= ROTATION_BAR and not trip.unreached),
    }
