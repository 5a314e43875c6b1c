"""Strategy: one chunk that is too fast is run, asked why and written as a page; the page is read back as data and held
against the recording of the same run. A minute's page is made of the same recording, repeated."""

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models.conversion import Conversion
from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio, palm_frame_ids
from policy.recorded.replay import open_recording
from tests.support.pages import chunk_file, contents
from wholebody.episode.run import EpisodeConfig
from wholebody.errors import InputError
from wholebody.sim.record import PERIODS, Record
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.page import reporting
from wholebody.verdict.page.index import ranked, write_index
from wholebody.verdict.page.page import page, write_page
from wholebody.verdict.verdict import Verdict

FLOATS = ("T_world_palms_measured", "T_world_palms_commanded", "torque_asked", "com", "pressure", "capture_point")
MINUTE, SIZE_MAX = 60.0, 6e6
"""Length of a run [s] and largest page of it [bytes]."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The verdict on a chunk that is too fast, what its page was made of, and the page."""
    folder, kept = tmp_path_factory.mktemp("page"), []
    policy = open_recording(str(chunk_file(folder, "too_fast")))
    checker = Checker(episode=EpisodeConfig(hold=0.5, begin=FastChecker().first_state(policy)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reporting, "write_page", lambda path, shown: (kept.append(shown), write_page(path, shown)))
        run = reporting.simulated(checker, policy, "<too> fast", policy.duration)
        verdict = reporting.write_report(checker, run, folder / "a.html", "wholebody check")
    return verdict, kept[0], (folder / "a.html").read_text()


def test_a_page_has_no_address_in_it_and_nothing_of_a_name_becomes_markup(made):
    _, _, text = made
    assert "://" not in text
    assert "src=" not in text
    assert "<too>" not in text
    assert "&lt;too&gt;" in text


def test_a_page_tells_the_answer_the_cause_and_what_would_do(made):
    verdict, _, text = made
    about, _ = contents(text)
    assert about["verdict"] == verdict.verdict == "infeasible"
    assert verdict.causes
    for told, one in zip(about["causes"], verdict.causes, strict=True):
        assert (told["time"], told["sentence"]) == (one.time, one.sentence)
    assert "times slower" in about["would"][0]
    assert [one["time"] for one in about["violations"]] == [one.time for one in verdict.violations]
    assert about["command"] == "wholebody check"
    assert about["versions"].keys() >= {"python", "mujoco", "g1-wholebody", "k3d"}
    assert about["config"] == json.loads(json.dumps(verdict.config))
    assert about["changed"] == {}


def test_its_poses_are_those_of_the_run(made):
    _, shown, text = made
    _, arrays = contents(text)
    # A page counts from the first row of the input, the recording from its own beginning.
    assert arrays["time"][0] < 0.0
    rows = np.searchsorted(shown.record["time"], arrays["time"] + shown.since - 1e-4)
    model = load_mujoco(shown.spec, visuals=True)
    conversion = Conversion(shown.spec, load_pinocchio(shown.spec), model)
    np.testing.assert_allclose(arrays["qpos"][:, conversion.qpos_index], shown.record["q"][rows], atol=1e-6)
    np.testing.assert_allclose(arrays["asked"], shown.record["T_world_palms_asked"][rows][..., :3, 3], atol=1e-6)
    assert np.diff(arrays["time"]).max() < 0.05


def test_its_time_lines_have_the_worst_of_every_margin_with_its_bound(made):
    _, shown, text = made
    about, arrays = contents(text)
    at = {panel["title"].partition(",")[0]: i for i, panel in enumerate(about["panels"])}
    record = shown.record
    assert len(about["panels"]) >= 7
    errors = 1e3 * np.nanmax(record.palm_errors()[:, 0])
    assert np.nanmax(arrays["line 0 0"]) == pytest.approx(errors, rel=1e-5)
    assert about["panels"][0]["bounds"][0][0] == pytest.approx(1e3 * record["palm_bounds"][0])
    # A palm that is far off is drawn where it is, not at the edge of the plot.
    assert about["panels"][0]["knee"] == pytest.approx(1e3 * record["palm_bounds"][1])
    assert about["panels"][0]["most"] is None
    least = arrays[f"line {at['balance']} 1"].min()
    assert least == pytest.approx(1e3 * record["capture_margin"].min(), rel=1e-4)
    for panel in about["panels"]:
        assert panel["bounds"], panel["title"]


def test_the_ghost_is_the_repaired_motion(made):
    _, shown, text = made
    about, arrays = contents(text)
    assert "times slower" in about["repaired"]
    assert arrays["ghost"].shape[1] == arrays["qpos"].shape[1]
    # It comes where the hands are asked to be in the end.
    model = load_pinocchio(shown.spec)
    data = model.createData()
    pin.framesForwardKinematics(model, data, shown.ghost.q[-1])
    palms = [data.oMf[frame].translation for frame in palm_frame_ids(shown.spec, model)]
    np.testing.assert_allclose(palms, shown.record["T_world_palms_asked"][-1][:, :3, 3], atol=0.01)


def test_a_minute_is_at_most_six_megabytes(made):
    _, shown, _ = made
    arrays, n = dict(shown.record.arrays), len(shown.record)
    rows = np.arange(round(MINUTE / np.diff(arrays["time"]).mean())) % n
    arrays |= {name: arrays[name][rows] for name in PERIODS}
    arrays["time"] = np.linspace(0.0, MINUTE, len(rows))
    # Of what repeats itself nothing is left when it is packed: no two moments are alike.
    rng = np.random.default_rng(0)
    arrays |= {name: a + rng.normal(0.0, 1e-4, a.shape) for name, a in arrays.items() if name in ("q", "v", *FLOATS)}
    size = len(page(replace(shown, record=Record(arrays))))
    print(f"a page of a minute has {1e-6 * size:.2f} MB")
    assert size <= SIZE_MAX


def test_a_page_changes_no_answer_of_a_chunk_that_moves_at_once(made, tmp_path):
    policy = open_recording(str(chunk_file(tmp_path, "too_fast")))
    checker = Checker(episode=EpisodeConfig(hold=0.5, begin=FastChecker().first_state(policy)))
    without, _ = checker.check(policy, "it", policy.duration)
    told, _, _ = made
    assert (told.verdict, told.max_m) == (without.verdict, without.max_m)


def test_a_run_of_nothing_has_no_page(made, tmp_path):
    _, shown, _ = made
    with pytest.raises(InputError, match="nothing was run"):
        write_page(tmp_path / "a.html", replace(shown, record=Record({})))


def test_an_index_ranks_falls_first_and_leads_to_the_pages(tmp_path):
    verdicts = [
        Verdict(name="fine", verdict="feasible", fell=False),
        Verdict(name="moved", verdict="infeasible", fell=False, moved_max_m=0.1),
        Verdict(name="bent", verdict="feasible_after_repair", fell=False, moved_max_m=0.03),
        Verdict(name="<fell>", verdict="infeasible", fell=True),
    ]
    assert [one.name for one in ranked(verdicts)] == ["<fell>", "moved", "bent", "fine"]
    write_index(tmp_path / "index.html", verdicts, {"moved": "index/0001_moved.html"}, ["<no>.npz"])
    text = (tmp_path / "index.html").read_text()
    assert f"{len(verdicts) + 1} inputs: " in text
    assert "1 not judged" in text
    assert "&lt;no&gt;.npz" in text
    assert 'href="index/0001_moved.html"' in text
    assert "&lt;fell&gt;" in text
    assert "2 infeasible, 1 feasible after repair, 1 feasible" in text
