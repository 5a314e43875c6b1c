"""Sixteen thousand broken and hostile inputs for every reader, under limits of memory and time: ``make fuzz-readers``.

Each case copies a good input, spoils one file of it (`tests.support.hostile_files`) and reads it, in child processes
that may not allocate more than `MEMORY` beyond what imports took. Counted are exceptions that are no refusal of ours
(tracebacks), reads longer than `SECONDS` (hangs), more than `MEMORY` (allocations), files opened for writing outside
the case's own folder, and whatever runs a command, opens a connection or unpickles a class (canaries). All must be 0.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from time import perf_counter

from policy.dataset.forms.hdf5 import PROGRAM as HDF5_READER

CASES = {
    "chunk": 1500,
    "motion": 1000,
    "scene": 500,
    "spec": 1500,
    "config": 1500,
    "frame": 1500,
    "recording": 800,
    "dataset_v30": 600,
    "dataset_v21": 600,
    "checkpoint": 500,
    "split": 1500,
    "looked_at": 1500,
    "xr_json": 1400,
    "retargeted": 1000,
    "hdf5": 600,
}
"""Cases of each reader; 16,000 in all."""
BATCH = {"dataset_v30": 150, "dataset_v21": 150, "checkpoint": 125}
BATCH_OTHER = 500
MEMORY, SECONDS = 2 * 2**30, 10.0
BAD = ("traceback", "hang", "memory", "outside", "canary", "died")
RUNS_CODE = (
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.spawn",
    "subprocess.Popen",
    "socket.connect",
    "pickle.find_class",
)
"""Events of Python's audit hook that no reader may cause."""


def main() -> int:
    """Run all batches and print the counts; 1 if one of them that must be 0 is not."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--share", type=float, default=1.0, help="part of the cases to run")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=CASES, nargs="*", default=list(CASES))
    parser.add_argument("--batch", nargs=3, metavar=("READER", "FIRST", "COUNT"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.batch:
        return _batch(given.batch[0], given.seed, int(given.batch[1]), int(given.batch[2]))
    total, begin = Counter(), perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        goods = _write_goods(Path(folder), given.only)
        for reader in given.only:
            count, found = max(round(given.share * CASES[reader]), 1), Counter()
            for first in range(0, count, BATCH.get(reader, BATCH_OTHER)):
                found += _run(reader, given.seed, first, min(BATCH.get(reader, BATCH_OTHER), count - first), goods)
            print(f"{reader:<12} {_line(found)}", flush=True)
            total += found
    print(f"{'all':<12} {_line(total)}; {perf_counter() - begin:.0f} s")
    return int(any(total[name] for name in BAD))


def _line(found: Counter) -> str:
    bad = ", ".join(f"{found[name]} {name}" for name in BAD)
    return f"{found['case']} cases: {found['read']} read, {found['refused']} refused; {bad}"


def _write_goods(folder: Path, readers: list[str]) -> Path:
    """A good dataset and checkpoint, made once; the others are written by each case."""
    if any(reader.startswith("dataset") for reader in readers):
        from tests.support.dataset_cases import write_v21, write_v30

        logging.disable(logging.WARNING)
        write_v21(folder / "dataset_v21", write_v30(folder / "dataset_v30"))
    if "checkpoint" in readers:
        from tests.support.tiny_policies import write_checkpoint

        write_checkpoint("act", folder / "checkpoint")
        (folder / "checkpoint" / "model.safetensors").unlink()
    return folder


def _run(reader: str, seed: int, first: int, count: int, goods: Path) -> Counter:
    """A batch in a process of its own; a case that kills it is counted, and the rest goes on after it."""
    found, done = Counter(), first
    while done < first + count:
        command = [sys.executable, "-m", "tests.studies.fuzz_readers", "--seed", str(seed)]
        command += ["--batch", reader, str(done), str(first + count - done)]
        child = subprocess.run(
            command, capture_output=True, text=True, check=False, env={**os.environ, "FUZZ_GOODS": str(goods)}
        )
        lines = [json.loads(line) for line in child.stdout.splitlines() if line.startswith("{")]
        for line in lines:
            found.update(line["counts"])
            if line["said"]:
                print(f"  {reader} {line['case']}: {line['said']}", flush=True)
        done += len(lines)
        if done < first + count:
            print(f"  {reader} {done}: the process ended with {child.returncode}\n{child.stderr[-2000:]}", flush=True)
            found.update({"case": 1, "died": 1})
            done += 1
    return found


def _batch(reader: str, seed: int, first: int, count: int) -> int:
    """Cases in this process, a line of JSON each."""
    from tests.support.hostile_files import READERS, folder_reader

    goods = Path(os.environ["FUZZ_GOODS"])
    kinds = {
        name: folder_reader(name.partition("_")[0], _copier(goods / name)) for name in CASES if name not in READERS
    }
    kind = {**READERS, **kinds}[reader]
    with tempfile.TemporaryDirectory() as sandbox:
        os.chdir(sandbox)
        tempfile.tempdir = sandbox
        warm = Path(sandbox) / "warm"
        warm.mkdir()
        kind.write(warm)
        kind.read(warm)
        watch = _Watch(Path(sandbox))
        _limit_memory()
        for number in range(first, first + count):
            counts, said = _case(kind, Path(sandbox) / f"case{number}", seed, number, watch)
            print(json.dumps({"case": number, "counts": counts, "said": said}), flush=True)
    return 0


def _copier(good: Path):
    return lambda folder: shutil.copytree(good, folder, dirs_exist_ok=True)


def _limit_memory() -> None:
    """No more private memory than there is now and `MEMORY` beyond it."""
    status = Path("/proc/self/status").read_text()
    now = 1024 * next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmData"))
    resource.setrlimit(resource.RLIMIT_DATA, (now + MEMORY, now + MEMORY))


class _Watch:
    """What Python's audit hook sees while a case is read."""

    def __init__(self, sandbox: Path) -> None:
        self.sandbox, self.on = str(sandbox.resolve()), False
        self.outside: list[str] = []
        self.canaries: list[str] = []
        sys.addaudithook(self._hear)

    def _hear(self, event: str, arguments: tuple) -> None:
        if not self.on:
            return
        if event == "subprocess.Popen" and str(HDF5_READER) in arguments[1]:
            return  # HDF5 is read by a program of ours, in a process that may die
        if event in RUNS_CODE:
            self.canaries.append(f"{event} {arguments!r:.200}")
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            mode, flags = arguments[1], arguments[2] or 0
            writes = any(c in mode for c in "wax+") if isinstance(mode, str) else flags & (os.O_WRONLY | os.O_RDWR)
            place = os.path.abspath(os.fsdecode(arguments[0]))
            if writes and not place.startswith(self.sandbox) and not place.startswith("/dev/"):
                self.outside.append(place)


def _case(kind: object, folder: Path, seed: int, number: int, watch: _Watch) -> tuple[dict[str, int], str]:
    """Counts of one case, and what is to be said about it."""
    import numpy as np

    from models.spec import RobotSpecError
    from policy.errors import PolicyError
    from tests.support.hostile_files import spoil
    from wholebody.errors import WholebodyError

    folder.mkdir()
    kind.write(folder)
    harm = spoil(folder, np.random.default_rng((seed, number)))
    counts, said, before = Counter(case=1), "", _reset_peak()
    watch.outside, watch.canaries = [], []
    signal.signal(signal.SIGALRM, _give_up)
    signal.setitimer(signal.ITIMER_REAL, 3 * SECONDS)
    begin, watch.on = perf_counter(), True
    try:
        kind.read(folder)
        counts["read"] += 1
    except (PolicyError, WholebodyError, RobotSpecError, OSError) as error:
        counts["refused"] += 1
        if not str(error).isprintable() or len(str(error)) > 5000:
            counts["traceback"] += 1
            said = f"{harm}: not printable or too long: {str(error)!r:.300}"
    except BaseException as error:  # noqa: BLE001 - that is what is looked for
        counts["traceback"] += 1
        said = f"{harm}: {type(error).__name__}: {error!s:.300} {_place(error)}"
    watch.on = False
    seconds, peak = perf_counter() - begin, _peak() - before
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    if seconds > SECONDS:
        counts["hang"] += 1
        said += f" {harm}: {seconds:.1f} s"
    if peak > MEMORY:
        counts["memory"] += 1
        said += f" {harm}: {peak / 2**30:.2f} GiB"
    if watch.outside or watch.canaries or (folder / "canary").exists() or Path("canary").exists():
        counts["outside"] += len(watch.outside)
        counts["canary"] += len(watch.canaries)
        said += f" {harm}: {watch.outside} {watch.canaries}"
    shutil.rmtree(folder)
    return dict(counts), said


def _place(error: BaseException) -> str:
    from traceback import extract_tb

    return " < ".join(
        f"{Path(frame.filename).name}:{frame.lineno}" for frame in extract_tb(error.__traceback__)[:-6:-1]
    )


def _give_up(*_: object) -> None:
    raise TimeoutError("given up")


def _reset_peak() -> int:
    """Resident memory now, from which the peak is counted anew [bytes]."""
    Path("/proc/self/clear_refs").write_text("5")
    return _peak()


def _peak() -> int:
    status = Path("/proc/self/status").read_text()
    return 1024 * next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM"))


if __name__ == "__main__":
    sys.exit(main())
