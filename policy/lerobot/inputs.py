"""Observations as a LeRobot network takes them: cameras, state, task, history."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.state import state_numbers
from policy.dataset.stats import in_units
from policy.errors import ObservationError
from policy.lerobot.features import ENVIRONMENT, camera_keys, resizes_images
from policy.lerobot.prompt import require_whole_prompt, tokenizer_step, tokenizing
from policy.lerobot.stats import ACTION, STATE, bounds, normaliser
from policy.observation import Observation
from policy.placeholder_cameras import with_grey

if TYPE_CHECKING:
    import torch

    from policy.lerobot.checkpoint import Checkpoint

RANGE_FLOOR = 0.1
"""Least range of a number of state by which an excess is judged [m, rad, 1]: a robot stands within a decimetre of where
it was taught, whatever moved in the demonstrations."""
EXCESS_MAX = 2.0
"""Ranges beyond training at which a state is refused. In π0.5 every number above the range is the same bin 255, and
every one below it the bin -1: the network cannot tell how far off it is."""


class Inputs:
    """Makes batches from observations, and keeps what a policy with a history has seen.

    Args:
        checkpoint: The loaded checkpoint.
    """

    def __init__(self, checkpoint: Checkpoint) -> None:
        self.checkpoint, self.config = checkpoint, checkpoint.network.config
        self.cameras = {
            checkpoint.options.cameras.get(name, name): key for name, key in camera_keys(self.config).items()
        }
        self._tokenizer = tokenizer_step(checkpoint.preprocessor)
        self._range = _state_range(checkpoint)
        self.reset()

    def reset(self) -> None:
        """Forget the history."""
        self._past: deque[tuple[float, dict[str, torch.Tensor]]] = deque()

    @property
    def reads_text(self) -> bool:
        """Whether the policy is told its task."""
        return self._tokenizer is not None

    @property
    def camera_sizes(self) -> dict[str, tuple[int, int]]:
        """Height and width of every camera in training, by the robot's name [px]."""
        shapes = {name: self.config.image_features[key].shape for name, key in self.cameras.items()}
        return {name: (int(height), int(width)) for name, (_, height, width) in shapes.items()}

    def batch(
        self, observation: Observation, anchor: Anchor, task: str, left_over: np.ndarray | None = None
    ) -> tuple[dict[str, Any], list[str]]:
        """Input of a network, through the checkpoint's pre-processor.

        Args:
            observation: What the robot senses.
            anchor: ``Anchor.measured(observation)``.
            task: What to do.
            left_over: Raw actions still to be executed, shape (n, A); they come back normalised under ``action``.

        Returns:
            The batch, and what is unusual about the observation, one sentence each.

        Raises:
            ObservationError: If a camera, an image, the state or the task is not what the policy was trained with.
        """
        import torch

        if self.reads_text and not task.strip():
            raise ObservationError("there is no task; this policy reads one: give it to reset, or with the observation")
        if self.checkpoint.options.placeholder_cameras:
            observation = with_grey(observation, self.camera_sizes)
        raw, notes = self._images(observation)
        if self.checkpoint.state is not None:
            numbers = state_numbers(self.checkpoint.state, observation, anchor)
            notes += self._check_state(numbers)
            raw[STATE] = torch.from_numpy(numbers.astype(np.float32)).to(self.config.device)
        if ENVIRONMENT in self.config.input_features:
            raw[ENVIRONMENT] = self._environment(observation)
        if left_over is not None:
            raw[ACTION] = torch.from_numpy(left_over.astype(np.float32))[None].to(self.config.device)
        with tokenizing():
            batch = self.checkpoint.preprocessor({**raw, "task": task})
        if self._tokenizer is not None:
            require_whole_prompt(self.config, self._tokenizer, batch)
        return batch, notes

    def remember(self, time: float, batch: dict[str, Any]) -> None:
        """Keep an observation for the ones after it, where the policy looks back."""
        from lerobot.utils.constants import OBS_IMAGE, OBS_IMAGES

        if not self._has_queues():
            return
        import torch

        kept = {key: value for key, value in batch.items() if isinstance(value, torch.Tensor)}
        images = [batch[key] for key in self.config.image_features if key in batch]
        if images:
            # As LeRobot's select_action puts them: the cameras of an instant in one tensor.
            kept |= {OBS_IMAGES: torch.stack(images, dim=-4), OBS_IMAGE: images[0]}
        self._past.append((time, kept))

    def with_history(self, time: float, fps: float, batch: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
        """Put the observations that a network looks back on into its queues.

        The nearest remembered observation to each of its instants ``time - k / fps`` is taken; where none is within
        half a step, the next one stands in for it, as LeRobot does after a reset.

        Args:
            time: Of the last observation that was remembered [s].
            fps: Steps of the policy a second [Hz].
            batch: Of that observation.

        Returns:
            The batch with what goes with the queues, and what is missing, one sentence.
        """
        if not self._has_queues():
            return batch, []
        oldest = time - (self.config.n_obs_steps - 0.5) / fps
        while len(self._past) > 1 and self._past[0][0] < oldest:
            self._past.popleft()
        network = self.checkpoint.network
        network.reset()
        frames = self._frames(time, fps)
        for frame in frames:
            for key, queue in network._queues.items():
                if key in frame:
                    queue.append(frame[key])
        missing = len(frames) - len({id(frame) for frame in frames})
        text = f"{missing} of {len(frames)} observations of the history are missing; later ones stand in for them"
        return batch | frames[-1], [text] if missing else []

    def _frames(self, time: float, fps: float) -> list[dict[str, torch.Tensor]]:
        """One batch for each instant of the history, oldest first."""
        times = np.array([past for past, _ in self._past])
        frames = [self._past[-1][1]]
        for k in range(1, self.config.n_obs_steps):
            off = np.abs(times - (time - k / fps))
            frames.insert(0, self._past[int(off.argmin())][1] if off.min() <= 0.5 / fps else frames[0])
        return frames

    def _has_queues(self) -> bool:
        queues = getattr(self.checkpoint.network, "_queues", None) or {}
        return any(key != ACTION for key in queues)

    def _images(self, observation: Observation) -> tuple[dict[str, Any], list[str]]:
        import torch

        self._check_cameras(observation)
        tensors, notes = {}, []
        for name, key in self.cameras.items():
            image = observation.images[name]
            size, trained = image.shape[:2], tuple(self.config.image_features[key].shape[1:])
            if size != trained and not resizes_images(self.config):
                raise ObservationError(
                    f"camera '{name}' is {size[1]} x {size[0]}, '{self.config.type}' was trained with "
                    f"{trained[1]} x {trained[0]} and does not resize: set the camera to that size, or resize before"
                )
            if size[0] * trained[1] != size[1] * trained[0]:
                notes.append(
                    f"camera '{name}' is {size[1]} x {size[0]}, in training {trained[1]} x {trained[0]}: "
                    "the network sees other black bars"
                )
            # Always a copy: the camera may write on, and torch takes no view with negative strides.
            pixels = np.array(image.transpose(2, 0, 1), order="C")
            tensors[key] = torch.from_numpy(pixels).to(self.config.device).to(torch.float32).div_(255.0)
        return tensors, notes

    def _check_cameras(self, observation: Observation) -> None:
        there, wanted = set(observation.images), set(self.cameras)
        missing, extra = sorted(wanted - there), sorted(there - wanted)
        # A user who mapped cameras has said which ones are meant.
        if missing or (extra and not self.checkpoint.options.cameras):
            lacks = f"lacks {', '.join(missing)}" if missing else "has all of them"
            more = f" and has {', '.join(extra)} besides" if extra else ""
            raise ObservationError(
                f"the policy was trained with the cameras {', '.join(sorted(wanted)) or 'none'}; the observation "
                f"{lacks}{more}. Name them alike, or say which is which: cameras={{'POLICY': 'ROBOT'}}"
            )

    def _environment(self, observation: Observation) -> torch.Tensor:
        import torch

        values = np.asarray(self.checkpoint.options.environment(observation), dtype=np.float32)
        shape = tuple(self.config.input_features[ENVIRONMENT].shape)
        if values.shape != shape or not np.isfinite(values).all():
            raise ObservationError(f"environment gives {values}; {shape[0]} finite numbers are expected")
        return torch.from_numpy(values).to(self.config.device)

    def _check_state(self, numbers: np.ndarray) -> list[str]:
        if self._range is None:
            return []
        low, high, floor = self._range
        beyond = np.maximum(low - numbers, numbers - high)
        excess = beyond / np.maximum(high - low, floor)
        i = int(excess.argmax())
        if excess[i] <= 0.0:
            return []
        name = self.checkpoint.state.feature_names[i]
        text = f"{name} of the state is {numbers[i]:.3g}, in training {low[i]:.3g} to {high[i]:.3g}"
        if not excess[i] <= EXCESS_MAX:
            raise ObservationError(f"{text}: start nearer to the demonstrations, or train there")
        more = int((beyond > 0.0).sum()) - 1
        return [f"{text}{f', and {more} more are outside' if more else ''}"]


def _state_range(checkpoint: Checkpoint) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """What the state was in training, and `RANGE_FLOOR` in its units; each of shape (n,)."""
    step, state = normaliser(checkpoint.preprocessor), checkpoint.state
    found = None if step is None or state is None else bounds(step, STATE, "STATE")
    # A pre-processor that converts joints to wrists normalises other numbers than the robot's.
    if found is None or len(found[0]) != state.dim:
        return None
    return *found, in_units(state, RANGE_FLOOR)
