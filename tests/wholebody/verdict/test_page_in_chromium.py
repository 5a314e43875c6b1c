"""Strategy: a real page in a real Chromium, wide and narrow, dark and light: what it asks for, and what a click does.

``make test-browser`` runs it. The poses that the page computes are held against MuJoCo's.
"""

import os
import time
from pathlib import Path

import mujoco
import numpy as np
import pytest

from models import g1
from models.mujoco_model import load_mujoco
from tests.support.browser import Browser
from tests.support.commands import wholebody
from tests.support.pages import chunk_file, contents

pytestmark = [pytest.mark.browser, pytest.mark.timeout(900)]

SHOTS = Path(os.environ.get("SCREENSHOTS", ""))
"""Folder where pictures are left to be looked at; none if empty."""
CLICK = "document.querySelector('#violations button').click()"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three inputs, their index and their pages, written by the command."""
    folder = tmp_path_factory.mktemp("reports")
    for name in ("fine", "too_fast", "too_far"):
        chunk_file(folder, name)
    done = wholebody("check", ".", "--hold", "0.5", "--report", "index.html", cwd=folder)
    assert done.returncode == 1, done.stderr
    return folder


@pytest.fixture(params=[(1400, 900), (390, 844)], ids=["desktop", "phone"])
def browser(request, tmp_path):
    with Browser(tmp_path, *request.param) as browser:
        yield browser


def test_a_browser_without_three_dimensions_says_so_beside_the_words(folder, browser):
    none = "HTMLCanvasElement.prototype.getContext = () => null"
    browser.call("Page.addScriptToEvaluateOnNewDocument", source=none)
    (path,) = folder.glob("index/*too_fast.html")
    browser.open(f"file://{path}")
    browser.wait_for("document.getElementById('now')?.textContent.includes('WebGL')")
    assert browser.evaluate("document.getElementById('answer').textContent") == "infeasible"


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_a_click_on_a_violation_moves_the_robot_there(folder, browser, theme):
    browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}])
    (path,) = folder.glob("index/*too_fast.html")
    browser.open(f"file://{path}")
    browser.wait_for("!!window.report")
    about, arrays = contents(path.read_text())
    before = browser.evaluate("report.bodies()")
    browser.evaluate(CLICK)
    assert browser.evaluate("report.now()") == pytest.approx(about["violations"][0]["time"], abs=1e-6)
    after = browser.evaluate("report.bodies()")
    moved = max(np.linalg.norm(np.subtract(after[name], before[name])) for name in after)
    assert moved > 0.05
    held_against_mujoco(arrays, about["violations"][0]["time"], after)
    assert browser.evaluate("report.seen('mark:asked_left')") == [True]
    assert browser.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    if SHOTS.name:
        time.sleep(1.0)
        browser.screenshot(SHOTS / f"report_{browser.size[0]}_{theme}.png")
    assert browser.evaluate("report.seen('reach')") == [False, False]
    browser.evaluate("document.querySelector('#legend button:last-child').click()")
    assert browser.evaluate("report.seen('reach')") == [True, True]
    if SHOTS.name:
        time.sleep(1.0)
        browser.screenshot(SHOTS / f"report_{browser.size[0]}_{theme}_reach.png")
    browser.evaluate("report.play()")
    browser.wait_for(f"report.now() > {about['violations'][0]['time']} + 0.1")
    assert browser.errors == []
    assert [asked for asked in browser.asked if not asked.startswith(("file:", "data:", "blob:"))] == []


def held_against_mujoco(arrays, t, bodies):
    """Positions that the page computes at a time are those of MuJoCo, between two frames."""
    model = load_mujoco(g1(), visuals=True)
    data = mujoco.MjData(model)
    data.qpos[:] = [np.interp(t, arrays["time"], column) for column in arrays["qpos"].T]
    mujoco.mj_kinematics(model, data)
    for name, position in bodies.items():
        np.testing.assert_allclose(position, data.body(name).xpos, atol=1e-4, err_msg=name)


def test_the_index_leads_to_the_worst_first(folder, browser):
    browser.open(f"file://{folder / 'index.html'}")
    browser.wait_for("document.querySelectorAll('tbody tr').length == 3")
    first = browser.evaluate("document.querySelector('tbody tr').innerText")
    assert "infeasible" in first
    browser.evaluate("document.querySelector('tbody a').click()")
    browser.wait_for("!!window.report")
    assert browser.errors == []
