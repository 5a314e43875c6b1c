"""Strategy: run it, and look at what is compiled afterwards."""

from wholebody.episode.warm_up import warm_up
from wholebody.qp.compiled_program import ENTRIES


def test_after_warming_up_every_stage_of_the_tick_is_compiled():
    assert warm_up() > 0.0
    assert all(entry.is_compiled for entry in ENTRIES)
