"""Many verdicts on one page, the worst first, each with the way to its own page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np

from policy.writing import write_text
from wholebody.verdict.page.page import HERE
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why.headline import headline

RANK = ("infeasible", "feasible_after_repair", "feasible")
HEADINGS = ("", "input", "why", "moved by", "palms at most", "time factor")


def ranked(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Verdicts ranked: falls first, then infeasible ones, then by how much is changed."""
    return sorted(verdicts, key=lambda v: (RANK.index(v.verdict), not v.fell, -v.moved_max_m, -v.time_factor, v.name))


def write_index(
    path: str | Path, verdicts: Sequence[Verdict], pages: Mapping[str, str], unjudged: Sequence[str] = ()
) -> None:
    """Write the index.

    Args:
        path: Where to.
        verdicts: In any order.
        pages: Address of each one's page, by its name.
        unjudged: Inputs that could not be judged.

    Raises:
        OSError: If the file cannot be written.
    """
    counts = ", ".join(f"{sum(v.verdict == answer for v in verdicts)} {answer.replace('_', ' ')}" for answer in RANK)
    counts += f", {len(unjudged)} not judged" if unjudged else ""
    rows = "\n".join([*map(_unjudged, unjudged), *(_row(v, pages.get(v.name)) for v in ranked(verdicts))])
    heads = "".join(f"<th>{heading}</th>" for heading in HEADINGS)
    body = (
        f"<p>{len(verdicts) + len(unjudged)} inputs: {counts}.</p>"
        f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>"
    )
    write_text(path, listing("wholebody check", body), errors="backslashreplace")


def listing(title: str, body: str) -> str:
    """A page of words alone, in the reports' style."""
    text = (HERE / "list.html").read_text(encoding="utf-8")
    style = (HERE / "page.css").read_text(encoding="utf-8")
    return text.replace("[[style]]", style).replace("[[title]]", escape(title)).replace("[[body]]", body)


def _unjudged(name: str) -> str:
    answer, why = '<span class="answer">not judged</span>', "it could not be read: the terminal says why"
    return f"<tr><td>{answer}</td><td>{escape(name)}</td><td>{why}</td>{'<td></td>' * 3}</tr>"


def _row(v: Verdict, page: str | None) -> str:
    name = escape(v.name) if page is None else f'<a href="{escape(page)}">{escape(v.name)}</a>'
    why = headline(v)
    turned = np.degrees(v.moved_turn_max_rad)
    numbers = (f"{1e3 * v.moved_max_m:.0f} mm, {turned:.0f}°", f"{1e3 * v.max_m:.0f} mm", f"{v.time_factor:.2f}")
    cells = "".join(f'<td class="number">{number}</td>' for number in numbers)
    answer = f'<span class="answer {v.verdict}">{v.verdict.replace("_", " ")}</span>'
    return f"<tr><td>{answer}</td><td>{name}</td><td>{escape(why)}</td>{cells}</tr>"
