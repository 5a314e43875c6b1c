"""Values that a simulation gave before, kept in JSON beside the versions that gave them, and the bars to meet.

``python tests/support/stored.py`` writes the table of those of the whole robot into ``docs/measured.md``.
"""

from __future__ import annotations

import json
import math
import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "tests" / "studies" / "stored"
DOCUMENTED = ("test_main_job", "test_hands", "test_recorded_motions")
"""Test files whose values that document shows; the others have documents of their own."""
DOCUMENT = ROOT / "docs" / "measured.md"
BEGIN, END = "<!-- stored values: make regression-update -->", "<!-- end of stored values -->"
PACKAGES = ("g1-wholebody", "mujoco", "pin", "placo", "daqp", "numpy")


@dataclass(frozen=True)
class Measured:
    """A value with what it was before, None if never, and the bar it should meet."""

    name: str
    value: float
    before: float | None
    at_most: float = math.inf
    at_least: float = -math.inf

    def meets(self, value: float | None) -> bool:
        """Whether a value of this kind is inside the bar."""
        return value is not None and self.at_least <= value <= self.at_most

    def __str__(self) -> str:
        text = f"{self.name} = {self.value:.4g}"
        text += "" if self.before is None else f" (stored {self.before:.4g})"
        for sign, bound in (("<=", self.at_most), (">=", self.at_least)):
            if math.isfinite(bound):
                text += f", bar {sign} {bound:g}: {'met' if self.meets(self.value) else 'MISSED'}"
        return text


class StoredValues:
    """The stored values of one test.

    The file holds ``{test: {"versions": {...}, "values": {name: number}, "bars": {name: [least, most]}}}``: each test
    has its own stamp, so storing one test again says nothing about the others.
    """

    def __init__(self, path: Path, test: str, *, update: bool) -> None:
        self.path = path
        self.test = test
        self.update = update
        self.measured: list[Measured] = []
        self.problems: list[str] = []
        self.entry = _read(path).get(test, {"versions": {}, "values": {}})

    def check(
        self, name: str, value: float, *, tolerance: float, at_most: float = math.inf, at_least: float = -math.inf
    ) -> None:
        """Compare a value with the stored one, for `judge`; when updating, only note it.

        Args:
            name: What was measured, with its unit if it is not SI, for example ``rms_mm``.
            value: The number; must be finite.
            tolerance: Largest absolute difference that is not a regression, in the unit of the value.
            at_most, at_least: The bar. Once met it stays met, whatever the tolerance; until then it is only reported.

        Raises:
            AssertionError: If the value is not finite.
        """
        value = float(value)
        assert math.isfinite(value), f"{name} = {value}"
        one = Measured(name, value, self.entry["values"].get(name), at_most, at_least)
        self.measured.append(one)
        if self.update:
            return
        if one.before is None:
            self.problems.append(f"{name} = {value:.6g} has no stored value: make regression-update")
        elif one.meets(one.before) and not one.meets(value):
            self.problems.append(f"{one}: it was met before")
        elif not abs(value - one.before) <= tolerance:
            self.problems.append(
                f"{name} = {value:.6g}, stored {one.before:.6g}, tolerance {tolerance:g}; stored with "
                f"{self.entry['versions']}, now {current_versions()}; if the change is meant: make regression-update"
            )

    def judge(self) -> None:
        """Called when the test is over, so that all of its values are known.

        Raises:
            AssertionError: If a value was not stored, is off by more than its tolerance, or past a bar that the stored
                value meets.
        """
        assert not self.problems, "\n".join(self.problems)

    def save(self) -> None:
        """Write the values of this test, if updating."""
        if not (self.update and self.measured):
            return
        content = _read(self.path)
        values = {one.name: one.value for one in self.measured}
        bars = {one.name: [_finite(one.at_least), _finite(one.at_most)] for one in self.measured}
        bars = {name: bar for name, bar in bars.items() if bar != [None, None]}
        content[self.test] = {"versions": current_versions(), "values": values, "bars": bars}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text(json.dumps(content, indent=2, sort_keys=True) + "\n")


def current_versions() -> dict[str, str]:
    """Versions that a stored value depends on."""
    versions = {"python": platform.python_version(), "machine": platform.machine()}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed"
    return versions


def _read(path: Path) -> dict[str, dict[str, dict]]:
    return json.loads(path.read_text()) if path.exists() else {}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def document(text: str, folder: Path = FOLDER) -> str:
    """A document with the table of the stored values between its two marks."""
    before, _, rest = text.partition(BEGIN)
    if not rest:
        raise ValueError(f"no line '{BEGIN}' in the document")
    return before + BEGIN + "\n" + "\n".join(_table(folder)) + "\n" + END + rest.partition(END)[2]


def _table(folder: Path) -> list[str]:
    lines = ["| `make regression ARGS='-k \"…\"'` | Measured (bar) |", "|---|---|"]
    for stem in DOCUMENTED:
        for test, entry in _read(folder / f"{stem}.json").items():
            name, _, case = test.removesuffix("]").partition("[")
            chosen = f"{name} and {case}" if case.isidentifier() else name
            values = [_cell(key, value, entry.get("bars", {}).get(key)) for key, value in entry["values"].items()]
            lines.append(f"| `{chosen}`{'' if case.isidentifier() or not case else f' {case}'} | {', '.join(values)} |")
    return lines


def _cell(name: str, value: float, bar: list[float | None] | None) -> str:
    text = f"{name} {value:.3g}"
    if bar is None:
        return text
    least, most = bar
    met = (least is None or value >= least) and (most is None or value <= most)
    sign, bound = ("≥", least) if least is not None else ("≤", most)
    return f"{text} ({sign} {bound:g})" if met else f"**{text}** ({sign} {bound:g})"


if __name__ == "__main__":
    DOCUMENT.write_text(document(DOCUMENT.read_text()))
