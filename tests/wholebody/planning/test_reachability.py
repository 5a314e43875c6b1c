"""Strategy: the map that is shipped is held against what the search for postures found for pairs drawn apart from it.

Those are kept with the studies, and some of them are searched for anew. A map that lies shows that a wrong one costs
time, and no chunk its verdict.
"""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from models import g1
from tests.support.reachability_agreement import KEPT
from tests.support.sent_chunks import sent
from wholebody.cli.main import app
from wholebody.config import ControllerConfig
from wholebody.errors import InputError
from wholebody.planning.posture import STARTS_MAX, PostureSolver
from wholebody.planning.reachability.compute import Samples, compute, logits, search
from wholebody.planning.reachability.pairs import MIRROR, PALM_AT_REST, TURNS, Pairs, Turn, draw
from wholebody.planning.reachability.picture import outline
from wholebody.planning.reachability.reach_map import ODDS_SURE, SHIPPED, ReachabilityMap, basis, reachability
from wholebody.verdict.fast import FastChecker

SPEC, CONFIG = g1(), ControllerConfig()
BASIS = basis(SPEC, CONFIG)
SIZE_MAX, QUERIES = 2_000_000, 500
"""Bar for the map's file [bytes], and questions asked to time one."""
QUERY_SHARE = 0.25
"""Largest CPU time of a compiled question, as a share of plain numpy's for the same pair; measured 0.06 to 0.10 on idle
and loaded machines."""
AGREEMENT, AGREEMENT_SURE = 0.975, 0.99
"""Least share of pairs of which the map says what the search does: of all, and of those with odds of 7 or more."""


@pytest.fixture(scope="module")
def kept():
    return Samples(KEPT, BASIS)


@pytest.fixture(scope="module")
def solver():
    return PostureSolver(SPEC, CONFIG)


def test_the_shipped_map_is_small_and_of_the_default_settings():
    assert SHIPPED.stat().st_size <= SIZE_MAX
    assert reachability().card["basis"] == BASIS


def test_the_map_says_what_the_search_says_of_pairs_drawn_apart_from_it(kept):
    rooms, sure = reachability().rooms(kept.pairs), 2.0
    agrees = (rooms > 0.0) == kept.held
    assert len(kept.held) == 2000
    assert agrees.mean() >= AGREEMENT
    assert agrees[np.abs(rooms) > sure].mean() >= AGREEMENT_SURE
    assert rooms[kept.held].min() > -ODDS_SURE


def test_what_is_kept_of_the_search_is_what_it_finds_now(kept, solver):
    held, missed = np.flatnonzero(kept.held)[:12], np.flatnonzero(~kept.held)[:3]
    for chosen, found in ((held, True), (missed, False)):
        assert (search(solver, kept.pairs[chosen], STARTS_MAX, np.inf) == 0.0).tolist() == [found] * len(chosen)


def test_missed_by_nothing_is_what_solve_calls_reached(kept, solver):
    turned = np.flatnonzero((kept.pairs.turns != TURNS.index(Turn.ANY)) & (kept.pairs.loads.max(axis=1) == 0.0))
    solver.body.carry((0.0, 0.0))
    for i in (*turned[kept.held[turned]][:8], *turned[~kept.held[turned]][:3]):
        wrists = kept.pairs.poses(i)
        for T, tool in zip(wrists, SPEC.tools, strict=True):
            T[:3, 3] -= T[:3, :3] @ tool.palm_offset
        assert solver.solve(*wrists).reached == kept.held[i]


def test_a_compiled_question_takes_a_small_share_of_what_numpy_takes():
    """In CPU time of the thread, in turns; docs/reachability.md has the absolute time."""
    one, left, right = reachability(), (0.3, 0.2, 0.8), (0.3, -0.2, 0.8)
    pair = Pairs(np.array([[left, right]]), np.array([TURNS.index(Turn.ANY)]), np.zeros((1, 2)))
    compiled, plain = (lambda: one.room(left, right)), (lambda: logits(one.network, pair))
    assert compiled() == pytest.approx(plain()[0], abs=1e-4)
    shares = []
    for _ in range(5):
        seconds = []
        for question in (compiled, plain):
            begin = time.thread_time()
            for _ in range(QUERIES):
                question()
            seconds.append(time.thread_time() - begin)
        shares.append(seconds[0] / seconds[1])
    print("shares:", shares)
    assert min(shares) <= QUERY_SHARE, shares


def test_one_pair_many_pairs_and_plain_numpy_say_the_same_and_sides_do_not_matter():
    told, pairs = reachability(), draw(200, np.random.default_rng(3))
    rooms = told.rooms(pairs)
    one = [
        told.room(*p, TURNS[turn], tuple(m)) for p, turn, m in zip(pairs.points, pairs.turns, pairs.loads, strict=True)
    ]
    assert np.allclose(rooms, one, atol=1e-5)
    assert np.allclose(rooms, logits(told.network, pairs), atol=1e-4)
    assert np.allclose(rooms, told.rooms(pairs.mirrored()), atol=1e-4)
    assert told.knows(pairs).all()


def test_threads_that_ask_at_once_get_what_one_gets():
    told, pairs = reachability(), draw(20_000, np.random.default_rng(4))
    alone = told.rooms(pairs)
    with ThreadPoolExecutor(4) as threads:
        assert all(np.array_equal(found, alone) for found in threads.map(told.rooms, [pairs] * 8))


def test_palms_at_rest_are_held_and_palms_above_the_head_or_in_one_place_are_not():
    told, right = reachability(), PALM_AT_REST @ MIRROR
    assert told.room(PALM_AT_REST, right, "facing") > 0.0
    assert told.room(right, right) < -2.0
    assert told.room((0.3, 0.2, 1.74), right, "facing") < -ODDS_SURE
    assert told.room((0.74, 0.74, 1.7), (0.74, -0.74, 0.1)) < -ODDS_SURE
    with pytest.raises(InputError, match=r"'sideways'.*facing, down, up, hanging, any"):
        told.room(PALM_AT_REST, right, "sideways")


@pytest.mark.parametrize(
    ("left", "loads", "said"),
    [
        ((np.nan, 0.2, 0.8), (0.0, 0.0), "finite"),
        ((0.3, 0.2, 0.8), (np.nan, 0.0), "finite"),
        ((0.3, 0.2, 0.8), (-1.0, 0.0), "not negative"),
        ((0.3, 0.2), (0.0, 0.0), "two points"),
        ("abc", (0.0, 0.0), "finite|two points"),
    ],
)
def test_what_is_no_point_or_mass_is_refused(left, loads, said):
    with pytest.raises(InputError, match=said):
        reachability().room(left, (0.3, -0.2, 0.8), "any", loads)
    pairs = draw(3, np.random.default_rng(0))
    pairs.loads[1, 0] = -1.0
    with pytest.raises(InputError, match="not negative"):
        reachability().rooms(pairs)


def test_a_file_that_is_no_map_is_neither_read_nor_written_over(tmp_path):
    file = tmp_path / "chunk.npz"
    file.write_bytes(b"no zip")
    with pytest.raises(InputError, match="no map of reachability"):
        ReachabilityMap.read(file)
    np.savez(file, actions=np.zeros(3))
    before = file.read_bytes()
    result = CliRunner().invoke(app, ["reachability", str(file)])
    assert isinstance(result.exception, InputError)
    assert file.read_bytes() == before


def test_other_bounds_are_refused_and_the_error_says_what_would_do():
    tighter = replace(CONFIG, planner=replace(CONFIG.planner, posture=replace(CONFIG.planner.posture, torso_tilt=0.5)))
    with pytest.raises(InputError, match="--config FILE"):
        reachability(tighter)
    comfort = replace(CONFIG, planner=replace(CONFIG.planner, posture=replace(CONFIG.planner.posture, torso=0.7)))
    assert reachability(comfort).card["basis"] == BASIS


def test_a_computation_goes_on_where_one_ended_and_a_map_is_read_as_written(tmp_path):
    path, told = tmp_path / "map.pairs.npz", []
    compute(SPEC, CONFIG, Samples(path, BASIS), 1e-3, told.append, at_once=6)
    first = Samples(path, BASIS)
    network = compute(SPEC, CONFIG, Samples(path, BASIS), first.spent + 1e-3, told.append, at_once=6)
    second = Samples(path, BASIS)
    assert [line.partition(" pairs")[0] for line in told[::2]] == ["6", "12"]
    assert len(second.missed) == 12
    assert np.array_equal(second.pairs.points[:6], first.pairs.points)
    with pytest.raises(InputError, match="another robot or other bounds"):
        Samples(path, "other")
    written = ReachabilityMap(network, second.card())
    written.write(tmp_path / "map.npz")
    read, pairs = ReachabilityMap.read(tmp_path / "map.npz"), draw(5, np.random.default_rng(0))
    assert np.array_equal(read.rooms(pairs), written.rooms(pairs))
    with pytest.raises(InputError, match="no map of reachability"):
        ReachabilityMap.read(path)


def test_a_map_that_lies_takes_no_verdict_from_a_chunk():
    honest, deceived = FastChecker(), FastChecker()
    network = reachability().network
    lying = ReachabilityMap((*network[:-1], network[-1] - 100.0), reachability().card)
    vars(deceived.judge.planner)["map"] = lying
    for chunk, decided_by in ((sent(), "plan"), (sent(to=(0.0, 0.5, 0.8)), "plan")):
        begin = honest.judge.first_pose(chunk)
        true, told = (one.of_chunk(chunk, begin, "", (False, False)) for one in (honest, deceived))
        assert told.verdict == true.verdict
        assert told.decided_by == decided_by


@pytest.mark.regression
def test_a_picture_of_the_map_is_drawn_by_the_command(tmp_path):
    done = CliRunner().invoke(app, ["reachability", "--sheet", str(tmp_path / "map.png")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_behind_the_map_is_the_robot_in_its_stance():
    points = np.concatenate(outline(g1()))
    low, high = points.min(axis=0), points.max(axis=0)
    assert 0.0 < low[2] < 0.05  # soles are balls, which have no corners
    assert 1.2 < high[2] < 1.4
    assert high[1] == pytest.approx(-low[1], abs=0.02)
    assert 0.3 < high[0] < 0.45  # fingers, ahead of the forearms
