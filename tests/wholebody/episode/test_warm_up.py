"""Strategy: run it, and look at what is compiled afterwards."""

from types import BuiltinFunctionType

from wholebody.episode.warm_up import warm_up
from wholebody.qp.compiled import STAGES, compiled_stages


def test_after_warming_up_every_stage_of_the_tick_is_compiled():
    assert warm_up() > 0.0
    assert len(compiled_stages()) == len(STAGES)
    assert all(isinstance(stage, BuiltinFunctionType) for stage in compiled_stages())
