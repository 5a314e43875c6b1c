"""Inputs for reports, and what is in a page."""

import base64
import json
import re
import zlib

import numpy as np

from policy.action_spec.builtin import builtin
from policy.action_spec.codec import Anchor, encode
from policy.recorded.chunk_file import ChunkFile, write_chunk_file
from tests.support.planted_causes import chunk_of, moved

GOALS = {"fine": ((0.42, 0.2, 0.95), 1.2), "too_fast": ((0.45, 0.35, 1.25), 0.22), "too_far": ((0.95, 0.25, 1.25), 1.2)}
"""Where the left palm goes [m], and in what time [s]."""


def chunk_file(folder, name):
    """A chunk of the left hand that is fine, too fast or too far, as a file."""
    spec, chunk, path = builtin("wbc32"), chunk_of(left=moved(*GOALS[name])), folder / f"{name}.npz"
    write_chunk_file(path, ChunkFile(spec, encode(spec, chunk, Anchor.nominal()), chunk.fps, 0.0))
    return path


def element(text, name):
    """What an element of a page holds."""
    return re.search(rf'id="{name}-data">([^<]*)<', text)[1]


def contents(text):
    """Words and arrays of a page."""
    about = json.loads(element(text, "about"))
    values = np.frombuffer(zlib.decompress(base64.b64decode(element(text, "arrays"))), dtype="<f4")
    arrays = {}
    for name, (at, *shape) in about["arrays"].items():
        arrays[name] = values[at : at + int(np.prod(shape))].reshape(shape)
    return about, arrays
