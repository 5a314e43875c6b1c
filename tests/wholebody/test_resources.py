"""Strategy: a process that computes for ever, and a parent that is killed."""

import subprocess
import sys
import time
from pathlib import Path

PARENT = """
from multiprocessing import get_context
from wholebody.resources import end_with_parent
import os, time

def compute():
    end_with_parent()
    print(os.getpid(), flush=True)
    while True:
        time.sleep(1000.0)

if __name__ == "__main__":
    process = get_context("spawn").Process(target=compute)
    process.start()
    process.join()
"""


def lives(pid):
    state = Path(f"/proc/{pid}/stat")
    return state.exists() and state.read_text().rpartition(")")[2].split()[0] != "Z"


def test_a_process_ends_with_the_one_that_began_it_though_that_is_killed(tmp_path):
    """Those of an audit went on for 15 s."""
    program = tmp_path / "parent.py"
    program.write_text(PARENT)
    parent = subprocess.Popen([sys.executable, str(program)], stdout=subprocess.PIPE, text=True)
    child = int(parent.stdout.readline())
    assert lives(child)
    parent.kill()
    parent.wait()
    for _ in range(6000):
        if not lives(child):
            break
        time.sleep(0.01)
    assert not lives(child)
