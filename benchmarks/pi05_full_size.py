"""π0.5 in full size with random weights, from observation to chunk: `LeRobotPolicy` against plain LeRobot.

    python benchmarks/pi05_full_size.py [--device cuda] [--dtype bfloat16] [--chunks 20] [--seconds 10]
    python benchmarks/pi05_full_size.py --tiny --device cpu

4.1 billion parameters: 8.3 GB of GPU memory in bfloat16 and 16.6 GB in float32, and as much of main memory while the
network is built, which takes minutes. Nothing is downloaded: weights are random, the tokenizer has one token a
character. ``--tiny`` runs the same lines on two layers of width 64, which says nothing about a robot.

Printed are, for several numbers of denoising steps, the median time of a chunk: the network alone
(``predict_action_chunk``), plain LeRobot (``prepare_observation_for_inference`` and both processors around it),
`LeRobotPolicy.infer`, and `RealTimeLeRobotPolicy.infer_after` a prefix; then what a denoising step costs in each, by a
straight line through those times, and the device's memory. Last, the robot in the loop, which gets each chunk as late
as it really was: without and with real-time chunking.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).parents[1]))

from models import g1
from policy import ExecutorConfig, simulated_executor
from policy.action_spec.anchor import Anchor
from policy.action_spec.state import state_numbers
from policy.findings import CheckpointError
from policy.lerobot.policy import LeRobotPolicy
from policy.lerobot.spec import write_specs
from policy.prefix import Prefix
from tests.support import tiny_policies as tiny
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.episode.timing import timing
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

FULL = {"image_resolution": (224, 224), "paligemma_variant": "gemma_2b", "action_expert_variant": "gemma_300m"}
"""What `tiny_policies.config` makes smaller, as in ``PI05Config``."""
STEPS = (1, 2, 5, 10)
SIZE = 224
"""Side of the camera images [px]."""
WAYS = ("network alone", "plain LeRobot", "LeRobotPolicy", "after a prefix")
DELAY, HORIZON = 4, 20
"""Steps of a prefix that the next chunk must repeat, and from which on it is free."""


def write_folder(folder: Path, **changes: Any) -> Path:
    """A checkpoint without weights: configuration, processors, tokenizer, layouts."""
    settings = tiny.config("pi05", folder=folder, size=SIZE, **changes)
    tokenizer = tiny.write_tokenizer(folder / "tokenizer")
    for part in (settings, *tiny.processors(settings, tokenizer, tiny.stats())):
        part.save_pretrained(folder)
    write_specs(folder, tiny.SPEC)
    return folder


def ways(policy: LeRobotPolicy) -> dict[str, Callable[[int], Any]]:
    """The four calls; each takes the number of the chunk, which is its observation's time in tenths of a second."""
    from lerobot.policies.utils import prepare_observation_for_inference

    checkpoint, network = policy.checkpoint, policy.checkpoint.network
    device = torch.device(network.config.device)
    seen = tiny.observation(size=SIZE)
    raw = {f"observation.images.{name}": image for name, image in seen.images.items()}
    raw["observation.state"] = state_numbers(checkpoint.state, seen, Anchor.measured(seen)).astype(np.float32)

    def prepared() -> dict[str, Any]:
        return checkpoint.preprocessor(prepare_observation_for_inference(dict(raw), device, task=seen.task))

    batch = prepared()
    policy.reset()
    executed = policy.infer(seen)
    calls = (
        lambda k: network.predict_action_chunk(batch),
        lambda k: checkpoint.postprocessor(network.predict_action_chunk(prepared())),
        lambda k: policy.infer(tiny.observation(0.1 * k, size=SIZE)),
        lambda k: policy.infer_after(
            tiny.observation(0.1 * k, size=SIZE), Prefix(executed, len(executed), DELAY, HORIZON)
        ),
    )
    return dict(zip(WAYS, calls, strict=True))


def median_ms(call: Callable[[int], Any], chunks: int, device: str) -> float:
    """Median time of a call, the device's work included [ms]; the first two calls are left out."""
    times = []
    for k in range(chunks + 2):
        _wait(device)
        start = perf_counter()
        call(k)
        _wait(device)
        times.append(perf_counter() - start)
    return 1e3 * float(np.median(times[2:]))


def measure(policy: LeRobotPolicy, chunks: int) -> np.ndarray:
    """Median time of a chunk by denoising steps and way, shape (len(STEPS), len(WAYS)) [ms]."""
    config, table = policy.checkpoint.network.config, []
    for steps in STEPS:
        config.num_inference_steps = steps
        row = []
        for call in ways(policy).values():
            policy.reset()
            row.append(median_ms(call, chunks, config.device))
        table.append(row)
    return np.array(table)


def in_the_loop(policy: LeRobotPolicy, seconds: float, *, real_time: bool) -> str:
    """What an episode says of its chunks, which arrive as late as they really were, in a sentence."""
    spec, cameras = g1(), tiny.observation(size=SIZE).images
    executor = simulated_executor(policy, latency=None, config=ExecutorConfig(real_time=real_time))
    settings = EpisodeConfig(cameras=lambda: cameras, task=tiny.observation().task)
    result = run_episode(executor, Supervisor(spec), MujocoPlant(spec), duration=seconds, config=settings)
    return f"{timing(result).text()}; {'it stood' if result.fall is None else result.fall}"


def _wait(device: str) -> None:
    if str(device).startswith("cuda"):
        torch.cuda.synchronize(device)


def main(arguments: list[str] | None = None) -> None:
    """Build, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--dtype", default="bfloat16", choices=("float32", "bfloat16"))
    parser.add_argument("--chunks", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=10.0, help="of the robot in the loop; 0: none")
    parser.add_argument("--tiny", action="store_true", help="two layers of width 64 instead")
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        if chosen.tiny:
            stack.enter_context(tiny.tiny_backbones())
        path = write_folder(Path(folder) / "pi05", **({} if chosen.tiny else FULL))
        start = perf_counter()
        # Clamped: what random weights say would else be no rotation.
        options = {"device": chosen.device, "dtype": chosen.dtype, "allow_random_weights": True}
        try:
            policy = LeRobotPolicy.from_pretrained(path, **options, clamp=1.0, rtc=True)
        except CheckpointError as error:
            parser.error(str(error))
        built = perf_counter() - start
    count = sum(tensor.numel() for tensor in policy.checkpoint.network.parameters())
    where = torch.cuda.get_device_name(chosen.device) if chosen.device.startswith("cuda") else chosen.device
    print(f"{count:,} parameters, {chosen.dtype}, {where}; built in {built:.0f} s")
    table = measure(policy, chosen.chunks)
    print(f"{'chunk [ms]':22}" + "".join(f"{way:>16}" for way in WAYS))
    for steps, row in zip(STEPS, table, strict=True):
        print(f"{f'{steps} denoising steps':22}" + "".join(f"{value:16.1f}" for value in row))
    slopes = [np.polyfit(STEPS, column, 1)[0] for column in table.T]
    print(f"{'one denoising step':22}" + "".join(f"{value:16.2f}" for value in slopes))
    if chosen.device.startswith("cuda"):
        print(f"memory of the device: {torch.cuda.max_memory_allocated(chosen.device) / 1e9:.1f} GB at most")
    for real_time in (False, True) if chosen.seconds > 0.0 else ():
        name = "with" if real_time else "without"
        print(f"{name} real-time chunking: {in_the_loop(policy, chosen.seconds, real_time=real_time)}", flush=True)


if __name__ == "__main__":
    main()
