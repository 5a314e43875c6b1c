"""``python -m tests.studies.reach_recipe [--undisturbed]``: whether a policy of `make loop` arrives and stays.

Without a robot: wrists are where they were asked to be a step before, so that a recipe is tried in the minutes that its
training takes. ACT learns reaches of the expert as `training.loop` records them, with its settings. Told are what it
says of the way to a goal where it stands there, and beside it, and who of 200 new goals is reached by `tasks.Reach`,
by how many of its actions are done before it looks again.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
import torch
from lerobot.configs import FeatureType, NormalizationMode, PolicyFeature
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy

from lerobot_robot_wholebody.target import Disturbance, Numbers, palm_of
from lerobot_robot_wholebody.tasks import REACHED, SIDES, Reach
from lerobot_robot_wholebody.wholebody_expert import Hands, _Points
from policy.action_spec.anchor import Anchor
from policy.dataset.stats import statistics, widened
from policy.geometry.se3 import inverse, make_transform
from training.export import arrays_of
from training.loop import ACT, RATE, RECORDINGS
from training.shown import LEAST

FPS, GOALS = 30, 200
"""Actions a second [Hz], and new goals that are tried."""
ARRIVES = 0.0015
"""Distance of a palm from where it was asked to be a step before, standard deviation along an axis [m]; as measured of
the robot."""
ACTION, STATE, SHOWN = "action", "observation.state", "observation.environment_state"
NETWORK = (
    "dim_model",
    "n_heads",
    "dim_feedforward",
    "n_encoder_layers",
    "n_vae_encoder_layers",
    "chunk_size",
    "dropout",
)


class Stance:
    """The stance, in numbers of states and actions."""

    def __init__(self) -> None:
        numbers = Numbers()
        anchor = Anchor.nominal(robot=numbers.spec.robot)
        T = inverse(anchor.T_world_stance) @ anchor.T_world_base
        wrists = [T @ anchor.poses[hand] for hand in ("lhand", "rhand")]
        self.R = np.array([wrist[:3, :3] for wrist in wrists])
        self.palms = np.array([palm_of(*one, numbers) for one in zip(wrists, SIDES, strict=True)])
        self._away = self.palms - np.array([wrist[:3, 3] for wrist in wrists])
        self._rest = {}
        for key, names in ((ACTION, numbers.action_names), (STATE, numbers.state_names)):
            row = np.zeros(len(names))
            for side, R in zip(SIDES, self.R, strict=True):
                for k, value in enumerate(R[:, :2].T.ravel()):
                    row[names.index(f"{side}_wrist_r6_{k}.pos")] = value
            places = [[names.index(f"{side}_wrist_{axis}.pos") for axis in "xyz"] for side in SIDES]
            self._rest[key] = row, np.array(places)

    def numbers(self, key: str, palms: np.ndarray) -> np.ndarray:
        """A row of actions or states for palms (..., 2, 3) in the stance."""
        row, places = self._rest[key]
        rows = np.tile(row, (*palms.shape[:-2], 1))
        rows[..., places] = palms - self._away
        return rows

    def seen(self, palms: np.ndarray, goals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """State and what is shown of the task for palms and goals, (..., 2, 3) each."""
        ways = (goals - palms).reshape(*palms.shape[:-2], 6)
        return np.concatenate([self.numbers(STATE, palms), ways], axis=-1), ways

    def palms_of(self, actions: np.ndarray) -> np.ndarray:
        """Palms (..., 2, 3) that actions ask for."""
        return actions[..., self._rest[ACTION][1]] + self._away


def episode(stance: Stance, rng: np.random.Generator, seconds: float, disturb: float) -> dict[str, np.ndarray]:
    """One of the expert's reaches from the stance, rows by the dataset's column."""
    task, fingers, asked, palms = Reach(0), (np.zeros(7), np.zeros(7)), [], []
    task.draw(rng)
    way = _Points(rng, Hands(stance.palms, stance.R, fingers), Hands(task.goals, stance.R, fingers))
    disturbance, here = Disturbance(disturb, int(rng.integers(1 << 31))), stance.palms
    for time_said in np.arange(round(seconds * FPS)) / FPS:
        asked.append(way.at(time_said).palms)
        palms.append(here)
        parts = {hand: make_transform(np.eye(3), p) for hand, p in zip(("lhand", "rhand"), asked[-1], strict=True)}
        led = disturbance.led(parts, time_said)
        here = np.array([led["lhand"][:3, 3], led["rhand"][:3, 3]]) + rng.normal(0.0, ARRIVES, (2, 3))
    state, shown = stance.seen(np.array(palms), np.broadcast_to(task.goals, (len(palms), 2, 3)))
    return {ACTION: stance.numbers(ACTION, np.array(asked)), STATE: state, SHOWN: shown}


class Trained:
    """ACT, trained on episodes.

    Args:
        episodes: Of `episode`.
        steps: Of training.
        batch: Frames in a step.
        seed: Of weights and batches.
    """

    def __init__(self, episodes: list[dict[str, np.ndarray]], steps: int, batch: int, seed: int) -> None:
        torch.manual_seed(seed)
        rows = {key: np.concatenate([one[key] for one in episodes]) for key in (ACTION, STATE, SHOWN)}
        wide = {key: widened(statistics(all_), np.full(all_.shape[1], LEAST)) for key, all_ in rows.items()}
        self._scale = {key: (np.asarray(one["mean"]), np.asarray(one["std"])) for key, one in wide.items()}
        kinds = {STATE: FeatureType.STATE, SHOWN: FeatureType.ENV}
        config = ACTConfig(
            device="cpu", use_vae=False, **{name: ACT[name] for name in NETWORK}, n_action_steps=ACT["chunk_size"],
            input_features={key: PolicyFeature(kind, rows[key].shape[1:]) for key, kind in kinds.items()},
            output_features={ACTION: PolicyFeature(FeatureType.ACTION, rows[ACTION].shape[1:])},
            normalization_mapping=dict.fromkeys(("STATE", "ENV", "ACTION"), NormalizationMode.MEAN_STD),
        )  # fmt: skip
        self._policy, lengths = ACTPolicy(config), [len(one[ACTION]) for one in episodes]
        ends = np.repeat(np.cumsum(lengths), lengths)
        tensors = {key: self._scaled(key, all_) for key, all_ in rows.items()}
        self._train(tensors, ends, np.random.default_rng(seed), steps, batch)

    def _scaled(self, key: str, rows: np.ndarray) -> torch.Tensor:
        mean, std = self._scale[key]
        return torch.tensor((rows - mean) / (std + 1e-8), dtype=torch.float32)

    def _train(self, rows: dict[str, torch.Tensor], ends: np.ndarray, rng: np.random.Generator, steps: int, batch: int):
        policy = self._policy.train()
        optimizer = torch.optim.AdamW(policy.parameters(), lr=RATE, weight_decay=0.01)
        for step in range(steps):
            share = step / 50 if step < 50 else 1 / 30 + (1 - 1 / 30) * 0.5 * (1 + np.cos(np.pi * step / steps))
            optimizer.param_groups[0]["lr"] = RATE * share
            frames = rng.integers(0, len(ends), batch)
            later = frames[:, None] + np.arange(policy.config.chunk_size)
            last = ends[frames][:, None] - 1
            given = {key: rows[key][frames] for key in (STATE, SHOWN)}
            given |= {ACTION: rows[ACTION][np.minimum(later, last)], "action_is_pad": torch.tensor(later > last)}
            loss, _ = policy.forward(given)
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(policy.parameters(), 10.0)
            optimizer.step()

    def arrays(self) -> dict[str, np.ndarray]:
        """What `policy.learned.act.ActNetwork` runs."""
        return arrays_of(self._policy, {key: {"mean": mean, "std": std} for key, (mean, std) in self._scale.items()})

    def chunks(self, state: np.ndarray, shown: np.ndarray) -> np.ndarray:
        """Actions (n, H, 32) for rows of state and of what is shown of the task."""
        said = self._policy.predict_action_chunk({STATE: self._scaled(STATE, state), SHOWN: self._scaled(SHOWN, shown)})
        mean, std = self._scale[ACTION]
        return said.numpy() * (std + 1e-8) + mean


def drawn(seed: int) -> np.ndarray:
    """Goals (2, 3) as drawn by a seed that is not recorded."""
    task = Reach(0)
    task.draw(np.random.default_rng(100_000 + seed))
    return task.goals


def standing(stance: Stance, policy: Trained, goals: np.ndarray) -> None:
    """Tell what a policy says that stands at goals (n, 2, 3), or beside them."""
    rng = np.random.default_rng(0)
    for off in (0.0, 0.01, 0.03):
        way = rng.normal(size=goals.shape)
        way *= off / np.linalg.norm(way, axis=-1, keepdims=True)
        said = stance.palms_of(policy.chunks(*stance.seen(goals + way, goals))[:, 0]) - goals
        far = 1e3 * np.linalg.norm(said, axis=-1).max(axis=1)
        kept = (said * way).sum() / max((way * way).sum(), 1e-12)
        text = f"says where {np.median(far):.0f} mm from it are, 90 % within {np.quantile(far, 0.9):.0f} mm"
        print(f"{1e3 * off:.0f} mm beside the goal: {text}; keeps {kept:.2f} of the offset", flush=True)


def reaches(stance: Stance, policy: Trained, goals: np.ndarray, actions: int) -> None:
    """Tell who of goals (n, 2, 3) is reached."""
    palms, held, done = np.tile(stance.palms, (len(goals), 1, 1)), np.zeros(len(goals), int), np.zeros(len(goals), bool)
    for step in range(Reach.steps):
        if step % actions == 0:
            asked = stance.palms_of(policy.chunks(*stance.seen(palms, goals)))
        palms = asked[:, step % actions]
        far = np.linalg.norm(palms - goals, axis=-1).max(axis=1)
        held = np.where(far <= REACHED, held + 1, 0)
        done |= held >= Reach.held
    text = " / ".join(f"{1e3 * one:.0f}" for one in np.quantile(far, (0.5, 0.9, 1.0)))
    print(f"{actions} actions done: {done.sum()} of {len(goals)} reached; at the end {text} mm off (50, 90, 100 %)")


def main() -> None:
    """Train, and tell."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--undisturbed", action="store_true", help="nothing leads hands aside in what is learned from")
    for name, usual in (("episodes", 120), ("steps", 2000), ("batch", 32), ("seed", 0)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    parser.add_argument("--seconds", type=float, default=RECORDINGS["reach"].seconds, help="of an episode")
    given, stance, begin = parser.parse_args(), Stance(), time.process_time()
    how = replace(RECORDINGS["reach"], seconds=given.seconds)
    disturb = 0.0 if given.undisturbed else how.disturb
    rngs = (np.random.default_rng([given.seed, number]) for number in range(given.episodes))
    episodes = [episode(stance, rng, how.seconds, disturb) for rng in rngs]
    policy = Trained(episodes, given.steps, given.batch, given.seed)
    print(f"trained in {time.process_time() - begin:.0f} s of CPU time")
    goals = np.array([drawn(seed) for seed in range(GOALS)])
    standing(stance, policy, goals)
    for actions in (5, 10, 20):
        reaches(stance, policy, goals, actions)


if __name__ == "__main__":
    main()
