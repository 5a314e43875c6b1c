"""The outcomes of an audit as tables: a row an input, a row a violation, in the order of the inputs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from wholebody.errors import require_extra
from wholebody.verdict.audit.outcome import AuditOutcome

EPISODES, VIOLATIONS, JOINTS = "episodes.parquet", "violations.parquet", "joints.parquet"
NUMBERS = (
    *("rms_m", "max_m", "moved_max_m", "moved_turn_max_rad", "start_m", "start_rad", "approach_s", "time_factor"),
    *("demandable_share", "within_20mm"),
)
"""Numbers of a verdict that are columns of `EPISODES`."""
OF_REPAIR = ("slower", "moved_m", "turned_rad")
"""Numbers of a repair that are columns of `EPISODES`."""
CHANCES = ("fall_as_given", "followed")
"""Probabilities that are columns of `EPISODES`, each with the ends of its interval."""
OF_VIOLATION = (
    *(("code", "string"), ("severity", "string"), ("subject", "string"), ("time", "double"), ("step", "int64")),
    *(("value", "double"), ("bound", "double"), ("unit", "string"), ("margin", "double"), ("cause", "string")),
)
"""Columns of `VIOLATIONS` behind the input's, with their types."""


OF_GAP = (("joint", "string"), ("offset", "double"), ("delay", "double"), ("rms", "double"))
"""Columns of `JOINTS` behind the input's, with their types; [rad], [s]."""


def require_packages() -> None:
    """Refuse to begin what could not be written.

    Raises:
        InputError: If the extra is not installed.
    """
    require_extra("audit", "pyarrow", "an audit")


def written(text: str) -> str:
    """Text as files may have it: names of files need not be UTF-8."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def whence(name: str) -> tuple[str, int | None]:
    """File or dataset of an input, and which episode of it."""
    folder, mark, number = name.rpartition("#")
    return (folder, int(number)) if mark and number.isdecimal() else (name, None)


def episode_row(outcome: AuditOutcome) -> dict[str, Any]:
    """A row of `EPISODES`."""
    source, episode = whence(outcome.name)
    verdict = outcome.verdict or {}
    worst = next(iter(verdict.get("violations", ())), {})
    odds = verdict.get("odds") or {}
    tightest = next(iter(verdict.get("margins", ())), {})
    return {
        "name": written(outcome.name), "source": written(source), "episode": episode, "answer": outcome.answer,
        "message": written(outcome.message), "motion_s": outcome.motion_s, "fell": verdict.get("fell"),
        "method": verdict.get("method"), "decided_by": verdict.get("decided_by"), "slower": outcome.slower,
        **{name: verdict.get(name) for name in NUMBERS},
        "headline": verdict.get("headline"), "worst": worst.get("code"), "worst_cause": worst.get("cause"),
        "worst_time": worst.get("time"), "violations": len(verdict.get("violations", ())),
        "tightest": tightest.get("code"), "tightest_share": tightest.get("share"),
        **{f"repair_{name}": (outcome.repair or {}).get(name) for name in OF_REPAIR},
        **{f"{name}_{end}": odds.get(name, {}).get(end) for name in CHANCES for end in ("p", "low", "high")},
        "alarm": odds.get("alarm"), "unlike": ", ".join(odds["unlike"]) if odds else None,
    }  # fmt: skip


def about(outcome: AuditOutcome) -> dict[str, Any]:
    """Columns of an input that every table has."""
    source, episode = whence(outcome.name)
    return {"name": written(outcome.name), "source": written(source), "episode": episode}


def violation_rows(outcome: AuditOutcome) -> list[dict[str, Any]]:
    """Rows of `VIOLATIONS`."""
    found = (outcome.verdict or {}).get("violations", ())
    return [about(outcome) | {name: one[name] for name, _ in OF_VIOLATION} for one in found]


def write_tables(folder: str | Path, outcomes: Sequence[AuditOutcome]) -> None:
    """Write all three tables.

    Raises:
        OSError: If one cannot be written.
    """
    _write(Path(folder) / EPISODES, _episodes_schema(), map(episode_row, outcomes))
    rows = (row for outcome in outcomes for row in violation_rows(outcome))
    _write(Path(folder) / VIOLATIONS, [*_INPUT, *OF_VIOLATION], rows)
    rows = (about(outcome) | gap for outcome in outcomes for gap in outcome.gaps)
    _write(Path(folder) / JOINTS, [*_INPUT, *OF_GAP], rows)


_INPUT = (("name", "string"), ("source", "string"), ("episode", "int64"))


def _episodes_schema() -> list[tuple[str, str]]:
    return [
        *_INPUT,
        *(("answer", "string"), ("message", "string"), ("motion_s", "double"), ("fell", "bool")),
        *(("method", "string"), ("decided_by", "string"), ("slower", "double")),
        *((name, "double") for name in NUMBERS),
        *((name, "string") for name in ("headline", "worst", "worst_cause")),
        *(("worst_time", "double"), ("violations", "int64")),
        *(("tightest", "string"), ("tightest_share", "double")),
        *((f"repair_{name}", "double") for name in OF_REPAIR),
        *((f"{name}_{end}", "double") for name in CHANCES for end in ("p", "low", "high")),
        *(("alarm", "bool"), ("unlike", "string")),
    ]


def _write(path: Path, columns: Sequence[tuple[str, str]], rows: Iterable[dict[str, Any]]) -> None:
    import pyarrow
    import pyarrow.parquet

    types = {"double": pyarrow.float64(), "int64": pyarrow.int64(), "string": pyarrow.string(), "bool": pyarrow.bool_()}
    schema = pyarrow.schema([(name, types[kind]) for name, kind in columns])
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(list(rows), schema=schema), path)
