"""Strategy: numbers of one's own through the front door against the same chunk through the inner ones, in layouts of
wrists and joints, at the stance and in a state elsewhere; a repair comes back in the numbers that it came as.
"""

import numpy as np
import pytest

from policy import Anchor, ChunkError, FileFormatError, SpecError, builtin, decode, encode
from policy.recorded.array_file import read_array_file
from policy.recorded.replay import open_recording
from tests.support.sent_chunks import sent
from wholebody import InputError, RobotState, judge, repair
from wholebody.verdict.fast import FastChecker

STANCE = Anchor.nominal()


def numbers(layout, **how):
    return encode(builtin(layout), sent(**how), STANCE)


@pytest.mark.parametrize("layout", ["wbc32", "wbc32-v1", "wbc27", "joint28"])
def test_an_array_is_judged_as_the_chunk_that_it_means(layout):
    actions = numbers(layout)
    mine, theirs = judge(actions, layout=layout, fps=30), judge(decode(builtin(layout), actions, STANCE))
    assert (mine.verdict, mine.margins) == ("feasible", theirs.margins)


def test_lists_and_other_rates_are_taken():
    actions = numbers("wbc32", to=(0.25, 0.0, 0.0))
    assert judge(actions.tolist(), layout="wbc32").verdict == "feasible"
    assert judge(actions, layout="wbc32", fps=300).verdict == "infeasible"


def test_an_array_refers_to_the_state_that_is_given():
    begin, actions = FastChecker().judge.stance().body, numbers("wbc32")
    q = begin.q.copy()
    q[0] += 1.0
    there = judge(actions, RobotState(3.0, q, begin.v), layout="wbc32")
    assert (there.verdict, there.start_m) == ("feasible", pytest.approx(0.0, abs=2e-3))


@pytest.mark.parametrize(
    ("actions", "how", "error", "says"),
    [
        (np.zeros((5, 32)), {}, InputError, "say what its numbers are with layout=NAME, one of wbc32"),
        (np.zeros((5, 31)), {"layout": "wbc32"}, ChunkError, r"have shape \(5, 31\); 'wbc32' has \(steps, 32\)"),
        (np.zeros(32), {"layout": "wbc32"}, ChunkError, r"shape \(32,\)"),
        ("abc", {"layout": "wbc32"}, InputError, "is no array"),
        (np.full((5, 32), np.nan), {"layout": "wbc32"}, ChunkError, "not finite"),
        (np.zeros((5, 28)), {"layout": "joint29"}, ChunkError, "joint29"),
        (np.zeros((5, 28)), {"layout": "joint82"}, SpecError, "did you mean 'joint29'"),
        (sent(), {"layout": "wbc32"}, InputError, "has both already"),
        (np.rad2deg(numbers("joint28")), {"layout": "joint28"}, FileFormatError, "degrees"),
    ],
)
@pytest.mark.parametrize("ask", [judge, repair])
def test_what_is_no_chunk_is_refused_with_what_would_work(ask, actions, how, error, says):
    with pytest.raises(error, match=says):
        ask(actions, **how)


@pytest.mark.parametrize("layout", ["wbc32", "joint28"])
def test_a_repair_comes_back_in_the_numbers_that_it_came_as(layout):
    change = repair(numbers(layout), layout=layout, fps=300)
    assert change.slower > 1.1
    assert change.actions.shape[1] == builtin(layout).dim
    assert judge(change.actions, layout=layout, fps=300).verdict == "feasible"


def test_what_is_feasible_comes_back_as_it_is_and_what_cannot_be_done_not_at_all():
    chunk = sent()
    change = repair(chunk)
    assert (change.slower, change.actions) == (1.0, None)
    assert np.array_equal(change.chunk.T_world_lhand, chunk.T_world_lhand)
    assert repair(sent(to=(1.5, 0.0, 0.0))) is None


@pytest.mark.parametrize(
    ("number", "value"), [(18, 1.5), (23, 0.1), (24, 0.3)], ids=["closing of 1.5", "base height", "base velocity"]
)
def test_what_is_clipped_or_not_followed_is_not_done_as_given(number, value):
    """A gripper at -1 and a base that was to walk were "done as given", with a note in the JSON."""
    actions = numbers("wbc27")
    assert judge(actions, layout="wbc27").verdict == "feasible"
    actions[20:, number] += value
    verdict = judge(decode(builtin("wbc27"), actions, STANCE))
    assert (verdict.verdict, verdict.violations[0].code) == ("feasible_after_repair", "changed_numbers")
    assert verdict.headline.startswith("done, but ")
    assert verdict.violations[0].subject[:30] in verdict.headline


def test_an_array_file_is_played_in_the_layout_that_is_said(tmp_path):
    actions = numbers("wbc32")
    np.save(tmp_path / "mine.npy", actions)
    policy = open_recording(tmp_path / "mine.npy", assume=builtin("wbc32"), fps=20.0)
    assert (policy.episode.fps, policy.episode.notes) == (20.0, ())
    assumed = open_recording(tmp_path / "mine.npy", assume=builtin("wbc32")).episode
    assert assumed.notes == ("the array does not say its rate: 30 Hz of the layout 'wbc32' assumed; say --fps",)


@pytest.mark.parametrize(
    ("values", "layout", "says"),
    [
        (np.zeros((5, 32)), None, "what its numbers are is not said: say --layout NAME, as wide: wbc32"),
        (np.zeros((5, 28)), "wbc32", "'wbc32' has 32: say --layout NAME, as wide: .*joint28"),
        (np.zeros((5, 77)), None, "none that ships is so wide"),
        (np.zeros((0, 32)), "wbc32", r"\(steps, width\)"),
        (np.zeros(32), "wbc32", r"has the shape \(32,\)"),
        (np.array(["a"]), "wbc32", "numbers"),
        (np.array([{}], dtype=object), "wbc32", "never unpickled"),
        (b"not an array", "wbc32", "is no .npy file"),
        (b"\x93NUMPY\x01\x00\xff\xff", "wbc32", "is no .npy file|bytes"),
    ],
)
def test_an_array_file_that_is_none_is_refused(tmp_path, values, layout, says):
    path = tmp_path / "x.npy"
    if isinstance(values, bytes):
        path.write_bytes(values)
    else:
        np.save(path, values, allow_pickle=True)
    with pytest.raises(FileFormatError, match=says):
        read_array_file(path, layout and builtin(layout))
