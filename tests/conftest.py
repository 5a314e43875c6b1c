"""What all tests share: stored values, hypothesis profiles, and the files that a core-only environment leaves out."""

from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings
from stored import StoredValues

# Without the lerobot extra (make test-latest) there is nothing those files could test.
collect_ignore_glob = [] if find_spec("lerobot") else ["test_lerobot*.py"]

# Same examples in every run; --hypothesis-profile=explore looks for new ones. Deadlines mean nothing on a busy machine.
settings.register_profile("steady", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("steady")

PASSED = pytest.StashKey[bool]()


def pytest_addoption(parser):
    parser.addoption("--regression-update", action="store_true", help="store the measured values instead of comparing")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if report.when == "call":
        item.stash[PASSED] = report.passed
    return report


@pytest.fixture
def stored(request):
    """Values of this test from `tests/regression/<test file>.json`; rewritten by `make regression-update`."""
    path = Path(__file__).parent / "regression" / f"{request.path.stem}.json"
    values = StoredValues(path, request.node.name, update=request.config.getoption("--regression-update"))
    yield values
    if request.node.stash.get(PASSED, False):
        values.save()
