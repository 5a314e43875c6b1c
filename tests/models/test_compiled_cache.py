"""Strategy: a cache of its own; what comes out of it against what is compiled, and with damaged and too many files."""

import mujoco
import numpy as np
import pytest

from models import compiled_cache, g1
from models.mujoco_model import build_mujoco, load_mujoco


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled_cache, "cache_dir", lambda: tmp_path)
    return tmp_path / "mujoco"


def image(model):
    buffer = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer


def test_a_model_from_the_cache_is_the_compiled_one_to_the_bit(folder, monkeypatch):
    first = load_mujoco(g1())
    made = image(build_mujoco(g1()).compile())
    monkeypatch.setattr("models.mujoco_model.build_mujoco", None)
    assert np.array_equal(image(first), made)
    assert np.array_equal(image(load_mujoco(g1())), made)


def test_other_settings_are_another_model(folder):
    one, other = load_mujoco(g1()), load_mujoco(g1(), timestep=0.001)
    assert (one.opt.timestep, other.opt.timestep) == (0.002, 0.001)
    assert load_mujoco(g1()).opt.timestep == 0.002
    assert len(list(folder.glob("*.mjb"))) == 2


def test_a_damaged_model_is_made_again(folder):
    wanted = image(load_mujoco(g1()))
    (path,) = folder.glob("*.mjb")
    path.write_bytes(path.read_bytes()[:-1000])
    assert np.array_equal(image(load_mujoco(g1())), wanted)
    assert [file.name for file in folder.iterdir()] == [path.name]


def test_the_oldest_of_too_many_goes(folder, monkeypatch):
    monkeypatch.setattr(compiled_cache, "MODELS_KEPT", 2)
    for timestep in (0.001, 0.002, 0.004):
        load_mujoco(g1(), timestep=timestep)
    assert len(list(folder.glob("*.mjb"))) == 2
    assert load_mujoco(g1(), timestep=0.004).opt.timestep == 0.004


def test_what_another_process_deletes_meanwhile_is_none(folder, monkeypatch):
    """Two processes that made a model each pruned at once: one of them met a file that was gone, and ended."""
    wanted = image(load_mujoco(g1()))
    glob = compiled_cache.Path.glob

    def late(path, pattern):
        gone = path / pattern.replace("*", "0")
        return [gone, *glob(path, pattern)] if path == folder else glob(path, pattern)

    monkeypatch.setattr(compiled_cache.Path, "glob", late)
    assert np.array_equal(image(load_mujoco(g1())), wanted)
    assert load_mujoco(g1(), timestep=0.004).opt.timestep == 0.004
