"""LeRobot's ACT in numpy: what a trained one says of a state and of what is shown of its task.

``python -m training.export CHECKPOINT FILE`` writes the file. It has the weights by LeRobot's own names, without the
encoder of actions, which only training uses, and means and standard deviations of what goes in and comes out.

Source:
    Zhao et al. 2023, "Learning Fine-Grained Bimanual Manipulation with Low-Cost Hardware"; `lerobot.policies.act`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from policy.archive import array_names, read_arrays
from policy.errors import PolicyError
from policy.reading import ReadingError

STATE, SHOWN, ACTION = "observation.state", "observation.environment_state", "action"
HEADS = "n_heads"
"""Name of the number of attention heads among the arrays."""
EPSILON = {"normal": 1e-5, "deviation": 1e-8}
"""What is added to a variance in the network and to a standard deviation around it; definition, torch's and LeRobot's
own."""
FILE_MAX = 3 * 2**20
"""Largest file [bytes]; chosen: ten of them are no burden to a package."""


class ActNetwork:
    """Weights of an ACT, and what it makes of observations.

    Args:
        arrays: By name, as `training.export` writes them.

    Attributes:
        horizon: Steps of a chunk.

    Raises:
        PolicyError: If one is missing.
    """

    def __init__(self, arrays: dict[str, np.ndarray]) -> None:
        self._arrays = arrays
        try:
            self._heads, self.horizon = int(arrays[HEADS]), len(arrays["decoder_pos_embed.weight"])
            self._scales = {
                key: (arrays[f"{key}.mean"], arrays[f"{key}.std"] + EPSILON["deviation"])
                for key in (STATE, SHOWN, ACTION)
            }
            self.chunk(*(np.zeros_like(arrays[f"{key}.mean"]) for key in (STATE, SHOWN)))
        except KeyError as error:
            raise PolicyError(f"there is no array {error} in what was exported") from error

    @classmethod
    def load(cls, path: Path) -> ActNetwork:
        """The network of a file.

        Raises:
            OSError: If it cannot be read.
            PolicyError: If it is none.
        """
        try:
            return cls(read_arrays(path, array_names(path, FILE_MAX), archive_max=FILE_MAX))
        except ReadingError as error:
            raise PolicyError(f"{path} {error}") from error

    def chunk(self, state: np.ndarray, shown: np.ndarray) -> np.ndarray:
        """Actions, shape (H, A), for a state (S,) and what is shown of the task (E,)."""
        (at, off), given = self._scales[ACTION], {}
        for key, numbers in ((STATE, state), (SHOWN, shown)):
            mean, deviation = self._scales[key]
            given[key] = ((np.asarray(numbers) - mean) / deviation).astype(np.float32)
        tokens = np.stack(
            [
                self._arrays["encoder_latent_input_proj.bias"],  # the latent is 0 where nothing is trained
                self._linear("encoder_robot_state_input_proj", given[STATE]),
                self._linear("encoder_env_state_input_proj", given[SHOWN]),
            ]
        )
        places, steps = self._arrays["encoder_1d_feature_pos_embed.weight"], self._arrays["decoder_pos_embed.weight"]
        seen = self._encoded(tokens, places)
        said = self._decoded(np.zeros_like(steps), steps, seen, seen + places)
        return self._linear("action_head", said).astype(float) * off + at

    def _encoded(self, x: np.ndarray, places: np.ndarray) -> np.ndarray:
        for layer in self._layers("encoder"):
            x = self._normal(f"{layer}.norm1", x + self._attention(f"{layer}.self_attn", x + places, x + places, x))
            x = self._normal(f"{layer}.norm2", x + self._inner(layer, x))
        return x

    def _decoded(self, x: np.ndarray, steps: np.ndarray, seen: np.ndarray, keys: np.ndarray) -> np.ndarray:
        for layer in self._layers("decoder"):
            x = self._normal(f"{layer}.norm1", x + self._attention(f"{layer}.self_attn", x + steps, x + steps, x))
            x = self._normal(f"{layer}.norm2", x + self._attention(f"{layer}.multihead_attn", x + steps, keys, seen))
            x = self._normal(f"{layer}.norm3", x + self._inner(layer, x))
        return self._normal("decoder.norm", x)

    def _layers(self, part: str) -> list[str]:
        """Names of the layers of a part, first to last."""
        numbers = {int(name.split(".")[2]) for name in self._arrays if name.startswith(f"{part}.layers.")}
        return [f"{part}.layers.{number}" for number in sorted(numbers)]

    def _linear(self, name: str, x: np.ndarray) -> np.ndarray:
        return x @ self._arrays[f"{name}.weight"].T + self._arrays[f"{name}.bias"]

    def _inner(self, layer: str, x: np.ndarray) -> np.ndarray:
        return self._linear(f"{layer}.linear2", np.maximum(self._linear(f"{layer}.linear1", x), 0.0))

    def _normal(self, name: str, x: np.ndarray) -> np.ndarray:
        off = x - x.mean(axis=-1, keepdims=True)
        scaled = off / np.sqrt(np.square(off).mean(axis=-1, keepdims=True) + np.float32(EPSILON["normal"]))
        return scaled * self._arrays[f"{name}.weight"] + self._arrays[f"{name}.bias"]

    def _attention(self, name: str, queries: np.ndarray, keys: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Multi-head attention of rows (n, D) to rows (k, D)."""
        weights = np.split(self._arrays[f"{name}.in_proj_weight"], 3)
        biases = np.split(self._arrays[f"{name}.in_proj_bias"], 3)
        q, k, v = (
            (x @ weight.T + bias).reshape(len(x), self._heads, -1).swapaxes(0, 1)
            for x, weight, bias in zip((queries, keys, values), weights, biases, strict=True)
        )
        scores = q @ k.swapaxes(1, 2) / np.sqrt(np.float32(q.shape[-1]))
        shares = np.exp(scores - scores.max(axis=-1, keepdims=True))
        shares /= shares.sum(axis=-1, keepdims=True)
        return self._linear(f"{name}.out_proj", (shares @ v).swapaxes(0, 1).reshape(len(queries), -1))
