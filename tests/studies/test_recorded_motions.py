"""Strategy: every recorded motion of a folder that the user names, run whole; the recordings are not a part of this
repository. ``make regression MOTIONS=FOLDER`` runs them; ``wholebody run --motions FOLDER`` prints the same table.
"""

import os
from pathlib import Path

import pytest

from policy.recorded.replay import open_recording
from wholebody.verdict.check import Checker
from wholebody.verdict.report import HEADINGS, row, table_line

pytestmark = [pytest.mark.regression, pytest.mark.timeout(0)]

FOLDER = Path(os.environ["G1_MOTIONS"])
FILES = sorted(FOLDER.glob("*.csv"))
TO_BE_FOLLOWED = ("B_Fence1", "B_WiggleDance", "B_HandsChop", "J_ShortDance13_SingleLadies")
"""Motions of which 90 % of the demandable steps are to be within 20 mm, at a time factor of at most 1.2."""


@pytest.fixture(scope="module")
def checker():
    return Checker()


def test_there_are_motions():
    assert FILES, f"no .csv files in {FOLDER}"


@pytest.mark.parametrize("name", [file.stem for file in FILES])
def test_motion(checker, stored, name):
    policy = open_recording(FOLDER / f"{name}.csv")
    verdict, _ = checker.check(policy, name, policy.duration)
    print(table_line(HEADINGS, len(name)), table_line(row(verdict), len(name)), sep="\n")
    assert not verdict.fell
    assert verdict.seconds.get("damping", 0.0) == 0.0
    within, slow = ({"at_least": 0.9}, {"at_most": 1.2}) if name in TO_BE_FOLLOWED else ({}, {})
    stored.check("within_20mm", verdict.within_20mm, tolerance=0.02, **within)
    stored.check("time_factor", verdict.time_factor, tolerance=0.02, **slow)
    stored.check("demandable_share", verdict.demandable_share, tolerance=0.02)
    stored.check("rms_mm", 1e3 * verdict.demandable_rms_m, tolerance=2.0 + 0.1e3 * verdict.demandable_rms_m)
    stored.check("max_mm", 1e3 * verdict.demandable_max_m, tolerance=5.0 + 0.2e3 * verdict.demandable_max_m)
