"""The command `wholebody` in a process of its own."""

import subprocess
import sys


def wholebody(*arguments, cwd=None):
    code = "from wholebody.cli.main import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=1000, check=False, cwd=cwd
    )
