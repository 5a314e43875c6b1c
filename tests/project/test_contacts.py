"""Strategy: the library's source, searched for what counts on two soles that stay where they are.

Which feet stand where is data, a `ContactSchedule`. Poses of feet are for what makes or places contacts; what plans,
estimates or judges takes a schedule. Kernels go over the contacts that stand, not over both. The search is shown to
find each kind.
"""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2] / "wholebody"
PLACES = {
    "robot/contact_schedule.py",
    "robot/feet.py",
    "control/base.py",
    "control/controller.py",
    "estimation/odometry.py",
    "execution/ending/crouch.py",
    "execution/feet/elsewhere.py",
    "execution/feet/walker.py",
    "execution/planted_feet.py",
    "trajopt/footing.py",
    "trajopt/robot_tables.py",
    "verdict/fast.py",
}
"""What measures where feet are, or places them for a schedule."""
PATTERNS = {
    "poses of feet where a schedule is to be": r"^from wholebody\.robot\.feet import .*\bFeet\b",
    "feet that are told without when": r"\bdef \w+\(.*\bfeet: Feet\b|^    feet: Feet\b",
    "a loop over all contacts of a program": r"for \w+ in range\((tick\.n_contacts|feet|n_contacts)\)",
    "a number of points of all contacts": r"\bP\.shape\[0\]\)",
    "all contacts for those that stand": r"for foot in (self\._?)?controller\.feet for axis",
}
ALL_CONTACTS = {("qp/kernels/contacts.py", "for c in range(tick.n_contacts):")}
"""Where the targets of contacts are computed, whether they stand or not."""
KINEMATIC = {("backends/kinematic/kernels/program.py", "for c in range(tick.n_contacts):")}


def found(root):
    """Each line that counts on it: file, line, what."""
    for path in sorted(root.rglob("*.py")):
        name = str(path.relative_to(root))
        for line in path.read_text().splitlines():
            for what, pattern in PATTERNS.items():
                places = "feet" in what and name in PLACES
                if re.search(pattern, line) and not places and (name, line.strip()) not in ALL_CONTACTS | KINEMATIC:
                    yield name, line.strip(), what


def test_nothing_counts_on_two_soles_for_ever():
    assert list(found(ROOT)) == []


def test_each_place_that_is_let_off_exists():
    assert [name for name in PLACES if "Feet" not in (ROOT / name).read_text()] == []
    assert [name for name, line in ALL_CONTACTS | KINEMATIC if line not in (ROOT / name).read_text()] == []


@pytest.mark.parametrize(
    "line",
    [
        "from wholebody.robot.feet import Feet, Floor",
        "    def stand_on(self, feet: Feet) -> None:",
        "    feet: Feet | None = None",
        "    for c in range(tick.n_contacts):",
        "    for i in range(P.shape[0]):",
        "    labels += [x for foot in controller.feet for axis in AXES]",
    ],
)
def test_the_search_finds(tmp_path, line):
    (tmp_path / "planner.py").write_text(f"{line}\n")
    assert [text for _, text, _ in found(tmp_path)] == [line.strip()]
