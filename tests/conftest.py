"""What all tests share: stored values, hypothesis profiles, and the files that a core-only environment leaves out."""

import os
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

from tests.support.stored import Measured, StoredValues
from wholebody.jit.checked import SWITCH

# Whatever memory a kernel is given, also in processes that tests start, is compared with what it was compiled for.
os.environ[SWITCH] = "1"

# Without the lerobot extra (make test-latest) there is nothing those files could test.
NEED_LEROBOT = [
    "lerobot_robot_wholebody/*",
    "training/*",
    "policy/lerobot/*",
    "policy/dataset/*",
    "policy/recorded/test_dataset_replay.py",
    "project/test_readme_commands.py",
    "wholebody/guide/*",
    "wholebody/cli/test_audit_dataset.py",
    "wholebody/cli/test_dataset.py",
    "wholebody/cli/test_lerobot_doctor.py",
]
collect_ignore_glob = [] if find_spec("lerobot") else list(NEED_LEROBOT)
collect_ignore_glob += [] if find_spec("viser") else ["wholebody/live/test_page*.py", "wholebody/live/test_door.py"]
collect_ignore_glob += [] if find_spec("k3d") else ["wholebody/verdict/test_page*.py"]
collect_ignore_glob += [] if find_spec("ray") else ["wholebody/verdict/test_audit_on_ray.py"]
collect_ignore_glob += [] if find_spec("pyarrow") else ["wholebody/verdict/test_audit.py"]
collect_ignore_glob += [] if find_spec("h5py") else ["policy/dataset/forms/test_hdf5.py"]
# Recordings of people are not a part of this repository.
MOTIONS = os.environ.get("G1_MOTIONS", "")
collect_ignore_glob += [] if MOTIONS else ["studies/test_recorded_motions.py"]

# Same examples in every run; --hypothesis-profile=explore looks for new ones. Deadlines mean nothing on a busy machine.
settings.register_profile("steady", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("steady")

PASSED = pytest.StashKey[bool]()
MEASURED = pytest.StashKey[dict[str, list[Measured]]]()


def pytest_addoption(parser):
    parser.addoption("--regression-update", action="store_true", help="store the measured values instead of comparing")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if report.when == "call":
        item.stash[PASSED] = report.passed
    return report


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem):
    result = yield
    if isinstance(pyfuncitem.funcargs.get("stored"), StoredValues):
        pyfuncitem.funcargs["stored"].judge()
    return result


@pytest.fixture
def stored(request):
    """Values of this test from `tests/studies/stored/<test file>.json`; rewritten by `make regression-update`."""
    path = Path(__file__).parent / "studies" / "stored" / f"{request.path.stem}.json"
    values = StoredValues(path, request.node.name, update=request.config.getoption("--regression-update"))
    yield values
    request.config.stash.setdefault(MEASURED, {})[request.node.name] = values.measured
    if request.node.stash.get(PASSED, False):
        values.save()


def pytest_terminal_summary(terminalreporter, config):
    """What the studies gave, beside their stored values and their bars."""
    for test, measured in config.stash.get(MEASURED, {}).items():
        terminalreporter.write_line(f"{test}: " + "; ".join(map(str, measured)))
    if config.stash.get(MEASURED, {}) and not MOTIONS:
        terminalreporter.write_line("recorded motions were left out: make regression MOTIONS=FOLDER brings them in")
