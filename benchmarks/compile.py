"""How long it takes to compile everything that a tick and a plan need, with an empty cache.

    python benchmarks/compile.py

CPU time of each entry, and of all together [s], in one process.
"""

from __future__ import annotations

import os
import tempfile
from time import process_time

from models.cache import CACHE_VARIABLE
from wholebody.config.robot import RobotConfig
from wholebody.episode.warm_up import compile_plan, compile_tick
from wholebody.jit.entry import Entry


def main() -> None:
    """Print a table in Markdown."""
    times: dict[str, float] = {}
    compile_entry = Entry.compile

    def timed(entry: Entry, *arguments: object) -> object:
        begin = process_time()
        native = compile_entry(entry, *arguments)
        times[f"{entry.function.__module__}.{entry.function.__name__}"] = process_time() - begin
        return native

    with tempfile.TemporaryDirectory() as folder:
        os.environ[CACHE_VARIABLE] = folder
        Entry.compile = timed
        compile_tick(RobotConfig())
        compile_plan(RobotConfig())
    print("| Entry | CPU s |\n|---|---|")
    for name, seconds in sorted(times.items(), key=lambda one: -one[1]):
        print(f"| {name} | {seconds:.2f} |")
    print(f"| all {len(times)} | {sum(times.values()):.1f} |")


if __name__ == "__main__":
    main()
