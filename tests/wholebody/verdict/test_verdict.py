"""Strategy: episode results made by hand, judged, written as text and as JSON held against the shipped schema."""

import json
import re

import jsonschema
import numpy as np
import pytest

from policy.executor.report import ExecutionReport
from policy.recorded.walked_motion import FAR_HANDS
from wholebody.config.file import config_from
from wholebody.config.verdict import VerdictConfig
from wholebody.episode.result import EpisodeResult, Note, Refusal
from wholebody.episode.tracking_error import PalmErrors
from wholebody.errors import ConfigError
from wholebody.resources import verdict_schema
from wholebody.sim.fall import Fall
from wholebody.sim.limit_monitor import LimitExcess
from wholebody.types import Reason
from wholebody.verdict.report import HEADINGS, lines, row, table_line, table_summary, to_json, violation_line
from wholebody.verdict.verdict import verdict_of
from wholebody.verdict.why.headline import headline


def result(*, errors=0.001, lags=0.001, moved=0.001, reasons=(None,) * 10, **changes):
    """Ten steps at 30 Hz from second 1, all with the same error; the left hand may be asked for the first eight."""
    fair = np.ones((10, 2), dtype=bool)
    fair[8:, 0] = False
    distances = {"errors": errors, "lags": lags, "moved": moved}
    angles = {name: changes.pop(name, 0.002) for name in ("turns", "lag_turns", "moved_turns")}
    palms = PalmErrors(
        times=1.0 + np.arange(10) / 30.0,
        demandable=fair,
        reasons=list(reasons),
        fingers=changes.pop("fingers", {}),
        asked=np.ones((10, 2, 3)),
        **{name: np.broadcast_to(value, (10, 2)).copy() for name, value in (distances | angles).items()},
    )
    seconds = {} if reasons[0] is None else {reasons[0]: 1.0}
    settings = {"seconds": {"tracking": 3.0}, "reasons": seconds, "margin": 0.04, "start": 1.0, "fps": 30.0}
    return EpisodeResult(palms=palms, **settings | changes)


def codes(verdict):
    return [violation.kind for violation in verdict.violations]


def test_what_is_followed_as_given_is_feasible():
    verdict = verdict_of("wave", result())
    assert verdict.verdict == "feasible"
    assert verdict.violations == []
    assert verdict.rms_m == pytest.approx(0.001)
    assert verdict.demandable_share == pytest.approx(0.9)
    assert verdict.within_20mm == 1.0
    assert lines(verdict)[0] == "FEASIBLE  wave: done as given"


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"slowdown": 1.5, "slowed_time": 2.0}, "too_fast_for_balance"),
        ({"moved": 0.03, "reasons": (Reason.OUT_OF_REACH,) * 10}, "out_of_reach"),
        ({"moved": 0.03}, "position"),
        ({"moved_turns": np.deg2rad(20.0)}, "orientation"),
        ({"errors": 0.03}, "late"),
        ({"turns": np.deg2rad(20.0)}, "late"),
        ({"time_factor": 1.2}, "waiting"),
        ({"reasons": (Reason.HANDS_DROPPED,) * 10}, "hands_dropped"),
        ({"fingers": {"left_hand_thumb_0_joint": LimitExcess(1.1, 0.2, 5.0, 1.05)}}, "finger_limit"),
        ({"start_jump": (0.4, 0.0)}, "far_start"),
        ({"errors": 0.2, "slowdown": 1.5, "slowed_time": 2.0}, "too_fast_for_balance"),
        ({"contacts": {("left_elbow_link", "torso_link"): 1.2}}, "self_contact"),
        ({"torques": {"waist_pitch_joint": LimitExcess(1.1, 0.2, 41.0, 35.0)}}, "torque_limit"),
    ],
)
def test_what_is_executed_with_changes_is_feasible_after_repair(changes, code):
    verdict = verdict_of("motion", result(**changes))
    assert verdict.verdict == "feasible_after_repair"
    assert codes(verdict)[0] == code
    assert lines(verdict)[0].startswith("FEASIBLE AFTER REPAIR  motion: done, but ")


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"fall": Fall(2.5, "pelvis at 0.19 m")}, "fall"),
        ({"reasons": (Reason.DESCENDING,) * 10}, "descending"),
        ({"refusals": [Refusal(1.0, "chunk_invalid", "T_world_lhand has NaN at step 7")]}, "refused"),
        ({"moved": 0.3, "errors": 0.3, "reasons": (Reason.INTO_FLOOR,) * 10}, "into_floor"),
        ({"moved": 0.3, "errors": 0.3}, "position"),
        ({"moved_turns": 1.5, "turns": 1.5}, "orientation"),
        ({"lags": 0.1, "errors": 0.1}, "lost"),
        ({"lag_turns": 1.5, "turns": 1.5}, "lost"),
    ],
)
def test_what_falls_is_refused_lost_or_becomes_another_motion_is_infeasible(changes, code):
    verdict = verdict_of("motion", result(**changes))
    assert verdict.verdict == "infeasible"
    assert codes(verdict)[0] == code


def test_marks_that_change_nothing_leave_it_feasible():
    marks = {
        "scene_contacts": {("left_hand_palm_link", "object"): 1.2},
        "torques": {"left_knee_joint": LimitExcess(1.1, 0.004, 150.0, 139.0)},
        "edge": LimitExcess(1.2, 0.01, 0.0005, 0.001),
        "positions": {"left_knee_joint": LimitExcess(1.2, 0.01, 2.9, 2.88)},
        "start_jump": (0.2, 0.5),
        "moved": 0.01,
        "reasons": (Reason.NOISY_CHUNK,) * 10,
    }
    verdict = verdict_of("grasp", result(**marks))
    assert verdict.verdict == "feasible"
    assert codes(verdict) == [
        "noisy_chunk", "start_offset", "start_offset", "balance_edge", "joint_limit", "scene_contact"
    ]  # fmt: skip


def test_the_worst_comes_first_with_subject_time_step_value_bound_and_unit():
    everything = {
        "errors": 0.2,
        "fall": Fall(1.3, "pelvis at 0.19 m"),
        "moved": np.array([[0.0, 0.12 if k == 6 else 0.0] for k in range(10)]),
        "reasons": (Reason.OUT_OF_REACH,) * 10,
        "torques": {
            "left_knee_joint": LimitExcess(1.1, 0.2, 140.0, 139.0),
            "waist_pitch_joint": LimitExcess(1.1, 0.2, 48.0, 35.0),
        },
    }
    verdict = verdict_of("motion", result(**everything))
    assert codes(verdict) == ["fall", "late", "torque_limit", "torque_limit", "out_of_reach"]
    assert [one.came_of for one in verdict.violations] == [None, "fall", "fall", "fall", None]
    assert verdict.violations[2].subject == "waist_pitch_joint"
    assert verdict.violations[4].step == 6
    text = lines(verdict)
    assert text[:4] == [
        "INFEASIBLE  motion: the robot falls at row 9 (0.30 s): pelvis at 0.19 m",
        "  fall: pelvis at 0.19 m at row 9 (0.30 s)",
        "    of which came palm_missed (late), torque_limit 2 times",
        "  out_of_reach: right palm commanded 120 mm from where it was asked to be (bound 50 mm) at row 6 (0.20 s)",
    ]
    assert [violation_line(one, verdict.fps) for one in verdict.violations[1:3]] == [
        "palm_missed (late): left palm 200 mm from where it was asked to be (bound 20 mm) at row 0 (0.00 s)",
        "torque_limit: waist_pitch_joint asked for 48 N m (bound 35 N m) at row 3 (0.10 s)",
    ]


def test_of_hands_what_is_farthest_past_its_own_bound_is_listed_first_and_told():
    moved = np.zeros((10, 2))
    moved[2], moved[7] = 0.12, 0.34
    why = [Reason.OUT_OF_REACH] * 5 + [Reason.INTO_FLOOR] * 5
    verdict = verdict_of("motion", result(moved=moved, reasons=why, moved_turns=np.deg2rad(100.0)))
    assert codes(verdict) == ["into_floor", "orientation", "out_of_reach"]
    assert "left hand 340 mm off at row 7 (0.23 s), 50 mm allowed: below the floor" in lines(verdict)[0]
    assert codes(verdict_of("motion", result(moved=moved, reasons=why, fall=Fall(9.0, "x"))))[:2] == [
        "fall",
        "into_floor",
    ]


def test_a_first_step_far_from_the_hands_is_marked_in_metres_and_in_degrees():
    assert "  far_start: first step 1.50 m from where" in "\n".join(
        lines(verdict_of("far", result(start_jump=(1.5, 0.0))))
    )
    verdict = verdict_of("motion", result(start_jump=(0.4, 2.0)))
    assert codes(verdict) == ["far_start", "far_start"]
    assert "  start    1500 mm from the hands, which every row counts from" in lines(
        verdict_of("far", result(start_jump=(1.5, 0.0)))
    )
    assert "  far_start: first step 400 mm from where the hands were (bound 300 mm) at row 0 (0.00 s)" in lines(verdict)
    assert "  far_start: first step 115 deg from where the hands were (bound 60 deg) at row 0 (0.00 s)" in lines(
        verdict
    )


@pytest.mark.parametrize(
    "changes",
    [{}, {"margin": float("inf")}, {"fall": Fall(2.5, "x")}, {"torques": {"a": LimitExcess(0.5, 0.2, 41.0, 35.0)}}],
)
def test_json_follows_the_shipped_schema(changes):
    schema = json.loads(verdict_schema().read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    text = to_json([verdict_of("a", result(**changes), {"dt": 0.002}), verdict_of("b", result())])
    jsonschema.validate(json.loads(text), schema)


def test_the_schema_refuses_what_is_not_a_verdict():
    schema = json.loads(verdict_schema().read_text())
    verdict = verdict_of("a", result()).as_dict()
    for wrong in ({"verdict": "maybe"}, {"rms_m": -1.0}, {"extra": 1}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate([verdict | wrong], schema)


def test_a_verdict_names_the_configuration_and_the_versions_it_was_made_with():
    verdict = verdict_of("a", result(), {"solver": "daqp"})
    assert verdict.config == {"solver": "daqp"}
    assert re.match(r"\d", verdict.versions["mujoco"])


def test_1_an_episode_of_which_nothing_was_executed_is_not_feasible():
    verdict = verdict_of("nothing", EpisodeResult())
    assert (verdict.verdict, codes(verdict)) == ("infeasible", ["no_chunk"])
    assert lines(verdict)[0].startswith("INFEASIBLE  nothing: nothing of it was executed")
    jsonschema.validate(json.loads(to_json([verdict])), json.loads(verdict_schema().read_text()))


@pytest.mark.parametrize(
    ("millimetres", "answer"),
    [(19.9, "feasible"), (20.1, "feasible_after_repair"), (49.9, "feasible_after_repair"), (50.1, "infeasible")],
)
@pytest.mark.parametrize(
    "reason",
    [None, Reason.OUT_OF_REACH, Reason.INTO_FLOOR, Reason.NOISY_CHUNK, Reason.STEPS_JUMP, Reason.TOO_FAST_FOR_BALANCE],
)
def test_2_a_hand_that_was_moved_is_judged_by_how_far_whoever_moved_it(reason, millimetres, answer):
    verdict = verdict_of("motion", result(moved=1e-3 * millimetres, reasons=(reason,) * 10))
    assert verdict.verdict == answer
    assert verdict.moved_max_m == pytest.approx(1e-3 * millimetres)
    assert reason is None or reason in codes(verdict)


def test_2_every_reason_that_the_controller_had_is_a_violation():
    seconds = {reason: 0.5 for reason in Reason if reason.status is not None}
    first = {Reason.HANDS_DROPPED: (2.0, "balance needs everything: hands give way")}
    found = result()
    found.reasons, found.first_reasons = seconds, first
    verdict = verdict_of("motion", found)
    assert {one.code for one in verdict.violations} == set(seconds) - {Reason.NO_CHUNK, Reason.STARVED}
    assert verdict.verdict == "infeasible", "standing is lost"
    assert (
        "  hands_dropped: balance needs everything: hands give way, for 0.5 s in all, from row 30 (1.00 s) on"
        in lines(verdict)
    )
    jsonschema.validate(json.loads(to_json([verdict])), json.loads(verdict_schema().read_text()))


@pytest.mark.parametrize(
    ("degrees", "answer"),
    [(9.9, "feasible"), (10.1, "feasible_after_repair"), (24.9, "feasible_after_repair"), (25.1, "infeasible")],
)
def test_3_orientation_has_bounds_of_its_own_unless_it_is_free(degrees, answer):
    turned = {"moved_turns": np.deg2rad(degrees), "turns": np.deg2rad(degrees)}
    assert verdict_of("motion", result(**turned)).verdict == answer
    free = verdict_of("motion", result(**turned, orientation_free=(True, True)))
    assert (free.verdict, free.violations) == ("feasible", [])
    assert free.moved_turn_max_rad == pytest.approx(np.deg2rad(degrees)), "told, and not judged"
    one = verdict_of("motion", result(**turned, orientation_free=(True, False)))
    assert one.verdict == answer


def test_3_all_four_bounds_are_settings():
    strict = VerdictConfig(palm_feasible=0.001, palm_repair=0.002, turn_feasible=0.01, turn_repair=0.02)
    assert verdict_of("a", result(moved=0.0015), bounds=strict).verdict == "feasible_after_repair"
    assert verdict_of("a", result(moved=0.0025), bounds=strict).verdict == "infeasible"
    assert verdict_of("a", result(moved_turns=0.015), bounds=strict).verdict == "feasible_after_repair"
    assert verdict_of("a", result(moved_turns=0.025), bounds=strict).verdict == "infeasible"
    changed = config_from({"verdict": {"palm_repair": "0.1"}}).verdict
    assert changed == VerdictConfig(palm_repair=0.1)
    with pytest.raises(ConfigError, match=r"verdict.palm_feasible is 0.2 m; it must be at most verdict.palm_repair"):
        config_from({"verdict": {"palm_feasible": "0.2"}})


@pytest.mark.parametrize(
    ("jump", "steps", "answer"), [(0.2, 6, "feasible"), (0.0, 6, "infeasible"), (0.2, 10, "infeasible")]
)
def test_4_the_way_to_a_start_elsewhere_is_a_note_unless_it_never_ends(jump, steps, answer):
    """Without an end, or from where the hands were, it is a hand that was moved."""
    way = np.zeros((10, 2))
    way[:steps, 0] = 0.2
    verdict = verdict_of("motion", result(moved=way, errors=way, start_jump=(jump, 0.0)))
    assert verdict.verdict == answer
    assert ("start_offset" in codes(verdict)) == (jump > 0.0)
    assert verdict.approach_s == pytest.approx(steps / 30.0 if answer == "feasible" else 0.0)


def test_5_a_robot_that_waited_for_chunks_did_not_do_it_as_given():
    report = ExecutionReport(starved=0.8, starvations=3)
    report.add(1.3, "starved", "the last chunk ended at 1.300 s")
    verdict = verdict_of("wave", result(execution=report))
    assert (verdict.verdict, codes(verdict)) == ("feasible_after_repair", ["starved"])
    assert lines(verdict)[:2] == [
        "FEASIBLE AFTER REPAIR  wave: done, but it waits for chunks",
        "  starved: chunks were over before the next ones came, for 0.8 s in all, from row 9 (0.30 s) on",
    ]


def test_a_row_of_the_table_stands_below_its_headings():
    cells = row(verdict_of("folder/B_Fence1.csv", result(errors=0.0123)))
    assert cells == ("B_Fence1", "no", "90 %", "100 %", "12.3", "12", "1.00", "tracking 3.0")
    heading, line = table_line(HEADINGS, 12), table_line(cells, 12)
    assert heading.index("RMS mm") + len("RMS mm") == line.index("12.3") + len("12.3")
    assert heading.index("seconds in") == line.index("tracking")


def test_the_summary_counts_motions_falls_and_time_spent_damping():
    fallen = verdict_of("a", result(fall=Fall(2.0, "x"), seconds={"damping": 0.5}))
    assert table_summary([fallen]).startswith("1 motion, 1 fall, 0.5 s damping\n")
    assert table_summary([verdict_of("b", result())] * 2).startswith("2 motions, 0 falls, 0.0 s damping\n")


def test_a_policy_that_fails_again_and_again_is_one_line_with_the_first_time():
    refusals = [Refusal(0.25 * k, "policy_raised", f"KeyError: {k}") for k in range(40)]
    refusals.insert(7, Refusal(1.6, "policy_hung", "no answer since 0.600 s"))
    verdict = verdict_of("wave", result(refusals=refusals))
    said = [(v.subject, pytest.approx(v.time)) for v in verdict.violations if v.code == "refused"]
    assert said == [("policy_raised 40 times: KeyError: 0", -1.0), ("policy_hung: no answer since 0.600 s", 0.6)]


def test_recorded_hands_that_no_walk_can_have_are_another_motion():
    verdict = verdict_of("walk", result(notes=[Note(1.0, f"{FAR_HANDS}hands are drawn in: their way is not followed")]))
    assert (verdict.verdict, verdict.violations[0].code) == ("infeasible", "changed_numbers")
    assert headline(verdict).startswith(FAR_HANDS)


def test_what_decoding_changed_is_one_line_whatever_its_numbers():
    notes = [
        Note(1.0 + k, f"left_hand: {k + 1} numbers clipped to their limits, by up to 0.{k}5 rad") for k in range(3)
    ]
    verdict = verdict_of("wave", result(notes=[*notes, Note(2.0, "the image of 'head' is missing")]))
    assert verdict.verdict == "feasible_after_repair"
    assert [(v.code, v.subject, v.time, v.step) for v in verdict.violations] == [
        ("changed_numbers", "left_hand: 1 numbers clipped to their limits, by up to 0.05 rad, 3 times", None, None),
        ("chunk_note", "the image of 'head' is missing", 1.0, 30),
    ]
    jsonschema.validate(json.loads(to_json([verdict])), json.loads(verdict_schema().read_text()))
