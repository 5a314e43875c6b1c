"""The example chunk file of every layout can be read back, stays in reach and goes where it says."""

import numpy as np
import pytest

from policy import LAYOUTS, Anchor, builtin, read_chunk_file, write_chunk_file
from policy.recorded.example import RISE, example_file


def test_an_example_of_a_layout_that_cannot_say_it_is_the_stance():
    chunk = example_file(builtin("joint23")).chunk()
    assert np.ptp(chunk.T_world_lhand, axis=0).max() == 0.0


@pytest.mark.parametrize("name", [name for name in LAYOUTS if name != "joint23"])
def test_an_example_chunk_raises_both_hands_in_every_layout(name, tmp_path):
    write_chunk_file(tmp_path / "example.npz", example_file(builtin(name)))
    file, anchor = read_chunk_file(tmp_path / "example.npz"), Anchor.nominal()
    chunk = file.chunk()
    ignored = [note for note in chunk.notes if "is ignored" in note]
    assert (file.spec, len(chunk), list(chunk.notes)) == (builtin(name), builtin(name).horizon, ignored)
    for hand in ("lhand", "rhand"):
        T, start = getattr(chunk, f"T_world_{hand}"), anchor.T_world_base @ anchor.poses[hand]
        np.testing.assert_allclose(T[0], start, atol=1e-6)
        np.testing.assert_allclose(T[-1, :3, 3] - start[:3, 3], (0.0, 0.0, RISE), atol=1e-6)
