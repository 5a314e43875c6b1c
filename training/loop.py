"""``python -m training.loop [--task TASK] [--out FOLDER] ...``: record, train, evaluate, and a table of how it went.

Every step is a command of LeRobot, in its own process, offline; two that need nothing of each other run side by side.
ACT is trained on the state and on what is shown of the task, which `lerobot-record` writes into the state:
`training.shown` adds a column in between.
What is there already is not made again: a run that was ended goes on.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

ROOT, BIN, CORES = Path(__file__).parents[1], Path(sys.executable).parent, len(os.sched_getaffinity(0))
ACT = {
    "type": "act", "device": "cpu", "push_to_hub": "false", "dim_model": 128, "n_heads": 4, "dim_feedforward": 256,
    "n_encoder_layers": 3, "n_vae_encoder_layers": 2, "chunk_size": 20, "n_action_steps": 20, "use_vae": "false",
    "dropout": 0.0, "normalization_mapping": json.dumps(dict.fromkeys(("STATE", "ENV", "ACTION"), "MEAN_STD")),
}  # fmt: skip
"""Settings of the policy; chosen: 2.5 MB, and chunks of two thirds of a second, done to their end: people wait before
they set off, so a policy that looks again after a sixth of a second says once more to wait, and never sets off.
Without dropout and latent, since what is shown of the task says which of the ways is meant."""


@dataclass(frozen=True)
class Recording:
    """How an expert is recorded.

    Attributes:
        seconds: Time of an episode [s].
        reset: Time for the way back between two [s].
        disturb: Standard deviation of what leads hands aside meanwhile [m].
    """

    seconds: float
    reset: float
    disturb: float = 0.0


RECORDINGS = {
    "reach": Recording(3.6, 1.5, 0.02),
    "pick": Recording(9.6, 2.5),
    "place": Recording(13.8, 2.0),
    "lift": Recording(9.5, 2.5, 0.01),
}
"""Recordings by task. Of a reach, chosen: a second at the goal, most of the way back, so that episodes begin around
the stance, and aside by as much as a policy strays: what is recorded says how to come back, and at the goal that hands
go on to it, where undisturbed ones half say that they stay. A grasp does not bear that."""
RATE = 3e-4
"""Learning rate of the first step [no unit], which falls to a thirtieth; chosen."""


class Steps:
    """The steps of a loop, each told as it begins and how long it took.

    Args:
        folder: For everything that is made.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.seconds = folder, {}
        folder.mkdir(parents=True, exist_ok=True)

    def run(self, name: str, command: str, *arguments: str, threads: int = 1, **options: object) -> None:
        """Run a command, LeRobot's by its name, to its end, with so many threads; what it says is in a file.

        Raises:
            SystemExit: If it fails, with the end of what it said.
        """
        words = [
            str(BIN / command),
            *arguments,
            *(f"--{key.replace('__', '.')}={value}" for key, value in options.items()),
        ]
        home = {
            "HF_HOME": str(self.folder / "home"),
            "HF_LEROBOT_HOME": str(self.folder / "home"),
            "HF_HUB_OFFLINE": "1",
        }
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        log, begin = self.folder / f"{name}.log", perf_counter()
        print(f"{name}: {Path(command).name}, its words are in {log}", flush=True)
        with log.open("w") as out:
            environment = os.environ | home | {"OMP_NUM_THREADS": str(threads), "PYTHONPATH": path}
            done = subprocess.run(words, stdout=out, stderr=subprocess.STDOUT, check=False, env=environment, cwd=ROOT)
        self.seconds[name] = perf_counter() - begin
        print(f"{name}: {self.seconds[name]:.0f} s", flush=True)
        if done.returncode:
            raise SystemExit(f"{name} failed:\n{log.read_text()[-2000:]}")


def record(steps: Steps, name: str, task: str, episodes: int, seed: int, how: Recording) -> Path:
    """Record the expert in lockstep; the dataset's folder."""
    plain = steps.folder / name
    if not (plain / "meta" / "info.json").exists():
        shutil.rmtree(plain, ignore_errors=True)
        steps.run(
            name, "lerobot-record", robot__type="wholebody_g1", robot__clock="lockstep", robot__task=task,
            robot__id="g1", robot__seed=seed, robot__report=plain.with_suffix(".json"), robot__disturb=how.disturb,
            robot__discover_packages_path="lerobot_robot_wholebody", teleop__type="wholebody_expert",
            teleop__seed=seed, dataset__repo_id=f"loop/{name}", dataset__root=plain, dataset__single_task=task,
            dataset__num_episodes=episodes, dataset__episode_time_s=how.seconds, dataset__reset_time_s=how.reset,
            dataset__video="false", dataset__push_to_hub="false", play_sounds="false",
        )  # fmt: skip
    return plain


def replay(steps: Steps, recorded: Path, tries: int) -> dict[str, object]:
    """Success of recorded actions from hands that begin elsewhere, and falls."""
    found = steps.folder / "replay.json"
    if not found.exists():
        steps.run("replay", sys.executable, "-m", "training.replay", str(recorded), str(found), tries=tries)
    return json.loads(found.read_text())


def add_shown(steps: Steps, plain: Path) -> Path:
    """Give a dataset a column of what is shown of the task; the folder of the copy."""
    whole = steps.folder / "data"
    if not (whole / "meta" / "info.json").exists():
        part = whole.with_suffix(".part")
        for folder in (part, whole):
            shutil.rmtree(folder, ignore_errors=True)
        steps.run("add", sys.executable, "-m", "training.shown", str(plain), str(part))
        part.rename(whole)
    return whole


def train(steps: Steps, data: Path, count: int, batch: int, seed: int) -> Path:
    """Train ACT; the folder of its checkpoint."""
    out = steps.folder / "policy"
    checkpoint = out / "checkpoints" / "last" / "pretrained_model"
    if not checkpoint.exists():
        shutil.rmtree(out, ignore_errors=True)
        policy = {f"policy__{name}": value for name, value in ACT.items()}
        steps.run(
            "train", "lerobot-train", threads=CORES,
            dataset__repo_id="loop/data", dataset__root=data, output_dir=out, steps=count,
            batch_size=batch, num_workers=1, save_freq=count, log_freq=200, env_eval_freq=0, seed=seed,
            use_policy_training_preset="false", optimizer__type="adamw", optimizer__lr=RATE,
            optimizer__weight_decay=0.01, scheduler__type="cosine_decay_with_warmup", scheduler__num_warmup_steps=50,
            scheduler__num_decay_steps=count, scheduler__peak_lr=RATE, scheduler__decay_lr=RATE / 30.0, **policy,
        )  # fmt: skip
    return checkpoint


def evaluate(steps: Steps, task: str, checkpoint: Path, episodes: int, gate: bool) -> dict[str, object]:
    """Success of the policy in percent, by `lerobot-eval`, and falls, on seeds that were not recorded."""
    name = "policy, gate" if gate else "policy"
    out, report = steps.folder / f"eval{'_gate' if gate else ''}", steps.folder / f"eval{'_gate' if gate else ''}.json"
    if not (out / "eval_info.json").exists():
        steps.run(
            name, "lerobot-eval", env__type="wholebody", env__task=task, env__gate=str(gate).lower(),
            env__report=report, env__discover_packages_path="lerobot_robot_wholebody", policy__path=checkpoint,
            policy__device="cpu", output_dir=out, eval__n_episodes=episodes, eval__batch_size=1, seed=100_000,
        )  # fmt: skip
    found, falls = json.loads((out / "eval_info.json").read_text()), json.loads(report.read_text())["falls"]
    return {
        "success": found["overall"]["pc_success"],
        "episodes": episodes,
        "falls": falls,
        "seconds": steps.seconds.get(name),
    }


def experts(recorded: Path, task: str) -> dict[str, object]:
    """Success of the expert in a dataset that nothing disturbed, by the last state of its episodes, and falls."""
    from pyarrow import parquet

    from training.measure import done

    names = json.loads((recorded / "meta" / "info.json").read_text())["features"]["observation.state"]["names"]
    tables = [parquet.read_table(path) for path in sorted((recorded / "data").rglob("*.parquet"))]
    states = np.concatenate([np.array(table["observation.state"].to_pylist()) for table in tables])
    episode = np.concatenate([np.array(table["episode_index"]) for table in tables])
    count = [done(states[episode == number], names, task) for number in np.unique(episode)]
    return {"success": 100.0 * float(np.mean(count)), "episodes": len(count), "falls": int(fell(recorded))}


def fell(recorded: Path) -> bool:
    """Whether the robot fell before it was lowered at the end of a recording."""
    report = json.loads(recorded.with_suffix(".json").read_text())
    return report["fell_at"] is not None and report["fell_at"] < report["lowering_from"]


def undisturbed(steps: Steps, given: argparse.Namespace, how: Recording) -> dict[str, dict[str, object]]:
    """Success of the expert that nothing leads aside, and of replays of it from other starts."""
    recorded = record(steps, "expert", given.task, given.tries, given.seed, how)
    rows = {"expert": experts(recorded, given.task)}
    if given.task == "reach":
        rows["replay"] = replay(steps, recorded, given.tries)
    return rows


def main() -> None:
    """Run the loop, print its table."""
    parser = argparse.ArgumentParser(prog="python -m training.loop", description=__doc__)
    parser.add_argument("--task", default="reach", choices=RECORDINGS)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "loop")
    parser.add_argument("--episodes", type=int, default=120, help="that are recorded")
    parser.add_argument("--seconds", type=float, help="of an episode, if not as usual")
    parser.add_argument("--steps", type=int, default=2000, help="of training")
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--tries", type=int, default=20, help="episodes that the policy is evaluated in, each way")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    steps = Steps(given.out.resolve())
    how = RECORDINGS[given.task]
    how = replace(how, seconds=given.seconds or how.seconds)
    with ThreadPoolExecutor() as beside:
        alone = None
        if how.disturb:
            alone = beside.submit(undisturbed, steps, given, replace(how, disturb=0.0))
        plain = record(steps, "recorded", given.task, given.episodes, given.seed, how)
        rows = {"expert": experts(plain, given.task)} if alone is None else alone.result()
        rows["expert"]["falls"] += int(alone is not None and fell(plain))
        checkpoint = train(steps, add_shown(steps, plain), given.steps, given.batch, given.seed)
        of = steps, given.task, checkpoint, given.tries
        gated = beside.submit(evaluate, *of, gate=True)
        rows |= {"policy": evaluate(*of, gate=False), "policy, gate": gated.result()}
    (steps.folder / "loop.json").write_text(json.dumps({"rows": rows, "seconds": steps.seconds}, indent=2))
    print("| | success | episodes | falls |\n|---|---|---|---|")
    for name, row in rows.items():
        print(f"| {name} | {row['success']:.0f} % | {row['episodes']} | {row['falls']} |")
    print(", ".join(f"{name} {seconds:.0f} s" for name, seconds in steps.seconds.items()))


if __name__ == "__main__":
    main()
