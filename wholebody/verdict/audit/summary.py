"""The outcomes of an audit on one page, the worst first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from policy.writing import write_text
from wholebody.verdict.audit.outcome import AuditOutcome
from wholebody.verdict.page.index import listing

PAGE = "index.html"
RANK = ("crashed", "timed_out", "malformed", "infeasible", "feasible_after_repair", "feasible")
ROWS_MAX = 2000
"""Rows of the page; the tables have all of them."""
NOTES_NAMED = 3
"""Notes of an input that are named."""
NOTE_MAX = 200
"""Most characters of a note [no unit]; chosen: two lines of the table."""
HEADINGS = ("", "input", "what speaks against it", "moved by", "length", "slower")


def ranked(outcomes: Sequence[AuditOutcome]) -> list[AuditOutcome]:
    """Outcomes ranked: not judged first, then falls, then by how far palms are moved."""

    def rank(one: AuditOutcome) -> tuple:
        verdict = one.verdict or {"fell": False, "moved_max_m": 0.0, "violations": []}
        return (RANK.index(one.answer), not verdict["fell"], -verdict["moved_max_m"], one.name)

    return sorted(outcomes, key=rank)


def write_summary(folder: str | Path, outcomes: Sequence[AuditOutcome]) -> None:
    """Write the page.

    Raises:
        OSError: If it cannot be written.
    """
    answers, motion = Counter(one.answer for one in outcomes), sum(one.motion_s for one in outcomes)
    counts = ", ".join(f"{answers[name]} {name.replace('_', ' ')}" for name in RANK if answers[name])
    codes = Counter(
        kind
        for one in outcomes
        if one.verdict
        for kind in {_kind(v) for v in one.verdict["violations"] if v["severity"] != "note"}
    )
    bars = "".join(_bar(code, count, len(outcomes)) for code, count in codes.most_common())
    rows = "\n".join(map(_row, ranked(outcomes)[:ROWS_MAX]))
    left = f"<p>The first {ROWS_MAX} of {len(outcomes)}.</p>" if len(outcomes) > ROWS_MAX else ""
    heads = "".join(f"<th>{heading}</th>" for heading in HEADINGS)
    body = (
        f"<p>{len(outcomes)} inputs, {motion / 60.0:.1f} minutes of motion: {counts or 'nothing'}.</p>"
        f"<table><tbody>{bars}</tbody></table><br>"
        f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>{left}"
    )
    write_text(Path(folder) / PAGE, listing("wholebody audit", body), errors="backslashreplace")


def _kind(violation: dict) -> str:
    cause = violation.get("cause")
    return violation["code"] if cause is None else f"{violation['code']} ({cause})"


def _bar(code: str, count: int, total: int) -> str:
    width = 100.0 * count / max(total, 1)
    return (
        f'<tr><td>{escape(code)}</td><td class="number">{count}</td>'
        f'<td style="width:60%"><div class="bar" style="width:{width:.1f}%"></div></td></tr>'
    )


def _row(one: AuditOutcome) -> str:
    verdict = one.verdict
    answer = f'<span class="answer {one.answer}">{one.answer.replace("_", " ")}</span>'
    why, moved = escape(one.message.removeprefix(f"{one.name}: ")), ""
    if verdict:
        why = "; ".join([escape(verdict.get("headline", ""))] + [f"<i>{escape(note)}</i>" for note in _notes(verdict)])
        moved = f"{1e3 * verdict['moved_max_m']:.0f} mm, {np.degrees(verdict['moved_turn_max_rad']):.0f}°"
    slower = "" if one.slower is None else f"{one.slower:.2f} ×"
    numbers = "".join(f'<td class="number">{cell}</td>' for cell in (moved, f"{one.motion_s:.1f} s", slower))
    return f"<tr><td>{answer}</td><td>{_linked(one.name)}</td><td>{why}</td>{numbers}</tr>"


def _notes(verdict: dict) -> list[str]:
    """Notes on an input that do not affect its verdict, such as swapped hands."""
    notes = dict.fromkeys(v["subject"] or v["code"] for v in verdict["violations"] if v["severity"] == "note")
    return [note[:NOTE_MAX] for note in notes][:NOTES_NAMED]


def _linked(name: str) -> str:
    """The input, linked to its file where there is one; of an episode, to its dataset."""
    file = Path(name.partition("#")[0])
    return f'<a href="{escape(file.absolute().as_uri())}">{escape(name)}</a>' if file.exists() else escape(name)
