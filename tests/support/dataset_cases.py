"""Tiny datasets as LeRobot writes them (v3.0), and the same in the format v2.1, which it no longer writes."""

import json
import shutil

import numpy as np
import pyarrow.parquet
from lerobot.configs.video import RGBEncoderConfig
from lerobot.datasets import LeRobotDataset

from tests.support.joint_cases import DEX3, swinging

VIDEO, IMAGE = "observation.images.head", "observation.images.wrist"
LENGTHS = (12, 9, 14)
TASKS = ("pick up the cup", "pour", "pick up the cup")


def joints_of(layout=DEX3, *, episode=0, offset=0.0):
    """Commanded and measured joints of an episode; the measured ones lag by one frame."""
    q = swinging(layout, frames=LENGTHS[episode] + 1, seed=10 + episode, share=0.2) + np.float32(offset)
    return q[1:], q[:-1]


def write_v30(root, layout=DEX3, *, fps=30, cameras=True, change=lambda action, state, episode: (action, state)):
    """A dataset by LeRobot's own class: three episodes, one video and one image camera, Unitree's names.

    Args:
        root: Folder to make.
        layout: Columns of action and state.
        fps: Frames per second [Hz].
        cameras: With cameras or without.
        change: What to do to the joints of an episode before they are written.
    """
    vector = {"dtype": "float32", "shape": (layout.dim,), "names": [list(layout.given)]}
    picture = {"shape": (32, 48, 3), "names": ["height", "width", "channels"]}
    features = {"observation.state": dict(vector), "action": dict(vector)}
    features["observation.velocity"] = {"dtype": "float32", "shape": (2,), "names": ["a", "b"]}
    if cameras:
        features |= {VIDEO: {"dtype": "video", **picture}, IMAGE: {"dtype": "image", **picture}}
    made = LeRobotDataset.create(
        "tests/joints",
        fps,
        features,
        root=root,
        robot_type="Unitree_G1_Dex3",
        rgb_encoder=RGBEncoderConfig(vcodec="h264"),
        video_files_size_in_mb=0.001,  # a file an episode, as v2.1 has it
    )
    for episode, (length, task) in enumerate(zip(LENGTHS, TASKS, strict=True)):
        action, state = change(*joints_of(layout, episode=episode), episode)
        for i in range(length):
            frame = {"action": action[i], "observation.state": state[i], "task": task}
            frame["observation.velocity"] = np.array([episode, i], dtype=np.float32)
            if cameras:
                frame |= {VIDEO: image(episode, i), IMAGE: image(episode, i)}
            made.add_frame(frame)
        made.save_episode()
    made.finalize()
    return root


def image(episode, i):
    """A flat colour that says which frame it is and that codecs keep."""
    return np.full((32, 48, 3), 20 + 60 * episode + 4 * i, dtype=np.uint8)


def write_v21(root, v30, *, version="v2.1"):
    """The same dataset with a file an episode and JSON lines, as LeRobot 0.1 to 0.3 wrote them."""
    info = json.loads((v30 / "meta" / "info.json").read_text())
    episodes = pyarrow.parquet.read_table(v30 / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    rows = pyarrow.parquet.read_table(v30 / "data/chunk-000/file-000.parquet")
    (root / "meta").mkdir(parents=True)
    (root / "data/chunk-000").mkdir(parents=True)
    lines, stats = [], []
    for row in episodes:
        index = row["episode_index"]
        part = rows.slice(row["dataset_from_index"], row["length"])
        pyarrow.parquet.write_table(part, root / f"data/chunk-000/episode_{index:06d}.parquet")
        number = row[f"videos/{VIDEO}/file_index"]
        video = root / f"videos/chunk-000/{VIDEO}/episode_{index:06d}.mp4"
        video.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(v30 / f"videos/{VIDEO}/chunk-000/file-{number:03d}.mp4", video)
        lines.append({"episode_index": index, "tasks": row["tasks"], "length": row["length"]})
        found = {}
        for name, value in row.items():
            if name.startswith("stats/") and name.rsplit("/", 1)[1] in ("min", "max", "mean", "std", "count"):
                found.setdefault(name.split("/")[1], {})[name.rsplit("/", 1)[1]] = value
        stats.append({"episode_index": index, "stats": found})
    tasks = [{"task_index": i, "task": task} for i, task in enumerate(dict.fromkeys(TASKS))]
    for name, content in {"episodes": lines, "episodes_stats": stats, "tasks": tasks}.items():
        (root / "meta" / f"{name}.jsonl").write_text("".join(json.dumps(line) + "\n" for line in content))
    for key in ("data_files_size_in_mb", "video_files_size_in_mb"):
        info.pop(key)
    info |= {
        "codebase_version": version,
        "total_chunks": 1,
        "total_videos": len(lines),
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
    }
    (root / "meta" / "info.json").write_text(json.dumps(info, indent=4))
    return root
