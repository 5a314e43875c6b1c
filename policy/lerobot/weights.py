"""LeRobot networks whose every tensor is the file's.

`PI05Policy.from_pretrained` of LeRobot 0.6.1 catches every loading error, prints it, and returns a network with random
weights; π0 does the same. Here the network is compared with its file, tensor by tensor, after loading.
"""

from __future__ import annotations

import contextlib
import io
import logging
import os
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

from policy.findings import Finding, fail, require_no_error

if TYPE_CHECKING:
    from lerobot.configs import PreTrainedConfig
    from lerobot.policies.pretrained import PreTrainedPolicy

WEIGHTS_FILE = "model.safetensors"
NUMBERS_MAX, FILELESS_MAX = 8_000_000_000, 1_000_000
"""Most numbers of a network without a file, twice those of π0.5, and how many a network may compute by itself."""
_NAMED_MAX = 3
"""Tensors that a sentence names; the others are counted."""


def load_network(folder: Path, config: PreTrainedConfig) -> PreTrainedPolicy:
    """The network of a checkpoint, in evaluation mode, on the device of its configuration.

    Raises:
        CheckpointError: If the file is absent or cut short, or a tensor is missing, extra, of another shape, of another
            value than the file's, or not finite; names the file or the tensor.
    """
    from lerobot.policies.factory import get_policy_class

    file = folder / WEIGHTS_FILE
    stored = _stored_shapes(file)
    kind = get_policy_class(config.type)
    _require_size(kind, config, 2 * sum(map(prod, stored.values())) + FILELESS_MAX, f"what {file} has")
    try:
        with quiet():
            network = kind.from_pretrained(folder, config=config, strict=True)
    except (RuntimeError, KeyError, ValueError, OSError, ImportError) as error:
        # Torch's message lists parameters over several lines; a fresh network says which tensor of the file it is.
        network = _built(kind, config)
        with quiet():
            require_no_error(_compare_names(network, stored, _renamed(network, stored), file))
        raise fail("weights", f"{file} does not load: {error}", "save the checkpoint again") from error
    with quiet():
        renamed = _renamed(network, stored)
    require_no_error(_compare_names(network, stored, renamed, file))
    require_no_error(_compare_values(network, renamed, file))
    return _ready(network)


def random_network(config: PreTrainedConfig) -> PreTrainedPolicy:
    """A network with the random weights of its constructor, in evaluation mode.

    Raises:
        CheckpointError: If it cannot be built.
    """
    from lerobot.policies.factory import get_policy_class

    kind = get_policy_class(config.type)
    _require_size(kind, config, NUMBERS_MAX, f"{NUMBERS_MAX:,}")
    return _ready(_built(kind, config))


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep LeRobot's prints off standard output, where JSON may be read, and its hints on every loading off the log."""
    logging.root.addFilter(_is_error)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        logging.root.removeFilter(_is_error)


def _is_error(record: logging.LogRecord) -> bool:
    return record.levelno >= logging.ERROR


def _ready(network: PreTrainedPolicy) -> PreTrainedPolicy:
    network.to(network.config.device)
    network.eval()
    return network


def _built(kind: type[PreTrainedPolicy], config: PreTrainedConfig) -> PreTrainedPolicy:
    try:
        with quiet():
            return kind(config)
    except (RuntimeError, KeyError, ValueError, OSError, ImportError) as error:
        cure = "install g1-wholebody[lerobot]; config.json may be of another version of LeRobot"
        if config.type == "smolvla":
            cure = f"its backbone '{config.vlm_model_name}' must be on this machine: say tokenizer=FOLDER"
        raise fail("weights", f"the network of '{config.type}' cannot be built: {error}", cure) from error


def _require_size(kind: type[PreTrainedPolicy], config: PreTrainedConfig, most: int, than: str) -> None:
    """Refuse a network that is larger than its file before it takes memory.

    Tied tensors are stored once. π0 and π0.5 cannot be built without memory; their sizes are a variant's, by its name.
    """
    import torch

    try:
        with quiet(), torch.device("meta"):
            numbers = sum(tensor.numel() for tensor in kind(config).state_dict().values())
    except (RuntimeError, KeyError, ValueError, OSError, ImportError, NotImplementedError):
        return  # one that cannot be built without memory; where it cannot be built at all, building it says why
    if numbers > most:
        text = f"config.json describes a network of {numbers:,} numbers, which is more than {than}"
        raise fail("weights", text, "take config.json and weights from the same training run")


def _stored_shapes(file: Path) -> dict[str, tuple[int, ...]]:
    """Shape of every tensor of a safetensors file, from its header."""
    from safetensors import SafetensorError, safe_open

    cure = "copy the checkpoint again, or allow random weights on purpose"
    if not file.is_file():
        shards = sorted(path.name for path in file.parent.glob("*.safetensors") if path.name.startswith("model-"))
        what = f" (there are shards {shards}, which LeRobot does not read)" if shards else ""
        raise fail("weights", f"{file} is missing{what}", cure)
    try:
        with safe_open(file, framework="pt") as tensors:
            return {name: tuple(tensors.get_slice(name).get_shape()) for name in tensors.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        size = os.stat(file).st_size
        raise fail("weights", f"{file} is cut short or damaged, {size} bytes: {error}", cure) from error


class _Name(str):
    """Name of a tensor in the file, which goes through LeRobot's renaming in the tensor's place."""

    __slots__ = ()

    def clone(self) -> _Name:
        return self


def _renamed(network: PreTrainedPolicy, stored: dict[str, tuple[int, ...]]) -> dict[str, str]:
    """Tensor of the network -> tensor of the file, with the renaming that LeRobot applies while it loads."""
    names = {name: _Name(name) for name in stored}
    fix = getattr(network, "_fix_pytorch_state_dict_keys", None)
    if fix is None:
        return {name: str(origin) for name, origin in names.items()}
    fixed = fix(names, network.config)
    return {name if name.startswith("model.") else f"model.{name}": str(origin) for name, origin in fixed.items()}


def _aliases(network: PreTrainedPolicy) -> dict[str, str]:
    """Name of each tensor -> the first name of the same memory: tied weights are stored once."""
    first: dict[tuple, str] = {}
    return {
        name: first.setdefault((tensor.data_ptr(), tuple(tensor.shape)) if tensor.numel() else (name,), name)
        for name, tensor in network.state_dict(keep_vars=True).items()
    }


def _compare_names(
    network: PreTrainedPolicy, stored: dict[str, tuple[int, ...]], renamed: dict[str, str], file: Path
) -> list[Finding]:
    state, alias = network.state_dict(), _aliases(network)
    covered = {alias[name] for name in renamed if name in alias}
    missing = [name for name in state if alias[name] not in covered]
    used = {origin for name, origin in renamed.items() if name in state}
    extra = [name for name in stored if name not in used]
    shapes = [
        f"{origin} {stored[origin]} in the file, {tuple(state[name].shape)} in the network"
        for name, origin in renamed.items()
        if name in state and stored[origin] != tuple(state[name].shape)
    ]
    kind = network.config.type
    found = (
        (missing, "lacks tensors of the network", f"this is no complete '{kind}' checkpoint of this size"),
        (extra, "has tensors that the network lacks", f"config.json and weights belong to different '{kind}' networks"),
        (shapes, "has tensors of another shape", "config.json and weights belong to different networks"),
    )
    cure = "; take both from the same training run"
    return [
        Finding("weights", "error", f"{file} {what}: {_listed(names)}", f"{why}{cure}")
        for names, what, why in found
        if names
    ]


def _compare_values(network: PreTrainedPolicy, renamed: dict[str, str], file: Path) -> list[Finding]:
    import torch
    from safetensors import safe_open

    state, differing, infinite = network.state_dict(), [], []
    with safe_open(file, framework="pt") as tensors:
        for name, origin in renamed.items():
            if name not in state:
                continue
            wanted, found = tensors.get_tensor(origin), state[name].detach().cpu()
            if wanted.is_floating_point() and not bool(torch.isfinite(wanted).all()):
                infinite.append(origin)
            elif not torch.equal(wanted.to(found.dtype), found):
                differing.append(origin)
    findings = []
    if infinite:
        text = f"{file} has tensors that are not finite: {_listed(infinite)}"
        findings.append(Finding("weights", "error", text, "training diverged; take an earlier checkpoint"))
    if differing:
        text = f"after loading, tensors are not those of {file}: {_listed(differing)}"
        findings.append(Finding("weights", "error", text, "LeRobot loaded something else without saying so; report it"))
    return findings


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED_MAX} more" if len(names) > _NAMED_MAX else ""
    return ", ".join(names[:_NAMED_MAX]) + more
