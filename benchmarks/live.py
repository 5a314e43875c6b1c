"""How punctual `wholebody live` is beside an empty loop of the same period: in turns, in processes of their own.

    python benchmarks/live.py [--minutes 3] [--turn 20] [--source lissajous] [--page]

With `--page` a bare websocket client receives the pictures meanwhile.

Gaps are times of more than 4 ms between two ticks; of each is printed when it was, how long it was, the CPU time of the
loop in it [ms], and how often the loop was preempted and gave its core up.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from collections import Counter
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic

from websockets.exceptions import ConnectionClosed

from wholebody.live import pacing
from wholebody.live.lateness import Lateness

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.support.page_watcher import connected

PERIOD = 2e-3
"""Between two ticks [s]: the control period of the default settings."""


def main() -> None:
    """Print both loops' gaps and lateness."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=3.0, help="of each loop")
    parser.add_argument("--turn", type=float, default=20.0, help="seconds at a time")
    parser.add_argument("--source", default="lissajous")
    parser.add_argument("--page", action="store_true", help="with the page and somebody who looks at it")
    options = parser.parse_args()
    turns = max(1, round(60.0 * options.minutes / options.turn))
    empty, live = [], []
    for turn in range(turns):
        empty.append(_empty(options.turn))
        live.append(_live(options.source, options.turn, page=options.page))
        print(f"turn {turn + 1} of {turns}: {live[-1]['palm_error_mm']}", file=sys.stderr, flush=True)
    print("| Loop | ticks | missed | gaps above 4 ms | share | late by at most, ms |\n|---|---|---|---|---|---|")
    for name, runs in (("empty", empty), ("live", [run["loop"] for run in live])):
        ticks, missed, gaps = (sum(run[key] for run in runs) for key in ("ticks", "missed_ticks", "gaps"))
        print(
            f"| {name} | {ticks} | {missed} | {gaps} | {gaps / ticks:.5f} | {max(r['late_max_ms'] for r in runs):.2f} |"
        )
    for name, runs in (("empty", empty), ("live", [run["loop"] for run in live])):
        late = sum((Counter(run["late_ms"]) for run in runs), Counter())
        print(f"{name}, ticks late by [ms]: {dict(late)}")
        for run in runs:
            for gap in run["gap_list"]:
                print(f"{name}: gap at {gap[0]} s: {gap[1]} ms, CPU {gap[2]} ms, preempted {gap[3]}, gave up {gap[4]}")
    for run in live:
        print(f"palms {run['palm_error_mm']}, plans {run['planning']}, robot {run['robot']}, frames {run['pictures']}")


def _live(source: str, seconds: float, *, page: bool) -> dict:
    code = "from wholebody.cli.main import main; main()"
    arguments = [sys.executable, "-c", code, "live", source, "--duration", f"{seconds:g}", "--hold", "0"]
    with TemporaryDirectory() as folder:
        told = Path(folder) / "told.json"
        arguments += ["--json", str(told)] if page else ["--json", str(told), "--headless"]
        process = subprocess.Popen(arguments, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        pictures = _watch(process) if page else 0
        _, errors = process.communicate()
        if process.returncode:
            raise RuntimeError(errors)
        return json.loads(told.read_text()) | {"pictures": pictures}


def _watch(process: subprocess.Popen) -> int:
    """Receive pictures until the page closes; how many frames came."""
    address, frames = next(found[0] for line in process.stderr if (found := re.search(r"//[\d.]+:\d+", line))), 0
    try:
        with connected(address) as page:
            for _ in page:
                frames += 1
    except ConnectionClosed:
        pass
    return frames


def _empty(seconds: float) -> dict:
    context = get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_run_empty, args=(there, seconds))
    process.start()
    summary = here.recv()
    process.join()
    return summary


def _run_empty(there: Connection, seconds: float) -> None:
    pacing.keep_time()
    lateness, begin, tick = Lateness(PERIOD), monotonic(), 0
    while tick * PERIOD < seconds:
        pacing.wait_until(begin + tick * PERIOD)
        now = monotonic() - begin
        lateness.began(now, tick * PERIOD)
        following = max(tick + 1, int(now / PERIOD))
        lateness.missed += following - tick - 1
        tick = following
    there.send(lateness.summary())


if __name__ == "__main__":
    main()
