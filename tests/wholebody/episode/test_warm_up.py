"""Strategy: run it as a script does, and look at what is compiled afterwards."""

import os
import subprocess
import sys

import pytest

from wholebody.config.robot import RobotConfig
from wholebody.episode import warm_up as module
from wholebody.episode.warm_up import warm_up
from wholebody.errors import ConfigError

# As those of docs/api.md: without a guard that a process begun by `multiprocessing` needs.
SCRIPT = """
from wholebody import warm_up
from wholebody.qp.compiled_program import ENTRIES
print("once")
assert warm_up() > 0.0
assert all(entry.is_compiled for entry in ENTRIES)
"""


def test_after_warming_up_in_a_plain_script_every_stage_of_the_tick_is_compiled(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, str(tmp_path / "script.py")], capture_output=True, text=True, check=False, env=environment
    )
    assert (done.returncode, done.stdout) == (0, "once\n"), done.stderr


def test_a_robot_that_there_is_not_is_told():
    with pytest.raises(ConfigError, match=r"robot\.model is 'g2'"):
        warm_up(RobotConfig(model="g2"))


def test_a_process_that_fails_is_told_and_is_no_progress():
    with pytest.raises(RuntimeError, match="ended with code 7"):
        module._apart([os._exit], 7, lambda: pytest.fail("nothing is compiled"))


def test_the_end_of_the_first_part_is_progress():
    ended = []
    module._apart([os._exit, os._exit], 0, lambda: ended.append(True))
    assert ended == [True]
