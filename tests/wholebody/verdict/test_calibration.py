"""Strategy: probabilities that are known by construction, files that are none, and chunks whose fate is plain."""

import json
from pathlib import Path

import numpy as np
import pytest

from policy.recorded.replay import ReplayPolicy
from policy.scripted.library import scripted_policy
from tests.support.calibration_fit import alarm_bound, as_arrays, calibration_error, fit_calibration, grow
from tests.support.hostile_chunks import hostile_chunk
from tests.support.outcome_cases import JOINTS, KINDS, MOVING, SWINGING, Case, outcome_case
from tests.support.outcome_runs import run_case
from tests.support.sent_chunks import sent
from wholebody.config import ControllerConfig
from wholebody.errors import InputError
from wholebody.types import RobotState
from wholebody.verdict.calibration.model import SHIPPED, Calibration, shipped
from wholebody.verdict.calibration.quantities import quantities
from wholebody.verdict.calibration.rollout import STANDING_WELL, Rollout
from wholebody.verdict.calibration.trees import Trees
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.report import lines

CHUNKS = 2400
HANDFUL = Path(__file__).parents[2] / "studies" / "stored" / "calibration.json"


def made_up(n, seed):
    """Quantities of n chunks, three a group, the odds of both answers linear in the first two; the third is noise."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(n, 3))
    p = 1.0 / (1.0 + np.exp(np.array([-2.0 * x[:, 0] + 1.0, x[:, 0] + 1.5 * x[:, 1]])))
    found = [dict(zip("abc", row, strict=True)) for row in x.tolist()]
    return found, (rng.random(p.shape) < p).astype(float), [f"{i // 3}" for i in range(n)], p


@pytest.fixture(scope="module")
def small():
    found, answers, groups, _ = made_up(CHUNKS, 1)
    return fit_calibration(found, ["true"] * len(found), answers, groups, repeats=12)


def test_probabilities_that_are_known_are_found_again_and_the_interval_has_them(small):
    model, _ = small
    found, answers, _, p = made_up(3000, 2)
    draws = model.draws(model.rows(found, "true"))
    told = draws.mean(axis=1)
    assert np.abs(told - p).mean() < 0.05
    for k in (0, 1):
        assert calibration_error(told[k], answers[k]) < 0.05
    low, high = np.quantile(draws, (0.05, 0.95), axis=1)
    assert ((p > low - 0.03) & (p < high + 0.03)).mean() > 0.8


def test_trees_say_what_the_library_that_grew_them_says():
    found, answers, _, _ = made_up(300, 4)
    x, y = np.array([list(one.values()) for one in found]), answers[0]
    models = [grow(x, one, np.ones(len(y)), 30) for one in answers]
    parts = [np.array([[arrays[k]] for arrays in map(as_arrays, models)]) for k in range(3)]
    told = Trees(*parts).probabilities(x.astype(np.float32))
    for k, model in enumerate(models):
        assert np.abs(told[k, 0] - model.predict_proba(x)[:, 1]).max() < 1e-9


def test_what_groups_left_out_are_told_is_calibrated_too(small):
    _, held = small
    _, answers, _, p = made_up(CHUNKS, 1)
    assert np.abs(held - p).mean() < 0.08
    assert calibration_error(held[0], answers[0]) < 0.08


def test_an_alarm_misses_no_more_falls_than_it_promises_and_too_few_falls_promise_nothing():
    rng = np.random.default_rng(0)
    missed = [(rng.random(500) < alarm_bound(rng.random(300), 0.02)).mean() for _ in range(300)]
    assert 0.01 < np.mean(missed) < 0.02 + 0.002
    assert alarm_bound(rng.random(98)) == 0.0
    assert alarm_bound(rng.random(99)) > 0.0


def test_no_probability_is_surer_than_so_many_chunks_can_make_it_and_none_is_past_its_interval(small):
    model, _ = small
    told = model.odds([(0.0, {"a": 1e6, "b": -1e6, "c": 0.0})], world="true")
    for chance in (told.fall_as_given, told.followed):
        least = 1.0 / (CHUNKS + 2.0)
        assert least <= chance.low <= chance.p <= chance.high <= 1.0 - least
    leaf = np.zeros_like(model.trees.leaf)
    leaf[:, :, 0] = -9.0
    leaf[:, 0, 0] = 9.0
    one_apart = Trees(model.trees.quantity, model.trees.bound, leaf)
    told = Calibration(model.names, model.scale, one_apart, model.shape, model.card).odds(
        [(0.0, {"a": 0.0, "b": 0.0, "c": 0.0})], world="true"
    )
    assert told.fall_as_given.low <= told.fall_as_given.p <= told.fall_as_given.high


def test_an_alarm_that_would_go_off_for_most_chunks_is_none(small):
    model, held = small
    _, answers, groups, _ = made_up(CHUNKS, 1)
    bound, stood = model.card["alarm_bound"], answers[0] < 0.5
    assert bound == alarm_bound(held[0][~stood]) > 0.0
    assert model.card["alarm"] == (bound if (held[0][stood] >= bound).mean() <= 0.5 else 0.0)
    found, n = [{"a": x} for x in np.random.default_rng(0).normal(size=CHUNKS)], len(groups)
    answers = (np.random.default_rng(1).random((2, n)) < 0.4).astype(float)
    blind, _ = fit_calibration(found, ["true"] * n, answers, groups, repeats=2)
    assert blind.card["alarm"] == 0.0
    assert blind.odds([(0.0, {"a": 0.0})], world="true").alarm is None


def test_an_error_of_calibration_is_the_distance_of_bins_from_their_shares():
    p = np.repeat([0.1, 0.9], 50)
    right = np.r_[np.arange(50) < 5, np.arange(50) < 45].astype(float)
    assert calibration_error(p, right, 2) == pytest.approx(0.0, abs=1e-12)
    assert calibration_error(p, 1.0 - right, 2) == pytest.approx(0.8)


def test_what_is_far_from_the_fitted_chunks_is_told_by_name(small):
    model, _ = small
    near, far = {"a": 0.1, "b": -0.2, "c": 0.3}, {"a": 0.1, "b": 1e4, "c": 0.3}
    assert model.unlike(model.rows([near], "true")) == ()
    assert model.unlike(model.rows([near, far], "true")) == ("b",)
    odds = model.odds([(0.0, near), (0.8, far)], ["loads"], "true")
    assert odds.unlike == ("loads", "b")
    assert odds.chunks == 2
    assert model.odds([]) is None


def test_a_file_keeps_the_model_and_what_is_none_is_refused(small, tmp_path):
    model, _ = small
    path = tmp_path / "model.npz"
    model.write(path)
    again, x = Calibration.read(path), model.rows(made_up(50, 3)[0], "true")
    assert np.abs(again.probabilities(x) - model.probabilities(x)).max() < 1e-4
    assert again.card["trees"] == model.card["trees"]
    with np.load(path) as file:
        parts = dict(file)
    card = json.loads(str(parts["card"]))
    wrong = {
        "version": {"card": json.dumps(card | {"version": 99})},
        "alarm": {"card": json.dumps({k: v for k, v in card.items() if k != "alarm"})},
        "no number": {"leaf": np.full_like(parts["leaf"], np.nan)},
        "shape": {"leaf": parts["leaf"][..., :-1]},
        "no quantity": {"quantity": np.full_like(parts["quantity"], 99)},
        "pickled": {"mean": np.array([{}], dtype=object)},
    }
    for name, change in wrong.items():
        np.savez(tmp_path / f"{name}.npz", **(parts | change))
        with pytest.raises(InputError, match="calibration"):
            Calibration.read(tmp_path / f"{name}.npz")
    (tmp_path / "text.npz").write_text("nothing")
    with pytest.raises(InputError, match="calibration"):
        Calibration.read(tmp_path / "text.npz")


def test_the_file_that_is_shipped_is_small_and_tells_what_its_card_tells_of_a_handful():
    assert SHIPPED.stat().st_size <= 300_000
    model, cases = shipped(), json.loads(HANDFUL.read_text())
    assert sum(model.card["families"].values()) == model.card["chunks"]
    assert "recorded" not in model.card["families"]
    told = model.probabilities(model.rows([one["quantities"] for one in cases], [one["world"] for one in cases]))
    assert np.abs(told.T - [one["told"] for one in cases]).max() < 2e-3


def test_a_handful_of_cases_has_the_quantities_that_were_written():
    fast = FastChecker()
    for one in json.loads(HANDFUL.read_text())[:3]:
        case = outcome_case(one["case"])
        if case.family != one["family"]:
            continue
        begin = fast.judge.stance() if case.start == "stance" else fast.judge.first_pose(case.chunk)
        found = quantities(fast.judge, case.chunk, begin, fast.judge.judge(case.chunk, begin))
        for name in ("speed", "high", "reach", "seconds", "push_rms"):
            assert found[name] == pytest.approx(one["quantities"][name], rel=1e-3, abs=1e-4), name


def test_the_fast_check_tells_the_odds_of_what_stands_and_of_what_falls():
    checker = FastChecker()
    plain, begin = sent(to=(0.05, 0.0, 0.05), jump=(0.0, 0.0, 0.0)), checker.judge.stance()
    calm = checker.of_chunk(plain, begin, "calm", (False, False))
    wild = checker.of_chunk(hostile_chunk("box", np.random.default_rng(6), 0, 0.0), begin, "wild", (False, False))
    for verdict in (calm, wild):
        for chance in (verdict.odds.fall_as_given, verdict.odds.followed):
            assert 0.0 <= chance.low <= chance.p <= chance.high <= 1.0
        assert "falls as given" in "\n".join(lines(verdict))
    assert calm.odds.fall_as_given.p < 0.5 < wild.odds.fall_as_given.p
    assert wild.odds.followed.p < 0.5
    policy = ReplayPolicy(plain)
    told = checker.check(policy, "calm", policy.duration).odds
    assert (told.chunks, told.unlike) == (1, calm.odds.unlike)


def test_chunks_that_are_begun_in_motion_are_told_where_none_of_those_fitted_to_was(small):
    model, _ = small
    found = [(0.0, {"a": 0.1, "b": -0.2, "c": 0.3})]
    assert "a start in motion" in model.odds(found, ["a start in motion"], "true").unlike
    model = Calibration(
        model.names, model.scale, model.trees, model.shape, model.card | {"covers": ["a start in motion"]}
    )
    assert model.odds(found, ["a start in motion"], "true").unlike == ()
    told = FastChecker().check(scripted_policy("wave"), "wave", 4.0).odds
    assert told.chunks > 1
    assert ("a start in motion" in told.unlike) == ("a start in motion" not in shipped().card.get("covers", ()))


def test_loads_that_nobody_fitted_are_told():
    checker = FastChecker()
    checker.judge.carry(1.0, 0.0)
    verdict = checker.of_chunk(sent(to=(0.05, 0.0, 0.05)), checker.judge.stance(), "carried", (False, False))
    assert "loads" in verdict.odds.unlike
    assert "a guess" in "\n".join(lines(verdict))


def test_a_chunk_of_one_step_has_all_its_quantities():
    judge, chunk = FastChecker().judge, sent(to=(0.05, 0.0, 0.05))
    one = hostile_chunk("offset", np.random.default_rng(0), 0, 0.0)
    one = type(one)(one.spec_id, 0, 0.0, 30.0, *(value[:1] for value in chunk.arrays().values()))
    begin = judge.stance()
    found = quantities(judge, one, begin, judge.judge(one, begin))
    assert np.isfinite(list(found.values())).all()
    assert found["speed"] == found["acceleration_rms"] == 0.0


def test_a_case_that_is_decided_early_has_the_answer_of_one_that_is_not():
    begin = FastChecker().judge.stance().body
    checker, state = Checker(follow="as_given"), RobotState(0.0, begin.q, begin.v)
    hostile = hostile_chunk("box", np.random.default_rng(6), 0, 0.0)
    for chunk, falls in ((sent(to=(0.1, 0.0, 0.1)), False), (hostile, True)):
        case = Case(0, "", "", "stance", "true", chunk)
        short, whole = (run_case(checker, case, state, whole=one) for one in (False, True))
        assert short.fell == whole.fell == falls
        assert falls or short.rest_s == whole.rest_s < chunk.times[-1] + 2.0
        assert not falls or whole.time - 1.5 < short.time < whole.time


def test_a_chunk_that_comes_in_the_midst_of_another_is_judged_by_what_happens_after_it_came():
    case = outcome_case(MOVING)
    assert case.before is not None
    assert case.chunk.t_obs == case.begins > 0.0
    begin = FastChecker().judge.stance().body
    far = Case(0, "", "", "stance", "true", sent(to=(0.05, 0.0, 0.05)), case.before, 0.5)
    found = run_case(Checker(), far, RobotState(0.0, begin.q, begin.v))
    assert not found.fell
    assert found.worst_m is not None


def test_a_rollout_tells_what_falls_from_what_stands_before_anything_is_simulated():
    judge, rollout = FastChecker().judge, Rollout(ControllerConfig())
    begin, hostile = judge.stance(), hostile_chunk("box", np.random.default_rng(6), 0, 0.0)
    calm, wild = (rollout.quantities(one, begin, (0.0, 0.0)) for one in (sent(to=(0.05, 0.0, 0.05)), hostile))
    assert calm.keys() == wild.keys() == STANDING_WELL.keys()
    assert calm["roll_left"] == calm["roll_no_hands"] == 0.0
    assert calm["roll_capture"] > 0.02
    assert wild["roll_left"] > 0.0
    assert wild["roll_capture"] < -0.05
    assert np.isfinite(list(wild.values())).all()
    # Nothing is kept from one chunk to the next.
    assert rollout.quantities(sent(to=(0.05, 0.0, 0.05)), begin, (0.0, 0.0)) == calm


def test_every_kind_of_case_is_a_valid_chunk_and_the_same_again():
    for number in (*range(2 * len(KINDS)), JOINTS, *range(MOVING, MOVING + 4), *range(SWINGING, SWINGING + 3)):
        case, again = outcome_case(number), outcome_case(number)
        case.chunk.validate()
        assert np.array_equal(case.chunk.T_world_lhand, again.chunk.T_world_lhand)
        assert (case.family, case.group, case.start, case.world) == (
            again.family, again.group, again.start, again.world,
        )  # fmt: skip
    assert len({outcome_case(number).family for number in range(40)}) > 8
