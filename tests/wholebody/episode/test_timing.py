"""Strategy: episode results made by hand, the numbers and the line that come of them; the flags of `run`."""

import json

import jsonschema
import numpy as np
import pytest

from policy.executor.report import Delivery, ExecutionReport
from tests.support.commands import wholebody
from wholebody.episode.chunk_seams import ChunkSeam
from wholebody.episode.result import EpisodeResult
from wholebody.episode.timing import Timing, timing
from wholebody.resources import verdict_schema


def result():
    report = ExecutionReport(waited=0.1, starved=0.25, starvations=2)
    for i, latency in enumerate((0.1, 0.2, 0.35)):
        report.deliveries.append(Delivery(i, float(i), i + latency, i + latency, 3))
    seams = [ChunkSeam(0.1, 1e-4, 2e-3, 0.01, 0.02), ChunkSeam(1.1, 3e-4, 1e-3, 0.005, 0.04)]
    return EpisodeResult(execution=report, seams=seams, executed=3)


def test_an_episode_is_summed_up_by_its_worst_seam_and_its_latencies():
    numbers = timing(result())
    assert numbers.chunks == 3
    assert (numbers.latency_median_s, numbers.latency_max_s) == pytest.approx((0.2, 0.35))
    assert (numbers.starved_s, numbers.starvations, numbers.waited_s) == (0.25, 2, 0.1)
    assert (numbers.seam_m, numbers.seam_rad, numbers.seam_m_s, numbers.seam_rad_s) == (3e-4, 2e-3, 0.01, 0.04)


def test_the_line_for_people_has_millimetres_degrees_and_metres_a_second():
    assert timing(result()).text() == (
        "3 executed, latency 200 ms median, 350 ms at most, starved 2 times, 0.25 s; "
        "seam 0.300 mm, 0.115 deg, 0.0100 m/s"
    )
    assert Timing(chunks=1).text() == "1 executed; seam 0.000 mm, 0.000 deg, 0.0000 m/s"


def test_an_episode_without_chunks_has_numbers_too():
    assert timing(EpisodeResult()) == Timing()
    assert timing(EpisodeResult(execution=ExecutionReport())) == Timing()


def test_a_chunk_whose_plan_never_took_over_was_not_executed():
    """`nothing of it was executed` was said, and `1 executed`."""
    answer = wholebody("run", "reach", "--duration", "0.1", "--hold", "0")
    assert answer.returncode == 1
    assert "nothing of it was executed" in answer.stdout
    assert "0 executed" in answer.stdout


def test_run_takes_a_latency_and_says_what_came_of_it():
    answer = wholebody(
        *("run", "wave", "--duration", "0.4", "--hold", "0.0", "--latency-ms", "10", "50", "--replace-every", "5"),
        *("--ensemble", "0.01", "--json", "-"),
    )
    assert answer.returncode == 0, answer.stderr
    verdicts = json.loads(answer.stdout)
    jsonschema.validate(verdicts, json.loads(verdict_schema().read_text()))
    numbers = verdicts[0]["timing"]
    assert numbers["chunks"] >= 2
    assert 0.01 <= numbers["latency_median_s"] <= numbers["latency_max_s"] <= 0.05
    assert np.rad2deg(numbers["seam_rad"]) < 0.1


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--latency-ms", "300", "100"), "0 <= low <= high"),
        (("--replace-every", "0"), "replace_every is 0; at least 1"),
        (("--ensemble", "nan"), "decay is nan"),
        (("--real-time-chunking",), "infer_after"),
    ],
)
def test_flags_that_make_no_sense_end_with_one_sentence_and_code_2(arguments, complaint):
    answer = wholebody("run", "wave", *arguments)
    assert answer.returncode == 2
    assert complaint in answer.stderr
    assert answer.stderr.count("\n") == 1
