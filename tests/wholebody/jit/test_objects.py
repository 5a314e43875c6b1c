"""Strategy: the cache of machine code in a folder of its own, with what other processes leave there."""

import pytest

from models.cache import CACHE_VARIABLE
from wholebody.jit import objects

KEY = "0" * 64


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    return objects.folder()


def test_what_is_kept_is_found_and_what_is_damaged_is_not(folder):
    objects.keep("kernel", KEY, b"code")
    assert objects.find("kernel", KEY) == b"code"
    (path,) = folder.iterdir()
    path.write_bytes(path.read_bytes() + b"x")
    assert objects.find("kernel", KEY) is None


def test_a_file_that_another_process_forgets_meanwhile_is_no_error(folder):
    """A process that compiled while others did ended with a missing file."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "gone.o").symlink_to(folder / "nowhere")
    objects.keep("kernel", KEY, b"code")
    assert objects.find("kernel", KEY) == b"code"
