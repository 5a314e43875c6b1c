"""Strategy: the plugin's distribution is built and installed into a folder of its own; LeRobot looks for it there."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "lerobot_robot_wholebody"
KNOWN = (
    "from lerobot.robots import RobotConfig; from lerobot.teleoperators import TeleoperatorConfig;"
    "print('wholebody_g1' in RobotConfig.get_known_choices(),"
    "'wholebody_expert' in TeleoperatorConfig.get_known_choices())"
)
BY_NAME = f"from lerobot.utils.import_utils import register_third_party_plugins as f; f(); {KNOWN}"
BY_PATH = f"from lerobot.configs.parser import load_plugin as f; f('lerobot_robot_wholebody'); {KNOWN}"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Where the plugin alone is installed."""
    folder = tmp_path_factory.mktemp("site")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    subprocess.run([*install, "--no-index", "--no-build-isolation", "--target", folder, PLUGIN], check=True)
    return folder


def answer(code, *paths, cwd):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment, cwd=cwd
    )
    return done.stdout.split()


def test_the_distribution_holds_every_module_of_the_folder_and_no_more(site):
    (metadata,) = [path for path in site.iterdir() if path.name.endswith(".dist-info")]
    assert metadata.name.startswith("lerobot_robot_wholebody-")
    assert {path.name for path in site.iterdir()} == {metadata.name, "lerobot_robot_wholebody"}
    held = {path.name for path in (site / "lerobot_robot_wholebody").iterdir() if path.name != "__pycache__"}
    assert held == {path.name for path in PLUGIN.glob("*.py")}


def test_lerobot_finds_it_by_its_name(site, tmp_path):
    assert answer(BY_NAME, site, ROOT, cwd=tmp_path) == ["True", "True"]


@pytest.mark.regression  # each command of `test_stock_commands.py` is told the path too
def test_lerobot_finds_it_by_the_path_that_it_is_told(tmp_path):
    assert answer(BY_PATH, ROOT, cwd=tmp_path) == ["True", "True"]
