"""How far wrists are from themselves after joints, wbc32 in single precision and joints again, and how fast that is.

    python benchmarks/dataset_conversion.py [--motions FOLDER | --anywhere]

Without an option: joints that swing as sines around the middle of their ranges, each at 0.05 to 0.3 Hz, with amplitudes
of a share of the range. With a folder: the arms of recorded motions (CSV, 60 Hz), every second frame, clipped to the
joint limits. Each set becomes a dataset folder as Unitree writes it, which is converted and checked. ``--anywhere``
searches for single poses in reach, each from the stance, which is harder than from the frame before.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from models import g1
from policy.action_spec.anchor import Anchor
from policy.dataset.conversion import DatasetSettings, convert_dataset
from policy.dataset.format import INDICES, Episode
from policy.dataset.joint_layout import joint_layout
from policy.dataset.naming.meaning import UNITREE_DEX3
from policy.dataset.report import ConvertedDataset
from policy.dataset.writer import DatasetWriter, set_column
from policy.kinematics.forward import IK_TOLERANCE, kinematics
from policy.kinematics.inverse import ARMS, reach
from policy.recorded.motion_csv import read_motion_csv

LAYOUT = joint_layout(list(UNITREE_DEX3), 28)
INDEX = [g1().index(name) for name in LAYOUT.names]
LOW, HIGH = g1().position_min[INDEX], g1().position_max[INDEX]
FPS, EPISODES, FRAMES = 30.0, 4, 600


def main() -> None:
    """Print one line a set."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", type=Path, help="folder of motion .csv files")
    parser.add_argument("--anywhere", action="store_true", help="single poses, each from the stance")
    arguments = parser.parse_args()
    if arguments.anywhere:
        anywhere("anywhere in the joint ranges", edge=False)
        anywhere("within a tenth of a joint limit", edge=True)
        return
    print(f"{'set':28} {'frames':>7} {'mm':>9} {'deg':>9} {'fingers':>8} {'missed':>6} {'frames/s':>9} {'forward':>8}")
    if arguments.motions is None:
        for share in (0.1, 0.2, 0.3, 0.35, 0.45):
            report(f"sines, {share:g} of the range", [sines(share, seed) for seed in range(EPISODES)])
    else:
        for file in sorted(arguments.motions.glob("*.csv")):
            report(file.stem, [recorded(file)])


def anywhere(name: str, *, edge: bool, poses: int = 1500) -> None:
    """Search for poses of one arm at random, and print how many are missed and how many a second are found."""
    rng, q0, n = np.random.default_rng(5), Anchor.nominal().q_body, len(g1().body_joints)
    low, high = g1().position_min[:n], g1().position_max[:n]
    began, missed = time.process_time(), 0
    for number in range(poses):
        share = rng.uniform(0.0, 1.0, n)
        if edge:
            share = np.where(share < 0.5, 0.1 * share, 1.0 - 0.1 * share)
        hand = ("rhand", "lhand")[number % 2]
        q, arm = q0.copy(), g1().limbs[ARMS[hand]]
        q[arm] = (low + share * (high - low))[arm]
        _, error = reach({hand: kinematics().poses(q)[hand]}, arm, q0, q0)
        missed += not error <= IK_TOLERANCE
    print(f"{name:32} {missed} of {poses} missed, {poses / (time.process_time() - began):.0f} poses/s")


def sines(share: float, seed: int) -> np.ndarray:
    """Joint vectors (FRAMES + 1, 28) [rad]."""
    rng = np.random.default_rng(seed)
    phase = 2.0 * np.pi * rng.uniform(0.05, 0.3, 28) * np.arange(FRAMES + 1)[:, None] / FPS
    return 0.5 * (LOW + HIGH) + share * (HIGH - LOW) * np.sin(phase + rng.uniform(0.0, 2.0 * np.pi, 28))


def recorded(file: Path) -> np.ndarray:
    """Joint vectors (n, 28) [rad] with the hands at rest."""
    motion, nominal = read_motion_csv(file), Anchor.nominal()
    arms = [g1().body_joints.index(name) for name in LAYOUT.names[:14]]
    hands = np.concatenate([nominal.q_lhand, nominal.q_rhand])
    q = np.hstack([motion.q_body[:, arms], np.tile(hands, (len(motion), 1))])[::2]
    return np.clip(q, LOW, HIGH)


def report(name: str, recordings: list[np.ndarray]) -> None:
    """Convert once with the way back and once without, and print both."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "joints"
        write(source, [q.astype(np.float32) for q in recordings])
        convert_dataset(source, Path(folder) / "warm", DatasetSettings(episodes=(0,), check=False))
        checked = convert_dataset(source, Path(folder) / "checked")
        forward = convert_dataset(source, Path(folder) / "forward", DatasetSettings(check=False))
    print(line(name, checked, forward), flush=True)


def line(name: str, checked: ConvertedDataset, forward: ConvertedDataset) -> str:
    """One row of the table; the worse of action and state."""
    trips = checked.trips.values()
    millimetres = 1e3 * max(trip.position for trip in trips)
    degrees = np.rad2deg(max(trip.rotation for trip in trips))
    fingers, missed = max(trip.fingers for trip in trips), sum(trip.unreached for trip in trips)
    return (
        f"{name:28} {checked.source.frames:7} {millimetres:9.5f} {degrees:9.6f} {fingers:8.1g} {missed:6} "
        f"{checked.frames_per_second:9.0f} {forward.frames_per_second:8.0f}"
    )


def write(folder: Path, recordings: list[np.ndarray]) -> None:
    """A dataset of commanded joints and of measured ones, which are a frame behind."""
    import pyarrow

    vector = {"dtype": "float32", "shape": [28], "names": [list(UNITREE_DEX3)]}
    numbers = {key: {"dtype": "int64", "shape": [1], "names": None} for key in INDICES}
    numbers["timestamp"]["dtype"] = "float32"
    info = {"fps": FPS, "robot_type": "Unitree_G1_Dex3", "features": {"observation.state": vector, "action": vector}}
    info["features"] |= numbers
    with DatasetWriter(folder, info, ("move",)) as writer:
        for index, q in enumerate(recordings):
            n = len(q) - 1
            rows = pyarrow.table({"timestamp": (np.arange(n) / FPS).astype(np.float32), "frame_index": np.arange(n)})
            rows = set_column(rows, "task_index", np.zeros(n, dtype=np.int64))
            rows = set_column(set_column(rows, "observation.state", q[:-1]), "action", q[1:])
            writer.add(Episode(index, n, ("move",), folder, 0), writer.numbered(rows), {})
        writer.finish({}, {})


if __name__ == "__main__":
    main()
