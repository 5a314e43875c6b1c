"""The benchmark of the full-size π0.5, which needs a GPU, on a tiny one: so that its lines run where there is none."""

import importlib.util
from pathlib import Path

import pytest
import torch

from tests.support import tiny_policies as tiny

SCRIPT = Path(__file__).parents[3] / "benchmarks" / "pi05_full_size.py"


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location("pi05_full_size", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_prints_a_row_for_each_number_of_steps_and_the_cost_of_one(benchmark, capsys, monkeypatch):
    monkeypatch.setattr(benchmark, "STEPS", (1, 3))
    benchmark.main(["--tiny", "--device", "cpu", "--dtype", "float32", "--chunks", "1", "--seconds", "1"])
    first, heading, *rows, plain, real_time = capsys.readouterr().out.splitlines()
    assert first.endswith("parameters, float32, cpu; built in 0 s")
    assert all(way in heading for way in benchmark.WAYS)
    assert [row.partition("  ")[0] for row in rows] == ["1 denoising steps", "3 denoising steps", "one denoising step"]
    assert all(float(number) > 0.0 for row in rows[:2] for number in row.split()[-4:])
    for line, way in ((plain, "without"), (real_time, "with")):
        assert line.startswith(f"{way} real-time chunking: ")
        assert line.endswith("it stood")


def test_without_a_gpu_it_says_so(benchmark, capsys, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(SystemExit) as end:
        benchmark.main(["--tiny", "--device", "cuda:17"])
    assert end.value.code == 2
    assert "device 'cuda:17' cannot be used" in capsys.readouterr().err


def test_the_configuration_is_that_of_the_full_size(benchmark, tmp_path):
    """Counted without memory: the stock π0.5 has 4.1 billion parameters."""
    from lerobot.policies.factory import get_policy_class

    settings = tiny.config("pi05", folder=tmp_path, size=benchmark.SIZE, **benchmark.FULL)
    settings.device = "meta"
    with torch.device("meta"):
        network = get_policy_class("pi05")(settings)
    assert 4.1e9 < sum(tensor.numel() for tensor in network.parameters()) < 4.2e9
