"""Strategy: recordings made of numbers, in which one thing happens at a known time."""

import numpy as np
import pytest

from tests.support.recordings import DT, made_record
from wholebody.sim.pictures.moments import moments

N = 1000


def off_by(distance, at, side=0):
    """A palm that is off at one instant."""
    measured = np.tile(np.eye(4), (N, 2, 1, 1))
    measured[at, side, 0, 3] = distance
    return measured


def statuses(*parts):
    """Status and reason of consecutive parts (first row, status, reason)."""
    status, reason = np.full(N, "tracking", dtype="U40"), np.full(N, "", dtype="U40")
    for begin, name, why in parts:
        status[begin:], reason[begin:] = name, why
    return {"status": status, "reason": reason}


def chosen(record, count=6):
    return {moment.row: moment.why for moment in moments(record, count)}


def test_a_run_in_which_nothing_happens_is_shown_from_start_to_end():
    found = moments(made_record(N), 6)
    assert (found[0].row, found[0].why) == (0, "tracking begins")
    assert (found[-1].row, found[-1].why) == (N - 1, "end")
    assert [moment.why for moment in found[1:-1]] == ["on the way"] * 4
    assert np.diff([DT * moment.row for moment in found]).max() < 0.6


def test_the_largest_error_is_shown_with_its_palm_and_size():
    found = chosen(made_record(N, T_world_palms_measured=off_by(0.123, 400, side=1)))
    assert found[400] == "largest error: right palm 123 mm"


def test_c7_the_smallest_balance_margin_is_shown():
    margin = np.full(N, 0.1)
    margin[300] = 0.012
    assert chosen(made_record(N, pressure_margin=margin))[300] == "smallest balance margin: 12 mm"


def test_a_margin_that_is_always_the_same_or_only_begins_small_is_no_event():
    margin = np.linspace(0.099, 0.1, N)
    margin[0] = 0.04
    assert "margin" not in str(chosen(made_record(N, pressure_margin=margin)))
    in_the_air = np.full(N, np.nan)
    assert "margin" not in str(chosen(made_record(N, pressure_margin=in_the_air)))


def test_the_worst_statuses_are_shown_first_when_there_is_not_room_for_all():
    parts = [
        (100, "slowed", "tracking"),
        (200, "hold", "starved"),
        (400, "slowed", "into_floor"),
        (550, "stop", "off_plan"),
        (700, "damping", "standing_lost"),
    ]
    found = chosen(made_record(N, **statuses(*parts)), count=4)
    assert found == {
        200: "hold (starved) begins",
        550: "stop (off_plan) begins",
        700: "damping (standing_lost) begins",
        999: "end",
    }


def test_a_status_for_a_moment_is_left_out_unless_balance_is_at_stake():
    brief = statuses((400, "hold", "starved"), (410, "tracking", ""))
    assert "hold" not in str(chosen(made_record(N, **brief)))
    grave = statuses((400, "stop", "off_plan"), (410, "tracking", ""))
    assert chosen(made_record(N, **grave))[400] == "stop (off_plan) begins"


def test_a_new_status_is_shown_before_one_that_comes_again():
    parts = [(140 * k, *(("slowed", "tracking") if k % 2 else ("tracking", ""))) for k in range(6)]
    found = chosen(made_record(N, **statuses(*parts, (860, "hold", "starved"))), count=4)
    assert set(found.values()) == {"tracking begins", "slowed (tracking) begins", "hold (starved) begins", "end"}


def test_what_happens_at_once_is_one_picture_that_says_only_what_is_so_in_it():
    measured = off_by(0.2, 500)
    together = chosen(made_record(N, T_world_palms_measured=measured, **statuses((490, "hold", "starved"))))
    assert together[500] == "largest error: left palm 200 mm; hold (starved) since 0.98 s"
    before = chosen(made_record(N, T_world_palms_measured=measured, **statuses((510, "hold", "starved"))))
    assert before[500] == "largest error: left palm 200 mm"
    again = statuses(*((460 + 20 * k, "stop", "qp_failed" if k % 2 else "off_plan") for k in range(6)))
    since = chosen(made_record(N, T_world_palms_measured=measured, **again))
    assert since[500] == "largest error: left palm 200 mm; stop (off_plan) begins"


def test_what_is_left_over_shows_the_motion():
    measured = np.tile(np.eye(4), (N, 2, 1, 1))
    measured[:, :, 0, 3] = np.clip(DT * np.arange(N) - 0.4, 0.0, 0.4)[:, None]
    found = moments(made_record(N, T_world_palms_measured=measured, T_world_palms_asked=measured), 5)
    times = [DT * moment.row for moment in found if moment.why == "on the way"]
    assert times == pytest.approx([0.5, 0.6, 0.7], abs=0.02)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_a_recording_shorter_than_the_sheet_is_shown_whole(n):
    assert [moment.row for moment in moments(made_record(n), 6)] == [*range(n)]


def test_a_run_whose_chunk_never_came_is_shown():
    asked = np.full((N, 2, 4, 4), np.nan)
    assert len(moments(made_record(N, T_world_palms_asked=asked), 6)) == 6
