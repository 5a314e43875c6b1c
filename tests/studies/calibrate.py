"""Fit the calibration to outcomes, and say what it is worth on chunks that it was not fitted to.

``python -m tests.studies.calibrate OUTCOMES... --model MODEL.npz --sheet SHEET.png`` reads what
`tests.studies.outcomes` wrote (.jsonl, or packed .xz), fits to all families but recorded motions, and prints the
tables of ``docs/calibration.md``. Groups are never split: what is said of the families fitted to is by models that were
fitted to other groups, what is said of recorded motions by a model that saw none, and of each family once more by a
model that saw none of it. ``--repeats FILE`` counts in how many cases another physics step gives another answer.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from math import lgamma
from pathlib import Path

import numpy as np

from tests.support.calibration_fit import BINS, DRAWS, NUMBERS, alarm_bound, calibration_error, fit_calibration
from tests.support.outcome_lines import pack, read_lines
from wholebody.verdict.calibration.model import Calibration
from wholebody.verdict.worlds import binomial_interval

HELD_OUT = "recorded"
"""Family that the shipped model is never fitted to."""
FALSE_ALARMS = 0.05
"""Share of the others at which the recall is told [no unit]; definition."""
COVERED = 30
"""Chunks begun in motion from which on those are told as any others [no unit]; chosen."""
FEW, MANY = 1, 4000
"""Draws of the data where no interval is asked for, and chunks at most that such a model is fitted to; chosen: some
seconds a fit."""
BIN_MIN = 10
"""Chunks that a point of a diagram stands for at least [no unit]; chosen."""
TITLES = ("falls as given", "followed within 20 mm")


class Lines:
    """Outcomes as arrays of m chunks: quantities, worlds, groups, families, starts, and answers (2, m)."""

    def __init__(self, lines: list[dict]) -> None:
        self.lines, self.quantities = lines, [line["quantities"] for line in lines]
        self.worlds, self.groups, self.families, self.starts = (
            np.array([line[name] for line in lines]) for name in ("world", "group", "family", "start")
        )
        told = [(line["as_given"]["fell"], line["planned"]["followed"]) for line in lines]
        self.answers = np.array(told, dtype=float).T.reshape(2, -1)

    def __len__(self) -> int:
        return len(self.lines)

    def part(self, which: np.ndarray) -> Lines:
        """Those of a mask (m,)."""
        return Lines([line for line, one in zip(self.lines, which, strict=True) if one])


def read(paths: list[Path]) -> Lines:
    """Of files, each case once in a world; robots that fell before the chunk came are left out."""
    found = {}
    for path in paths:
        for line in read_lines(path):
            if not line["as_given"]["early"]:
                found.setdefault((line["case"], line["draw"]), line)
    return Lines([found[key] for key in sorted(found)])


def fitted(lines: Lines, repeats: int = DRAWS, numbers: Sequence[int] = NUMBERS) -> tuple[Calibration, np.ndarray]:
    """A model of all lines, and what models fitted to the other groups say of each."""
    covers = ["a start in motion"] if (lines.families == "moving").sum() >= COVERED else []
    card = {
        "covers": covers,
        "families": dict(Counter(lines.families.tolist())),
        "falls": int(lines.answers[0].sum()),
        "followed": int(lines.answers[1].sum()),
        "revisions": sorted({line["revision"] for line in lines.lines}),
    }
    return fit_calibration(
        lines.quantities,
        lines.worlds.tolist(),
        lines.answers,
        lines.groups.tolist(),
        numbers=numbers,
        repeats=repeats,
        card=card,
    )


def asked(model: Calibration, lines: Lines) -> np.ndarray:
    """Probabilities (2, m) that a model gives."""
    return model.probabilities(model.rows(lines.quantities, lines.worlds.tolist()))


def recall(p: np.ndarray, fell: np.ndarray, false_alarms: float = FALSE_ALARMS) -> float:
    """Share of the falls that is found at a share of false alarms."""
    stood = np.sort(p[fell < 0.5])[::-1]
    k = int(np.floor(false_alarms * len(stood)))
    return float((p[fell > 0.5] > stood[k]).mean()) if len(stood) and (fell > 0.5).any() else float("nan")


def ranked(p: np.ndarray, y: np.ndarray) -> float:
    """Share of the pairs of a yes and a no of which the yes has the larger probability."""
    yes, no = p[y > 0.5], p[y < 0.5]
    if not len(yes) or not len(no):
        return float("nan")
    return float((np.sign(yes[:, None] - no[None]) * 0.5 + 0.5).mean())


def between(count: int, n: int) -> str:
    """A share with the interval that it has with 95 % confidence."""
    if not n:
        return "none"
    low, high = binomial_interval(count, n)
    return f"{100 * count / n:.1f} % ({100 * low:.0f} to {100 * high:.0f})"


def row(name: str, p: np.ndarray, lines: Lines, alarm: float) -> str:
    """Of a set of chunks: what the alarm finds, and how far probabilities are from shares."""
    fell = lines.answers[0] > 0.5
    found, wrong = int((p[0][fell] >= alarm).sum()), int((p[0][~fell] >= alarm).sum())
    errors = [calibration_error(p[k], lines.answers[k]) for k in (0, 1)]
    cells = [
        name, str(len(lines)), str(int(fell.sum())), f"{ranked(p[0], lines.answers[0]):.3f}",
        f"{100 * recall(p[0], lines.answers[0]):.1f} %", between(found, int(fell.sum())),
        between(wrong, int((~fell).sum())), f"{errors[0]:.3f}", f"{chance_error(p[0]):.3f}",
        f"{ranked(p[1], lines.answers[1]):.3f}", f"{errors[1]:.3f}", f"{chance_error(p[1]):.3f}",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def chance_error(p: np.ndarray, draws: int = 200) -> float:
    """Error of a calibration that chance alone gives where the probabilities are right: the median of draws."""
    rng = np.random.default_rng(0)
    return float(np.median([calibration_error(p, (rng.random(len(p)) < p).astype(float)) for _ in range(draws)]))


HEAD = (
    "Chunks", "Number", "Falls", "Ranking", "Recall at 5 % false alarms", "Recall of the alarm", "False alarms",
    "Calibration error, fall", "by chance", "Ranking, followed", "Calibration error, followed", "by chance",
)  # fmt: skip


def report(lines: Lines) -> tuple[Calibration, list[tuple[str, np.ndarray, np.ndarray]]]:
    """Fit, and print the tables; the model, and what it said of groups left out and of motions."""
    seen, motions = lines.part(lines.families != HELD_OUT), lines.part(lines.families == HELD_OUT)
    model, held = fitted(seen)
    alarm = model.card["alarm_bound"]
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    print(row("groups left out", held, seen, alarm))
    for world in np.unique(seen.worlds):
        mine = seen.worlds == world
        print(row(f"of them in {world} worlds", held[:, mine], seen.part(mine), alarm))
    curves = [("groups left out", held, seen.answers)]
    if len(motions):
        p = asked(model, motions)
        print(row("recorded motions", p, motions, alarm))
        curves.append(("recorded motions", p, motions.answers))
    for family in sorted(set(seen.families)):
        other = seen.part(seen.families != family)
        if len(set(other.groups)) > 20 and (seen.families == family).sum() > 4:
            some = other.part(np.arange(len(other)) % -(-len(other) // MANY) == 0)
            without, _ = fitted(some, FEW, [max(model.card["trees"].values())])
            mine = seen.part(seen.families == family)
            print(row(f"{family}, never fitted", asked(without, mine), mine, without.card["alarm_bound"]))
    falls = int(seen.answers[0].sum())
    print(f"\nalarm from {alarm:.4f}: {falls} falls, of which a promise of 1 % needs 99 and one by family 300 each")
    for name in sorted(set(seen.families)):
        own = held[0][(seen.families == name) & (seen.answers[0] > 0.5)]
        print(f"  {name}: {len(own)} falls, missed {int((own < alarm).sum())}, own bound {alarm_bound(own):.4f}")
    x = model.rows(lines.quantities, lines.worlds.tolist())
    far = model.distance(x) > model.card["near"]
    for name in (HELD_OUT, "others"):
        mine = (lines.families == HELD_OUT) == (name == HELD_OUT)
        print(f"unlike those fitted to: {name} {between(int(far[mine].sum()), int(mine.sum()))}")
    return model, curves


def disagreement(lines: Lines, repeats: Path) -> None:
    """Of how many cases another physics step gives another answer."""
    again = {line["case"]: line for line in map(json.loads, repeats.read_text().splitlines())}
    both = [(line, again[line["case"]]) for line in lines.lines if line["case"] in again and not line["draw"]]
    fell = sum(a["as_given"]["fell"] != b["as_given"]["fell"] for a, b in both)
    kept = sum(a["planned"]["followed"] != b["planned"]["followed"] for a, b in both)
    print(f"another physics step: of {len(both)} another answer on falls in {fell}, on what is followed in {kept}")
    pairs = [(a["as_given"]["fell"], b["as_given"]["fell"]) for a, b in both]
    found, falls = sum(a and b for a, b in pairs), sum(a for a, _ in pairs)
    wrong, stand = sum(b and not a for a, b in pairs), sum(not a for a, _ in pairs)
    print(f"  told by that simulation: {between(found, falls)} of the falls, false alarms {between(wrong, stand)}")


def ceiling(lines: Lines) -> None:
    """The most that can be known: by the probability of each chunk over all realistic worlds, of those drawn again."""
    again: dict[int, list[np.ndarray]] = {}
    for line, answer in zip(lines.lines, lines.answers.T, strict=True):
        if line["world"] == "realistic":
            again.setdefault(line["case"], []).append(answer)
    several = [np.array(found) for found in again.values() if len(found) > 1]
    for k, title in enumerate(TITLES):
        n, yes = np.array([len(one) for one in several]), np.array([one[:, k].sum() for one in several])
        if not len(n):
            continue
        a, b = beta_binomial(yes, n)
        p = (np.arange(4000) + 0.5) / 4000
        weight = p ** (a - 1.0) * (1.0 - p) ** (b - 1.0)
        above = np.cumsum((weight * (1.0 - p))[::-1])[::-1] / (weight * (1.0 - p)).sum()
        best = (weight * p)[above <= FALSE_ALARMS].sum() / (weight * p).sum()
        split = ((yes > 0) & (yes < n)).mean()
        print(f"{title}: {len(n)} chunks in {n.mean():.1f} worlds each, {100 * split:.0f} % with both answers; "
              f"at best {100 * best:.0f} % are found at 5 % false alarms")  # fmt: skip


def beta_binomial(yes: np.ndarray, n: np.ndarray) -> tuple[float, float]:
    """Exponents of the beta distribution of which counts out of n are likeliest, on a grid."""
    grid, best = np.exp(np.linspace(np.log(0.01), np.log(10.0), 61)), (-np.inf, 1.0, 1.0)
    for a in grid:
        for b in grid:
            said = sum(lgamma(k + a) + lgamma(m - k + b) - lgamma(m + a + b) for k, m in zip(yes, n, strict=True))
            best = max(best, (said + len(n) * (lgamma(a + b) - lgamma(a) - lgamma(b)), float(a), float(b)))
    return best[1], best[2]


def handful(model: Calibration, lines: Lines, n: int = 8) -> list[dict]:
    """Every so many of the cases, with what is told of them."""
    told, some = asked(model, lines).T, range(0, len(lines), max(len(lines) // n, 1))
    names = ("case", "family", "world", "quantities")
    return [
        {name: lines.lines[i][name] for name in names} | {"told": [round(p, 4) for p in told[i].tolist()]} for i in some
    ]


def sheet(curves: list[tuple[str, np.ndarray, np.ndarray]], path: Path) -> None:
    """Reliability diagrams: shares that came about over the probabilities that were told."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.4), constrained_layout=True)
    for k, (ax, title) in enumerate(zip(axes, TITLES, strict=True)):
        ax.plot((0, 1), (0, 1), color="0.7", linewidth=1.0)
        for (name, p, y), colour in zip(curves, ("#0b6fa4", "#c4551a"), strict=False):
            bins = min(BINS, max(y.shape[1] // BIN_MIN, 1))
            parts = np.array_split(np.argsort(p[k], kind="stable"), bins)
            at, share = (np.array([v[k][part].mean() for part in parts]) for v in (p, y))
            spans = [binomial_interval(int(y[k][part].sum()), len(part)) for part in parts]
            low, high = np.array(spans).T
            ax.vlines(at, low, high, color=colour, alpha=0.35)
            ax.plot(at, share, "o", color=colour, markersize=4, label=f"{name} ({len(p[k])})")
        ax.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), xlabel="probability told", title=title)
        ax.set_aspect("equal")
    axes[0].set_ylabel("share that came about")
    axes[1].legend(loc="upper left", frameon=False)
    figure.savefig(path, dpi=130)


def main() -> None:
    """Fit, print, and write what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("outcomes", type=Path, nargs="+", help="files of `tests.studies.outcomes`")
    parser.add_argument("--model", type=Path, help="where to write the model (.npz)")
    parser.add_argument("--sheet", type=Path, help="where to draw the reliability diagrams (.png)")
    parser.add_argument("--handful", type=Path, help="where to write some cases and what is told of them (.json)")
    parser.add_argument("--pack", type=Path, help="where to keep all outcomes, packed (.xz)")
    parser.add_argument("--repeats", type=Path, help="the same cases with another physics step")
    chosen = parser.parse_args()
    lines = read(chosen.outcomes)
    if len(lines) < 2 * BINS:
        sys.exit(f"{len(lines)} outcomes; at least {2 * BINS} are needed")
    model, curves = report(lines)
    ceiling(lines)
    if chosen.repeats is not None:
        disagreement(lines, chosen.repeats)
    if chosen.pack is not None:
        pack(lines.lines, chosen.pack)
    if chosen.model is not None:
        model.write(chosen.model)
        print(f"{chosen.model}: {chosen.model.stat().st_size / 1e3:.0f} kB, {model.card}")
    if chosen.handful is not None:
        chosen.handful.write_text(json.dumps(handful(model, lines), indent=1) + "\n")
    if chosen.sheet is not None:
        sheet(curves, chosen.sheet)


if __name__ == "__main__":
    main()
