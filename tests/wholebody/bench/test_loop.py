"""Strategy: a fraction of a second of it, and one whole run for memory; times are only looked at for shape."""

from wholebody.bench.loop import bench_loop, bench_memory


def test_a_short_run_says_what_the_parts_take():
    result = bench_loop("wave", 0.1)
    assert result["ticks"] == 50
    assert result["plan_ms"] > 0.0
    assert result["real_time"]["mean"] > 0.0
    for part in ("controller_us", "plant_us", "physics_us"):
        assert 0.0 < result[part]["min"] <= result[part]["p50"] <= result[part]["p99"]


def test_memory_is_that_of_the_process_after_whole_runs():
    result = bench_memory("wave", 1)
    assert result["runs"] == 1
    assert result["ticks"] > 1000
    assert 50.0 < result["first_mb"] == result["last_mb"] < 5000.0
