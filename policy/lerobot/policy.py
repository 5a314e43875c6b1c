"""Any policy of LeRobot, as a policy of the G1: ``LeRobotPolicy.from_pretrained(folder)``.

LeRobot's own classes, processors and factory do the work; what is added is that nothing goes wrong in silence. Weights
are compared with their file, statistics, cameras, state, prompt and layout are checked, and whole chunks are
post-processed once, with the observation that they answer. torch and lerobot load when a checkpoint is opened.
"""

from __future__ import annotations

import contextlib
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.clock import EpisodeClock
from policy.dataset.stats import DEVIATIONS_99
from policy.errors import PolicyError
from policy.findings import Finding, require_no_error
from policy.lerobot.checkpoint import Checkpoint, LoadOptions, open_checkpoint
from policy.lerobot.inputs import Inputs
from policy.lerobot.stats import ACTION, mode_of, normaliser
from policy.observation import Observation
from policy.prefix import Prefix

RANGE_MULTIPLE = 1.2
"""Multiple of the trained range past which a predicted number is mentioned."""


class LeRobotPolicy:
    """A LeRobot checkpoint.

    Args:
        checkpoint: Its parts.
        findings: What the checks said.

    Attributes:
        spec: Layout of the actions.
        state_spec: Layout of the state that it reads, None if it reads none.
        findings: What the checks said, warnings included.
        name: Kind and folder.
    """

    sees_robot = True

    def __init__(self, checkpoint: Checkpoint, findings: tuple[Finding, ...] = ()) -> None:
        self.checkpoint, self.findings = checkpoint, tuple(findings)
        self.spec, self.state_spec = checkpoint.spec, checkpoint.state
        self.name = f"{checkpoint.network.config.type} {checkpoint.folder.name}"
        self.inputs = Inputs(checkpoint)
        step = normaliser(checkpoint.postprocessor, inverse=True)
        by_deviation = step is not None and mode_of(step, "ACTION") == "MEAN_STD"
        self._beyond = RANGE_MULTIPLE * (0.5 * DEVIATIONS_99 if by_deviation else 1.0)
        self._clock = EpisodeClock()
        self.reset()

    @classmethod
    def from_pretrained(
        cls, path: str | Path, *, spec: ActionSpec | str | None = None, **options: Any
    ) -> LeRobotPolicy:
        """Load a checkpoint, or refuse it.

        Args:
            path: Folder with ``config.json``, ``model.safetensors``, both processors and ``action_spec.json``.
            spec: Layout that the caller decodes, built-in name or spec; what the checkpoint says if None.
            **options: As in `policy.lerobot.checkpoint.LoadOptions`, for example ``device``, ``seed``, ``num_steps``,
                ``tokenizer``, ``cameras``, ``assume_spec``.

        Raises:
            CheckpointError: With one sentence for everything that is wrong with it, naming file or tensor.
            TypeError: If there is no such option.
        """
        choices = LoadOptions(**options)
        checkpoint, findings = open_checkpoint(path, spec, choices)
        require_no_error(findings)
        if checkpoint is None:
            raise PolicyError(f"{path} cannot be loaded: {findings[-1].text}")
        kind = RealTimeLeRobotPolicy if choices.rtc and cls is LeRobotPolicy else cls
        return kind(checkpoint, tuple(findings))

    @property
    def cameras(self) -> dict[str, tuple[int, int]]:
        """Height and width of the cameras that it was trained with, by the robot's names [px]."""
        return self.inputs.camera_sizes

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that should be known before running it."""
        return tuple(finding for finding in self.findings if finding.level == "warning")

    def reset(self, task: str = "") -> None:
        """Begin an episode: chunks from 0, no history, LeRobot's queues empty."""
        self._task = self._asked = task
        self._clock.reset()
        self._forget()

    def observe(self, observation: Observation) -> None:
        """See an observation that no chunk is asked for, once a step of the policy: for those that look back.

        Raises:
            ObservationError: If it is not what the policy was trained with.
        """
        batch, _ = self.inputs.batch(
            observation, Anchor.measured(observation, self.spec.robot), self._task_of(observation)
        )
        self.inputs.remember(observation.time, batch)

    def infer(self, observation: Observation) -> ActionChunk:
        """Chunk that answers an observation.

        Raises:
            ObservationError: If the observation is not what the policy was trained with.
            ChunkError: If what the network made is not finite or no rotation.
        """
        return self._chunk(observation)

    def predict(self, observation: Observation, *, noise: np.ndarray | None = None) -> np.ndarray:
        """Raw actions of the layout, shape (H, A), for an observation.

        Args:
            observation: What the robot senses.
            noise: Where denoising starts, in normalised numbers: (chunk_size, max_action_dim) for π0, π0.5 and SmolVLA,
                (horizon, A) for Diffusion. Drawn if None.

        Raises:
            ObservationError: If the observation is not what the policy was trained with.
            PolicyError: If the noise does not fit, or the network returns another shape than a chunk.
        """
        return self._predict(observation, Anchor.measured(observation, self.spec.robot), noise=noise, seq=0)[0]

    def _chunk(self, observation: Observation, prefix: Prefix | None = None) -> ActionChunk:
        anchor = Anchor.measured(observation, self.spec.robot)
        seq, _ = self._clock.tick(observation.time)
        actions, notes = self._predict(observation, anchor, prefix=prefix, seq=seq)
        chunk = decode(self.spec, actions, anchor, seq=seq, t_obs=observation.time)
        return dataclasses.replace(chunk, notes=(*notes, *chunk.notes)) if notes else chunk

    def _predict(
        self,
        observation: Observation,
        anchor: Anchor,
        *,
        noise: np.ndarray | None = None,
        prefix: Prefix | None = None,
        seq: int,
    ) -> tuple[np.ndarray, list[str]]:
        left_over = None if prefix is None else prefix.left_over(self.spec, anchor)
        batch, notes = self.inputs.batch(observation, anchor, self._task_of(observation), left_over)
        self.inputs.remember(observation.time, batch)
        batch, missing = self.inputs.with_history(observation.time, self.spec.fps, batch)
        settings: dict[str, Any] = {} if noise is None else {"noise": self._noise(noise)}
        normalised = batch.pop(ACTION, None)
        if prefix is not None:
            settings |= {
                "prev_chunk_left_over": normalised,
                "inference_delay": prefix.inference_delay,
                "execution_horizon": prefix.execution_horizon,
            }
        with self._sampling(seq):
            chunk = self.checkpoint.network.predict_action_chunk(batch, **settings)
        if tuple(chunk.shape) != (1, self.spec.horizon, self.spec.dim) and not self._converts:
            raise PolicyError(
                f"the network returned {tuple(chunk.shape)}; (1, {self.spec.horizon}, {self.spec.dim}) is expected"
            )
        chunk, notices = self._contained(chunk)
        # Once for the whole chunk and at once: relative actions are added to the state that was preprocessed last.
        actions = self.checkpoint.postprocessor(chunk)
        return actions[0].detach().cpu().double().numpy(), [*notes, *missing, *notices]

    @property
    def _converts(self) -> bool:
        """Whether the post-processor changes the width, from wrists to joints."""
        return any(hasattr(step, "conversion") for step in self.checkpoint.postprocessor.steps)

    def _contained(self, chunk: Any) -> tuple[Any, list[str]]:
        """The normalised chunk, clamped if that is wanted, and what lies beyond training."""
        limit, end, size = self.checkpoint.options.clamp, self._beyond, np.abs(chunk.detach().float().cpu().numpy())
        most = float(size.max())
        if limit is not None:
            chunk = chunk.clamp(-limit, limit)
        if most <= end:
            return chunk, []
        share = np.count_nonzero(size > end) / size.size
        done = "" if limit is None else f", clamped to {limit:g}"
        return chunk, [f"{100 * share:.0f} % of the numbers are beyond {end:.2g} (normalised), up to {most:.2g}{done}"]

    def _task_of(self, observation: Observation) -> str:
        """The task now; another one than before makes a policy forget what it had planned for that."""
        task = observation.task or self._task or self.checkpoint.options.task
        if task != self._asked:
            self._asked = task
            self._forget()
        return task

    def _forget(self) -> None:
        self.checkpoint.network.reset()
        self.inputs.reset()

    @contextlib.contextmanager
    def _sampling(self, seq: int) -> Any:
        """Random numbers of this chunk's own where a seed was given, and the precision of training."""
        import torch

        config, seed = self.checkpoint.network.config, self.checkpoint.options.seed
        with contextlib.ExitStack() as stack:
            if config.use_amp:
                stack.enter_context(torch.autocast(device_type=torch.device(config.device).type))
            if seed is not None:
                devices = [config.device] if str(config.device).startswith("cuda") else []
                stack.enter_context(torch.random.fork_rng(devices=devices))
                torch.manual_seed(seed + seq)
            yield

    def _noise(self, noise: np.ndarray) -> Any:
        import torch

        config = self.checkpoint.network.config
        denoises = hasattr(config, "num_inference_steps") or hasattr(config, "num_steps")
        shape = (
            (config.chunk_size, config.max_action_dim)
            if hasattr(config, "max_action_dim")
            else (getattr(config, "horizon", 0), config.action_feature.shape[0])
        )
        given = torch.as_tensor(noise, dtype=torch.float32)
        if not denoises or tuple(given.shape) != shape:
            expected = f"{shape} is expected" if denoises else f"'{config.type}' does not denoise"
            raise PolicyError(f"noise has shape {tuple(given.shape)}; {expected}")
        return given[None].to(config.device)


class RealTimeLeRobotPolicy(LeRobotPolicy):
    """A checkpoint that continues what is being executed, by LeRobot's real-time chunking (``rtc=True``)."""

    def infer_after(self, observation: Observation, prefix: Prefix) -> ActionChunk:
        """Chunk that answers an observation and agrees with the prefix.

        Raises:
            ObservationError: If the observation is not what the policy was trained with.
            ChunkError: If what the network made is not finite or no rotation.
        """
        return self._chunk(observation, prefix)
