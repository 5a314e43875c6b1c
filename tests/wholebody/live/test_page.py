"""Strategy: the real page in a real Chromium, on the wall clock: what is seen, and what dragging a palm does.

``make test-browser`` runs it; it needs Chromium from the system's packages.
"""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.support.browser import Browser
from tests.support.page_watcher import HANDLE, PALM, PageWatcher

pytestmark = [pytest.mark.browser, pytest.mark.timeout(900)]

SHOTS = Path(os.environ.get("SCREENSHOTS", ""))
"""Folder where pictures are left to be looked at; none if empty."""
WORDS = "document.body.innerText"
PRESS = "[...document.querySelectorAll('button')].find(b => b.innerText.trim() == '{}').click()"
CAMERA, LOOKED_AT, FIELD_OF_VIEW = (1.4, 0.95, 1.15), (0.1, 0.0, 0.65), np.radians(75.0)
"""The page's first view [m, rad]."""
ARROW = 0.06
"""Height of a point of the handle's arrow upwards [m]."""


def free_port():
    with socket.socket() as end:
        end.bind(("127.0.0.1", 0))
        return end.getsockname()[1]


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """The command, running, with its address and where its numbers are written."""
    told = tmp_path_factory.mktemp("live") / "told.json"
    steps = told.with_name("steps.yaml")
    steps.write_text("steps: reach\n")
    code = "from wholebody.cli.main import main; main()"
    arguments = [sys.executable, "-c", code, "live", "--port", str(free_port()), "--json", str(told)]
    arguments += ["--config", str(steps)]
    process = subprocess.Popen(arguments, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    address = None
    for line in process.stderr:
        if found := re.search(r"http://\S+", line):
            address = found[0]
            break
    assert address, process.communicate()
    yield address, told, process
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 0
    assert not json.loads(told.read_text())["fell"]


@pytest.fixture(params=[(1400, 900), (390, 844)], ids=["desktop", "phone"])
def browser(request, tmp_path):
    with Browser(tmp_path, *request.param) as browser:
        yield browser


def settled(browser, address):
    browser.open(address)
    browser.wait_for("document.querySelector('canvas') !== null")
    browser.wait_for(f"/balance margin \\d+ mm/.test({WORDS})", 120.0)


def test_the_page_shows_the_robot_without_an_error_or_a_request_elsewhere(live, browser):
    address, _, _ = live
    settled(browser, address)
    if SHOTS.name:
        time.sleep(15.0)
        browser.screenshot(SHOTS / f"live_{browser.size[0]}.png")
    assert browser.errors == []
    elsewhere = [asked for asked in browser.asked if not re.match(rf"data:|blob:|{address}|ws://127\.0\.0\.1:", asked)]
    assert elsewhere == []


def test_words_and_buttons_reach_the_robot(live, tmp_path):
    address, _, _ = live
    with Browser(tmp_path) as browser:
        settled(browser, address)
        browser.evaluate(PRESS.format("pause"))
        clock = r"Number((document.body.innerText.match(/([\d.]+) s, tick/) || [])[1])"
        before, stopped, limit = None, browser.evaluate(clock), time.monotonic() + 20.0
        while stopped != before and time.monotonic() < limit:
            time.sleep(1.0)
            before, stopped = stopped, browser.evaluate(clock)
        assert stopped == before, "the clock of the page goes on in a pause"
        browser.evaluate(PRESS.format("go on"))
        browser.wait_for(f"{clock} > {stopped} + 0.5")


def test_the_robot_walks_to_where_it_is_sent_and_its_handles_come_along(live, tmp_path):
    """0.3 m ahead, what the panel has at first."""
    address, _, _ = live
    with Browser(tmp_path) as browser, PageWatcher(address) as seen:
        settled(browser, address)
        handle = seen.positions[HANDLE].copy()
        browser.evaluate(PRESS.format("go there"))
        limit = time.monotonic() + 60.0
        while time.monotonic() < limit and seen.positions[HANDLE][0] < handle[0] + 0.25:
            time.sleep(0.1)
        assert seen.positions[HANDLE][0] - handle[0] == pytest.approx(0.3, abs=0.06)
        if SHOTS.name:
            browser.screenshot(SHOTS / "live_walked.png")


def on_screen(point, size):
    """Where the page's first view has a point of the world [px]."""
    back = np.array(CAMERA) - LOOKED_AT
    back /= np.linalg.norm(back)
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    x, y, depth = np.stack([right, np.cross(back, right), -back]) @ (np.asarray(point) - CAMERA)
    scale = 0.5 * size[1] / np.tan(0.5 * FIELD_OF_VIEW) / depth
    return [0.5 * size[0] + scale * x, 0.5 * size[1] - scale * y]


def test_dragging_a_palm_moves_the_hand(live, tmp_path):
    address, _, _ = live
    with Browser(tmp_path) as browser, PageWatcher(address) as seen:
        settled(browser, address)
        handle, palm = seen.positions[HANDLE], seen.positions[PALM]
        # The handle's arrow upwards, from its middle to 60 mm above.
        size = browser.evaluate("(c => [c.clientWidth, c.clientHeight])(document.querySelector('canvas'))")
        begin, end = (on_screen(handle + np.array([0.0, 0.0, up]), size) for up in (ARROW, ARROW + 0.06))
        browser.drag(begin, end)
        limit = time.monotonic() + 20.0
        while time.monotonic() < limit and seen.positions[PALM][2] < palm[2] + 0.03:
            time.sleep(0.1)
        np.testing.assert_allclose(seen.positions[HANDLE] - handle, (0.0, 0.0, 0.06), atol=0.02)
        np.testing.assert_allclose(seen.positions[PALM] - palm, seen.positions[HANDLE] - handle, atol=0.02)
        assert browser.errors == []
