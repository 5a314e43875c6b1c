"""Strategy: the page of the command, without a browser: what a bare client gets of a robot that moves."""

import re
import signal
import subprocess
import sys
import time

import pytest

from tests.support.page_watcher import PALM, PageWatcher

pytestmark = pytest.mark.alone


def test_the_page_shows_a_robot_that_moves():
    code = "from wholebody.cli.main import main; main()"
    arguments = [sys.executable, "-c", code, "live", "wave", "--port", "0", "--duration", "60"]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    address = next(found[0] for line in process.stderr if (found := re.search(r"http://\S+", line)))
    places = set()
    with PageWatcher(address) as seen:
        limit = time.monotonic() + 60.0
        while len(places) < 20 and time.monotonic() < limit:
            time.sleep(0.05)
            places.add(tuple(seen.positions.get(PALM, ())))
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    assert len(places) == 20
