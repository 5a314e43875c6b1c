"""Values that a simulation gave before, kept in JSON beside the versions that gave them."""

from __future__ import annotations

import json
import math
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("g1-wholebody", "mujoco", "pin", "placo", "daqp", "numpy")


class StoredValues:
    """The stored values of one test.

    The file holds ``{test: {"versions": {...}, "values": {name: number}}}``: each test has its own stamp, so storing
    one test again says nothing about the others.
    """

    def __init__(self, path: Path, test: str, *, update: bool) -> None:
        self.path = path
        self.test = test
        self.update = update
        self.measured: dict[str, float] = {}
        self.entry = _read(path).get(test, {"versions": {}, "values": {}})

    def check(self, name: str, value: float, *, tolerance: float) -> None:
        """Compare a value with the stored one; when updating, note it instead.

        Args:
            name: What was measured, with its unit if it is not SI, for example ``rms_mm``.
            value: The number; must be finite.
            tolerance: Largest absolute difference that is not a regression, in the unit of the value.

        Raises:
            AssertionError: If the value is not finite, not stored, or off by more than the tolerance.
        """
        value = float(value)
        assert math.isfinite(value), f"{name} = {value}"
        self.measured[name] = value
        if self.update:
            return
        assert name in self.entry["values"], f"{name} = {value:.6g} has no stored value: make regression-update"
        expected = self.entry["values"][name]
        assert abs(value - expected) <= tolerance, (
            f"{name} = {value:.6g}, stored {expected:.6g}, tolerance {tolerance:g}; stored with "
            f"{self.entry['versions']}, now {current_versions()}; if the change is meant: make regression-update"
        )

    def save(self) -> None:
        """Write the values of this test, if updating."""
        if not (self.update and self.measured):
            return
        content = _read(self.path)
        content[self.test] = {"versions": current_versions(), "values": self.measured}
        self.path.parent.mkdir(exist_ok=True)
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
