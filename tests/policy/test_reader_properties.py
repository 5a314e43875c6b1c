"""Whatever a file holds, a reader reads it or refuses it with one printable sentence: no other exception, ever.

Strategy: hypothesis draws a seed, `tests.support.hostile_files` spoils a good input by it (truncation, bit flips, other
values, types, sizes and names), and the reader is called. `make fuzz-readers` does the same ten thousand times, under
limits of memory and time, and with the folders of LeRobot, of which the shorter list here has few.
"""

import shutil
from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from models.spec import RobotSpecError
from policy.errors import PolicyError
from tests.support.hostile_files import READERS, folder_reader, spoil
from wholebody.errors import WholebodyError

LIGHT = settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
FEW = settings(LIGHT, max_examples=10)


def read_or_refuse(reader, folder, seed):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    reader.write(folder)
    harm = spoil(folder, np.random.default_rng(seed))
    said = ""
    try:
        reader.read(folder)
    except (PolicyError, WholebodyError, RobotSpecError, OSError) as refusal:
        said = str(refusal)
    assert said.isprintable(), harm


@pytest.mark.parametrize("name", [name for name in READERS if name != "hdf5"])
@LIGHT
@given(seed=st.integers(0, 2**32 - 1))
def test_b7_a_spoilt_input_is_read_or_refused(name, tmp_path, seed):
    read_or_refuse(READERS[name], tmp_path / "case", seed)


@pytest.mark.skipif("hdf5" not in READERS, reason="h5py is not installed")
@FEW
@given(seed=st.integers(0, 2**32 - 1))
def test_a_spoilt_hdf5_is_read_or_refused(tmp_path, seed):
    read_or_refuse(READERS["hdf5"], tmp_path / "case", seed)  # each in a process of its own


@pytest.mark.parametrize("name", READERS)
def test_a_good_input_is_read(name, tmp_path):
    READERS[name].write(tmp_path)
    READERS[name].read(tmp_path)


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    pytest.importorskip("lerobot")
    from tests.support.dataset_cases import write_v21, write_v30

    folder = tmp_path_factory.mktemp("datasets")
    return {"v21": write_v21(folder / "v21", write_v30(folder / "v30")), "v30": folder / "v30"}


@pytest.mark.parametrize("version", ["v30", "v21"])
@FEW
@given(seed=st.integers(0, 2**32 - 1))
def test_b7_a_spoilt_dataset_is_read_or_refused(version, tmp_path, datasets, seed):
    copy = partial(shutil.copytree, datasets[version], dirs_exist_ok=True)
    read_or_refuse(folder_reader("dataset", copy), tmp_path / "case", seed)


@FEW
@given(seed=st.integers(0, 2**32 - 1))
def test_b7_a_spoilt_checkpoint_is_read_or_refused(tmp_path, tmp_path_factory, seed):
    pytest.importorskip("lerobot")
    from tests.support import tiny_policies as tiny

    good = tiny.saved("act", tmp_path_factory)
    copy = partial(shutil.copytree, good, dirs_exist_ok=True, ignore=shutil.ignore_patterns("model.safetensors"))
    read_or_refuse(folder_reader("checkpoint", copy), tmp_path / "case", seed)
