"""Strategy: ticks at times that the test says, one of them late."""

import pytest

from wholebody.live.lateness import EDGES_MS, Lateness


def test_lateness_is_counted_by_size():
    lateness = Lateness(0.002)
    for tick, late in enumerate((0.00005, 0.0003, 0.0003, 0.5)):
        lateness.began(0.002 * tick + late, 0.002 * tick)
    counts = lateness.summary()["late_ms"]
    assert (counts["<=0.1"], counts["<=0.5"], counts[f">{EDGES_MS[-1]:g}"]) == (1, 2, 1)
    assert sum(counts.values()) == lateness.ticks == 4
    assert lateness.summary()["late_max_ms"] == pytest.approx(500.0)


def test_a_gap_is_listed_with_what_the_loop_did_in_it():
    lateness = Lateness(0.002)
    for time in (0.0, 0.002, 0.004, 0.0101, 0.012):
        lateness.began(time, time)
    (gap,) = lateness.gaps
    assert (gap.time, gap.seconds) == (pytest.approx(0.0101), pytest.approx(0.0061))
    assert 0.0 <= gap.cpu < 0.1
    assert lateness.n_gaps == 1


def test_a_pause_is_no_gap():
    lateness = Lateness(0.002)
    lateness.began(0.0, 0.0)
    lateness.pause()
    lateness.began(5.0, 5.0)
    assert lateness.n_gaps == 0
