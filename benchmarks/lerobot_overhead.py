"""What `LeRobotPolicy` costs around LeRobot's ``predict_action_chunk``, three cameras of 224 x 224, one core.

    python benchmarks/lerobot_overhead.py [--chunks 200]

Tiny real networks (tests/support/tiny_policies.py): the network's own time is subtracted, so its size does not matter.
Times are CPU time of the calling thread, with one thread in torch: all of `infer` but the network, what LeRobot's own
pre- and post-processor need of it, what is left for the adapter (images, state, checks, decoding), and a plain LeRobot
call (prepare_observation_for_inference and both processors) on the same frame.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).parents[1]))

from policy.action_spec.anchor import Anchor
from policy.action_spec.state import state_numbers
from policy.lerobot.policy import LeRobotPolicy
from policy.observation import Observation
from tests.support import tiny_policies as tiny

SIZE = 224


class Stopwatch:
    """Adds up the thread's CPU time in a function [s]."""

    def __init__(self, function: Callable) -> None:
        self.function, self.spent = function, 0.0

    def __call__(self, *arguments: Any, **settings: Any) -> Any:
        """The function, timed."""
        start = thread_time()
        try:
            return self.function(*arguments, **settings)
        finally:
            self.spent += thread_time() - start

    def take(self) -> float:
        """Seconds since the last time."""
        spent, self.spent = self.spent, 0.0
        return spent


def overheads(policy: LeRobotPolicy, chunks: int) -> np.ndarray:
    """CPU time of `infer` without the network, and of LeRobot's processors in it, shape (chunks, 2) [s]."""
    checkpoint, network = policy.checkpoint, policy.checkpoint.network
    watches = network.predict_action_chunk, checkpoint.preprocessor, checkpoint.postprocessor
    predict, *processors = (Stopwatch(function) for function in watches)
    network.predict_action_chunk = predict
    for name, watch in zip(("preprocessor", "postprocessor"), processors, strict=True):
        watch.steps = getattr(checkpoint, name).steps
        object.__setattr__(checkpoint, name, watch)
    rows = []
    for i in range(chunks):
        observation = tiny.observation(0.1 * i, size=SIZE, seed=i % 10)
        start = thread_time()
        policy.infer(observation)
        spent = thread_time() - start
        rows.append((spent - predict.take(), sum(watch.take() for watch in processors)))
    return np.array(rows)


def plain(policy: LeRobotPolicy, chunks: int) -> np.ndarray:
    """CPU time of what LeRobot itself does around the network, shape (chunks,) [s]."""
    from lerobot.policies.utils import prepare_observation_for_inference

    checkpoint, chunk = policy.checkpoint, torch.zeros(1, tiny.SPEC.horizon, tiny.SPEC.dim)
    times = []
    for i in range(chunks):
        seen: Observation = tiny.observation(0.1 * i, size=SIZE, seed=i % 10)
        raw = {f"observation.images.{name}": image for name, image in seen.images.items()}
        raw["observation.state"] = state_numbers(checkpoint.state, seen, Anchor.measured(seen)).astype(np.float32)
        start = thread_time()
        checkpoint.preprocessor(prepare_observation_for_inference(raw, torch.device("cpu"), task=seen.task))
        checkpoint.postprocessor(chunk)
        times.append(thread_time() - start)
    return np.array(times)


def main() -> None:
    """Print one line a policy."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--chunks", type=int, default=200)
    chunks = parser.parse_args().chunks
    torch.set_num_threads(1)
    headings = f"{'all':>8}{'p99':>8}{'processors':>12}{'adapter':>9}{'p99':>8}{'LeRobot alone':>15}"
    print(f"{'CPU time a chunk [ms]':24}{headings}")
    with tempfile.TemporaryDirectory() as folder:
        for kind in tiny.POLICIES:
            tiny.write_checkpoint(kind, Path(folder) / kind, size=SIZE)
            with tiny.tiny_backbones():
                policy = LeRobotPolicy.from_pretrained(Path(folder) / kind, clamp=1.0)
            alone = 1e3 * np.median(plain(policy, chunks))
            total, processors = (1e3 * overheads(policy, chunks)[5:]).T
            print(
                f"{kind:24}{np.median(total):8.2f}{np.percentile(total, 99):8.2f}"
                f"{np.median(processors):12.2f}"
                f"{np.median(total - processors):9.2f}{np.percentile(total - processors, 99):8.2f}{alone:15.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
