"""A tiny π0.5 that answers its noise, but for a few millimetres: samples that scatter as those of a trained one do."""

from pathlib import Path

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode, encode
from policy.lerobot.policy import LeRobotPolicy
from policy.lerobot.spec import write_specs
from tests.support import tiny_policies as tiny

SPEC = builtin("wbc32")
NARROW = 0.2
"""Range of its statistics in terms of those of `tiny_policies` [no unit]: its field moves palms by millimetres."""


def guided_pi05(folder) -> LeRobotPolicy:
    """A policy of the default layout, loaded from a folder that is written."""
    statistics = tiny.stats(SPEC)
    for key in ("observation.state", "action"):
        middle = statistics[key]["mean"]
        statistics[key] = {
            name: value * NARROW if name == "std" else (middle + NARROW * (value - middle)).astype(np.float32)
            for name, value in statistics[key].items()
        }
    for part in tiny.build("pi05", folder, spec=SPEC, statistics=statistics):
        part.save_pretrained(folder)
    write_specs(Path(folder), SPEC)
    return tiny.load(folder, allow_narrow=True)


def samples_of(policy, chunks):
    """What it answers in the stance to noise that chunks are (n), as chunks."""
    anchor, dim = Anchor.nominal(), policy.spec.dim
    statistics, seen, found = tiny.stats(SPEC), tiny.observation(), []
    middle, half = statistics["action"]["mean"], NARROW * tiny.HALF_RANGE
    for chunk in chunks:
        noise = np.zeros((policy.spec.horizon, 32), np.float32)
        noise[:, :dim] = (encode(policy.spec, chunk, anchor) - middle) / half
        found.append(decode(policy.spec, policy.predict(seen, noise=noise), anchor))
    return found
