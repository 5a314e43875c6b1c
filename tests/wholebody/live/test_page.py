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

import pytest

from tests.support.browser import Browser

pytestmark = [pytest.mark.browser, pytest.mark.timeout(900)]

SHOTS = Path(os.environ.get("SCREENSHOTS", ""))
"""Folder where pictures are left to be looked at; none if empty."""
WORDS = "document.body.innerText"


def free_port():
    with socket.socket() as end:
        end.bind(("127.0.0.1", 0))
        return end.getsockname()[1]


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """The command, running, with its address and where its numbers are written."""
    told = tmp_path_factory.mktemp("live") / "told.json"
    code = "from wholebody.cli.main import main; main()"
    arguments = [sys.executable, "-c", code, "live", "--port", str(free_port()), "--json", str(told)]
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
        press = "[...document.querySelectorAll('button')].find(b => b.innerText.trim() == '{}').click()"
        browser.evaluate(press.format("pause"))
        clock = r"Number((document.body.innerText.match(/([\d.]+) s, tick/) || [])[1])"
        time.sleep(2.0)
        stopped = browser.evaluate(clock)
        time.sleep(1.0)
        assert browser.evaluate(clock) == stopped
        browser.evaluate(press.format("go on"))
        browser.wait_for(f"{clock} > {stopped} + 0.5")


def test_dragging_a_palm_moves_the_hand(live, tmp_path):
    address, _, _ = live
    with Browser(tmp_path) as browser:
        settled(browser, address)
        begin = [browser.size[0] * 0.4, browser.size[1] * 0.5]
        assert browser.evaluate("document.querySelector('canvas').clientWidth") > begin[0]
        browser.drag(begin, [begin[0] + 80, begin[1] - 60])
        assert browser.errors == []
