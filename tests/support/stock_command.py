"""LeRobot's commands, each in a process of its own that is forked from one with torch and LeRobot's libraries loaded.

Loading them takes longer than most of what a command then does. Neither commands nor this plugin are loaded there.
"""

import os
import runpy
import sys
from multiprocessing import get_context, set_start_method

FORKS = get_context("forkserver")
FORKS.set_forkserver_preload(["lerobot.policies", "lerobot.datasets"])


class StockCommand:
    """A command that was started; what it says is in a file.

    Args:
        words: The installed script and its arguments.
        folder: Where it runs.
        environment: What is different in its environment.
        said: Path of the file.
    """

    def __init__(self, words, folder, environment, said):
        words = [str(word) for word in words]
        said.touch()
        self._process = FORKS.Process(target=_run, args=(words, folder, environment, said))
        self._process.start()

    def wait(self, seconds=None):
        """Exit code, or None after that time [s]."""
        self._process.join(seconds)
        return self._process.exitcode

    def poll(self):
        """Exit code, or None while it runs."""
        return self._process.exitcode

    def kill(self):
        """End it if it still runs, which whoever started it would wait for at its own end."""
        self._process.kill()

    def send_signal(self, number):
        """Send it a signal."""
        os.kill(self._process.pid, number)


def _run(words, folder, environment, said):
    set_start_method("fork", force=True)  # what a command starts, it starts as ever
    os.chdir(folder)
    os.environ.update(environment)
    with open(said, "wb") as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
    sys.argv = words
    runpy.run_path(words[0], run_name="__main__")
