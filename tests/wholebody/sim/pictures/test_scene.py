"""Strategy: scenes of a recording made of numbers: what there is to draw, and what there is to say, without drawing."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.recordings import SQUARE, made_record, stepped_record
from wholebody.robot.support_polygon import convex_polygon
from wholebody.sim.pictures.scene import STATUS_COLOUR, MarkKind, Scene, Show, scene_at
from wholebody.types import Reason, Status


def pose(x, turn=0.0):
    T = np.eye(4)
    T[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    T[0, 3] = x
    return T


SCENE = Scene(
    time=1.0,
    q=np.zeros(50),
    objects=np.zeros((0, 7)),
    asked=np.stack([pose(0.5), pose(0.5, np.radians(20.0))]),
    commanded=np.stack([pose(0.4), pose(0.4)]),
    measured=np.stack([pose(0.38), pose(0.4)]),
    support=convex_polygon(SQUARE),
    pressure=np.array([0.06, 0.0]),
    com=np.array([0.01, 0.0, 0.7]),
    capture_point=np.array([0.02, 0.0]),
    status=Status.SLOWED,
    reason=Reason.OUT_OF_REACH,
    detail="targets moved by up to 0.100 m",
    rate=0.8,
)


def marks(scene, show):
    return [mark for mark in scene.marks() if mark.show is show]


def test_c7_the_asked_palms_are_ghosts_of_both_hands_and_lines_lead_there_from_the_measured_ones():
    ghosts, lines = marks(SCENE, Show.ASKED), marks(SCENE, Show.ERROR)
    assert [(mark.kind, mark.side) for mark in ghosts] == [(MarkKind.HAND, "left"), (MarkKind.HAND, "right")]
    assert (ghosts[1].T_world_palm == SCENE.asked[1]).all()
    assert ghosts[0].show.colour[3] < 0.6
    assert lines[0].points[:, 0].tolist() == [0.38, 0.5]
    assert [mark.points[0, 0] for mark in marks(SCENE, Show.COMMANDED)] == [0.4, 0.4]


def test_a_hand_that_is_where_it_is_asked_to_be_hides_its_ghost_behind_a_halo():
    there = replace(SCENE, measured=SCENE.asked)
    turned = replace(there, measured=np.stack([pose(0.5, np.radians(10.0)), SCENE.asked[1]]))
    kinds = [[mark.kind for mark in marks(scene, Show.ASKED)] for scene in (there, turned)]
    assert kinds == [[MarkKind.BALL, MarkKind.BALL], [MarkKind.HAND, MarkKind.BALL]]
    free = replace(turned, orientation_free=(True, False))
    assert [mark.kind for mark in marks(free, Show.ASKED)] == [MarkKind.BALL, MarkKind.BALL]
    assert not marks(there, Show.ERROR)


def test_c7_support_pressure_and_capture_point_lie_on_the_floor_one_over_the_other():
    (area,), (pressure,), (capture,) = (marks(SCENE, show) for show in (Show.SUPPORT, Show.PRESSURE, Show.CAPTURE))
    assert area.kind is MarkKind.AREA
    assert area.points[:, :2] == pytest.approx(convex_polygon(SQUARE).vertices)
    assert pressure.points[0, :2].tolist() == [0.06, 0.0]
    assert 0.0 < area.points[0, 2] < capture.points[0, 2] < pressure.points[0, 2] < 0.01


def test_the_support_goes_with_the_feet():
    before, swings, after = (scene_at(stepped_record(), row).support.vertices for row in (0, 15, 25))
    assert before[:, 0].max() == pytest.approx(0.05)
    assert swings[:, 1].max() == pytest.approx(-0.05)
    assert after[:, 0].max() == pytest.approx(0.25)


def test_c7_status_and_reason_and_the_numbers_are_said_in_words():
    status, numbers = SCENE.words()
    assert status == "slowed (out_of_reach): targets moved by up to 0.100 m"
    assert numbers == "left palm off by 120 mm, 0°, right palm off by 100 mm, 20°, balance margin 40 mm, speed 0.80"


def test_a_reason_without_a_sentence_says_that_of_its_kind():
    assert replace(SCENE, detail="").words()[0].endswith(Reason.OUT_OF_REACH.sentence)


def test_an_orientation_that_is_free_is_no_error():
    assert "right palm off by 100 mm, balance" in replace(SCENE, orientation_free=(False, True)).words()[1]


def test_before_the_first_chunk_nothing_is_asked_and_nothing_is_off():
    scene = replace(SCENE, asked=None, status=Status.HOLD, reason=Reason.NO_CHUNK)
    assert scene.errors is None
    assert not marks(scene, Show.ASKED)
    assert not marks(scene, Show.ERROR)
    assert scene.words()[1] == "balance margin 40 mm"


def test_in_the_air_there_is_no_pressure():
    scene = replace(SCENE, pressure=None)
    assert not marks(scene, Show.PRESSURE)
    assert "in the air" in scene.words()[1]


def test_every_mark_has_a_name_of_its_own_and_keeps_it():
    scenes = SCENE, replace(SCENE, measured=SCENE.asked), replace(SCENE, pressure=None, asked=None)
    names = [[mark.name for mark in scene.marks()] for scene in scenes]
    assert all(len(set(some)) == len(some) for some in names)
    assert {"asked_hand_left", "error_line_right", "mass_line", "mass_ball"} <= set(names[0])
    assert set(names[2]) < set(names[0])


def test_every_status_has_a_colour():
    assert set(STATUS_COLOUR) == set(Status)


def test_a_recording_tells_the_same():
    record = made_record(3, detail=np.array([0, 1, 1]), reason=np.array(["", "palm_missed", ""]))
    record["status"][1], record["T_world_palms_measured"][1, 0, 0, 3] = "slowed", 0.03
    record["T_world_palms_asked"][0], record["pressure"][2] = np.nan, np.nan
    first, second, third = (scene_at(record, row) for row in range(3))
    assert first.asked is None
    assert (second.time, second.status, second.reason, second.detail) == (
        0.002,
        Status.SLOWED,
        Reason.PALM_MISSED,
        "said",
    )
    assert second.errors == pytest.approx([0.03, 0.0])
    assert second.balance_margin == pytest.approx(0.1)
    assert third.pressure is None


def test_a_reason_code_of_an_older_recording_is_read_as_what_it_is_called_today():
    record = made_record(1, reason=np.array(["tracking"]))
    assert scene_at(record, 0).reason is Reason.PALM_MISSED
    with pytest.raises(ValueError, match="followed"):
        Reason("followed")
