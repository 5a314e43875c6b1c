"""LeRobot folders written with pyarrow alone: any features, names, format, rate and precision."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

INDICES = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64",
           "task_index": "int64"}  # fmt: skip


def write_dataset(folder, episodes, names=None, *, version="v3.0", fps=30, precision="float32", files=None):
    """Write a dataset folder.

    Args:
        folder: Where; its parents exist.
        episodes: A list of episodes, each an object of arrays (n, D) by feature.
        names: What ``meta/info.json`` says of a feature's names, by feature.
        version: ``v3.0``, ``v2.1`` or ``v2.0``.
        fps: Rate as ``meta/info.json`` has it [Hz].
        precision: Of the numbers.
        files: More files in ``meta``, text by name.
    """
    lengths = [len(next(iter(episode.values()))) for episode in episodes]
    rows = [_rows(episode, number, sum(lengths[:number]), fps, precision) for number, episode in enumerate(episodes)]
    (folder / "meta").mkdir(parents=True)
    (folder / "data/chunk-000").mkdir(parents=True)
    features = {
        key: {"dtype": precision, "shape": [values.shape[1]], "names": (names or {}).get(key)}
        for key, values in episodes[0].items()
    } | {key: {"dtype": kind, "shape": [1], "names": None} for key, kind in INDICES.items()}
    info = {"codebase_version": version, "robot_type": "unitree_g1", "fps": fps, "features": features,
            "total_episodes": len(lengths), "total_frames": sum(lengths), "total_tasks": 1, "chunks_size": 1000,
            "splits": {"train": f"0:{len(lengths)}"}, "video_path": None}  # fmt: skip
    if version == "v3.0":
        info["data_path"] = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
        pq.write_table(pa.concat_tables(rows), folder / "data/chunk-000/file-000.parquet")
        pq.write_table(pa.table({"task_index": [0], "task": ["reach"]}), folder / "meta/tasks.parquet")
        (folder / "meta/episodes/chunk-000").mkdir(parents=True)
        ends = np.cumsum([0, *lengths]).tolist()
        about = {"episode_index": list(range(len(lengths))), "length": lengths, "tasks": [["reach"]] * len(lengths),
                 "dataset_from_index": ends[:-1], "dataset_to_index": ends[1:],
                 "data/chunk_index": [0] * len(lengths), "data/file_index": [0] * len(lengths)}  # fmt: skip
        pq.write_table(pa.table(about), folder / "meta/episodes/chunk-000/file-000.parquet")
    else:
        info["data_path"] = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
        for number, table in enumerate(rows):
            pq.write_table(table, folder / f"data/chunk-000/episode_{number:06d}.parquet")
        lines = ({"episode_index": i, "tasks": ["reach"], "length": length} for i, length in enumerate(lengths))
        (folder / "meta/episodes.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
        (folder / "meta/tasks.jsonl").write_text(json.dumps({"task_index": 0, "task": "reach"}) + "\n")
    (folder / "meta/info.json").write_text(json.dumps(info, indent=1))
    for name, text in (files or {}).items():
        (folder / "meta" / name).write_text(text)
    return folder


def _rows(episode, number, start, fps, precision):
    kind = pa.float64() if precision == "float64" else pa.float32()
    columns = {
        key: pa.array(values.astype(precision)[:, 0])
        if values.shape[1] == 1
        else pa.array(values.astype(precision).tolist(), pa.list_(kind))
        for key, values in episode.items()
    }
    frames = len(next(iter(episode.values())))
    columns |= {"timestamp": pa.array((np.arange(frames) / fps).astype(np.float32)), "frame_index": np.arange(frames)}
    columns |= {"episode_index": np.full(frames, number), "index": start + np.arange(frames)}
    return pa.table(columns | {"task_index": np.zeros(frames, dtype=np.int64)})
