"""``wholebody audit``: datasets, motions and chunks by the thousand."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from wholebody.cli.auditing import Audited, make_judging, write_mappings
from wholebody.cli.console import say
from wholebody.cli.judging import CRASH, FEASIBLE, INFEASIBLE, MALFORMED
from wholebody.cli.options import Simulation
from wholebody.cli.simulated import check_settings, settings_of
from wholebody.cli.sources import expanded, is_dataset, layout_named, robot_of
from wholebody.resources import processors

if TYPE_CHECKING:
    from models.spec import RobotSpec
    from wholebody.verdict.audit.outcome import AuditOutcome

JOBS_MAX = 256
"""Most processes side by side."""
LIMIT_MIN, LIMIT_MAX = 1.0, 86400.0
"""Bounds of the time that an input may take [s]; definition: a day."""
TOLD_EVERY = 3.0
"""Time between two lines of progress [s]; chosen, no trial is on record."""
CODES = {"crashed": CRASH, "timed_out": INFEASIBLE, "malformed": MALFORMED, "infeasible": INFEASIBLE}
UNJUDGED, NAMED_MAX = ("crashed", "timed_out", "malformed"), 5
"""Endings without a verdict, whose inputs are named, and most names of each; the page has all of them."""


def audit(
    *,
    inputs: Annotated[
        list[str],
        typer.Argument(help="LeRobot datasets, folders of motions or chunks, motions .csv, chunks .npz."),
    ],
    to: Annotated[Path, Option("--to", help="Folder of the answers; what was interrupted goes on.")] = Path("audit"),
    audited: Audited,
    jobs: Annotated[int, Option("--jobs", "-j", help="Processes, each with 0.4 GB of memory; 0: one a core.")] = 0,
    limit: Annotated[
        float, Option("--limit", help="Seconds that an input may take; the first of a process has 300 s more, to load.")
    ] = 600.0,
    ray: Annotated[str, Option("--ray", help="Address of a Ray cluster, such as auto; local: one begun here.")] = "",
) -> None:
    """Judge datasets, motions and chunks on all cores.

    Tables, a ranked page, what to delete and what to slow down.

    Exit code 0 all feasible (repaired ones too), 1 any not, 2 any malformed, 3 a fault of wholebody itself.
    """
    from wholebody.verdict.audit import audit as audits
    from wholebody.verdict.audit import on_ray, workers
    from wholebody.verdict.verdict import SCHEMA

    if not 0 <= jobs <= JOBS_MAX:
        raise ValueError(f"-j is {jobs}; 0 to {JOBS_MAX} inputs can be judged side by side")
    if not LIMIT_MIN <= limit <= LIMIT_MAX:
        raise ValueError(f"--limit is {limit:g} s; {LIMIT_MIN:g} to {LIMIT_MAX:g} s is expected")
    check_settings(audited.config)
    every = [one for name in inputs for one in expanded(name, audited.episodes)]
    # The same file or episode, spelled in two ways, is one input.
    names = list({os.path.abspath(one): one for one in every}.values())
    if not names:
        raise ValueError("there is nothing to audit")
    if audited.episodes and not any(is_dataset(name) for name in inputs):
        raise ValueError(f"--episodes {audited.episodes} chooses those of datasets, and no input is one")
    asked = asdict(audited) | {"schema": SCHEMA, "config": audited.config.read_text() if audited.config else ""}
    asked["assume_spec"] = layout.to_json() if (layout := layout_named(audited.assume_spec, _robot(audited))) else ""
    asked.pop("episodes")
    # Arithmetic of an input has one thread; there are as many processes as cores.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    judge = partial(workers.outcomes, jobs=jobs or len(processors()))
    if ray:
        judge = partial(on_ray.outcomes, jobs=jobs, address=ray)
    judge = partial(judge, make=partial(make_judging, audited, to.absolute()), limit=limit)
    try:
        found = audits.audit(names, to, judge, asked=asked, progress=_Progress())
    except KeyboardInterrupt:
        say(f"interrupted; the same command goes on where it was ({to})", to_errors=True)
        raise typer.Exit(130) from None
    write_mappings(to, inputs, audited)
    say(*_summary(found, to))
    if audited.repair:
        say(*_repaired(found, to, audited.read_as))
    raise typer.Exit(max((CODES.get(one.answer, FEASIBLE) for one in found), default=FEASIBLE))


def _robot(audited: Audited) -> RobotSpec:
    """Robot that inputs are of."""
    return robot_of(settings_of(Simulation(config=audited.config, robot=audited.robot)).robot)


def _summary(found: Sequence[AuditOutcome], folder: Path) -> Iterable[str]:
    from collections import Counter

    from wholebody.verdict.audit.lists import to_delete
    from wholebody.verdict.audit.summary import PAGE, RANK

    answers = Counter(one.answer for one in found)
    counts = ", ".join(f"{answers[name]} {name.replace('_', ' ')}" for name in RANK if answers[name])
    inputs, minutes = "input" if len(found) == 1 else "inputs", sum(one.motion_s for one in found) / 60.0
    yield f"{len(found)} {inputs}, {minutes:.1f} minutes of motion: {counts}"
    for ending in UNJUDGED:
        named = [one.name for one in found if one.answer == ending]
        if named:
            more = f" and {len(named) - NAMED_MAX} more" if len(named) > NAMED_MAX else ""
            yield f"{ending.replace('_', ' ')}: {', '.join(named[:NAMED_MAX])}{more}"
            # The same for all episodes of a dataset, which the names in front would hide.
            why = dict.fromkeys(re.sub(r"\S+#\d+:? ?", "", one.message) for one in found if one.answer == ending)
            yield from (f"  {text}" for text in list(why)[:NAMED_MAX] if text)
    yield from _noticed(found)
    yield from _followed(found)
    slower = sum(one.slower is not None for one in found)
    delete = sum(map(len, to_delete(found).values()))
    yield f"{slower} would do slower, {delete} episodes of datasets to delete; {folder / PAGE} ranks them"


def _noticed(found: Sequence[AuditOutcome]) -> Iterable[str]:
    """Notes on inputs, commonest first; notes that differ in their numbers only are counted as one."""
    notes: dict[str, list[str]] = {}
    for one in found:
        subjects = (x["subject"] for x in (one.verdict or {}).get("violations", ()) if x["code"] == "chunk_note")
        for text in {re.sub(r"[\d.]+", "", subject): subject for subject in subjects}.items():
            notes.setdefault(text[0], []).append(text[1])
    for texts in sorted(notes.values(), key=len, reverse=True)[:NAMED_MAX]:
        yield f"noticed in {len(texts)} of {len(found)}: {texts[0]}"


def _followed(found: Sequence[AuditOutcome]) -> Iterable[str]:
    """How measured joints follow commanded ones: the delay of most, and the joint that is off the most."""
    import numpy as np

    gaps = [gap for one in found for gap in one.gaps]
    if not gaps:
        return
    delays = [gap["delay"] for gap in gaps if gap["delay"] is not None]
    offsets: dict[str, list[float]] = {}
    for gap in gaps:
        offsets.setdefault(gap["joint"], []).append(gap["offset"])
    joint, offset = max(((name, float(np.median(x))) for name, x in offsets.items()), key=lambda pair: abs(pair[1]))
    late = f"{1e3 * float(np.median(delays)):.0f} ms later in the median joint" if delays else "without a delay to see"
    count = sum(bool(one.gaps) for one in found)
    yield f"states beside actions in {count} of {len(found)}: {late}, {joint} off by {offset:+.3f} rad; joints.parquet"


def _repaired(found: Sequence[AuditOutcome], folder: Path, read_as: str) -> Iterable[str]:
    from wholebody.verdict.audit.repairs import FOLDER, write_datasets
    from wholebody.verdict.audit.tables import whence

    changed = [one for one in found if one.verdict and one.answer != "feasible"]
    repaired = sum(one.repair is not None for one in changed)
    yield f"{repaired} of {len(changed)} that are not feasible as given are repaired, in {folder / FOLDER}"
    if read_as and any(is_dataset(whence(one.name)[0]) for one in found):
        yield f"no copies of datasets with --read-as: wholebody convert DATASET --read-as {read_as} makes one to repair"
        return
    for dataset in write_datasets(folder, found):
        yield f"{dataset}: feasible episodes as they are, repaired ones in their place, the others left out"


class _Progress:
    """How far an audit is, and how long it takes still."""

    def __init__(self) -> None:
        self._begin, self._told, self._first, self._motion = monotonic(), -TOLD_EVERY, 0, 0.0

    def __call__(self, done: int, count: int, outcome: AuditOutcome) -> None:
        self._first, self._motion = self._first or done, self._motion + outcome.motion_s
        now = monotonic() - self._begin
        if now - self._told < TOLD_EVERY and done < count:
            return
        self._told = now
        judged = done - self._first + 1
        left = now / judged * (count - done)
        text = f"{done} of {count}, {self._motion / 60.0:.1f} min of motion, about {_clock(left)} left"
        sys.stderr.write(f"\r{text}   " if sys.stderr.isatty() else f"wholebody: {text}\n")
        if sys.stderr.isatty() and done == count:
            sys.stderr.write("\n")
        sys.stderr.flush()


def _clock(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"
