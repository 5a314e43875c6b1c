"""What a command line may ask for, and what may reach the terminal."""

import logging
import sys

import pytest

from models import g1
from policy.chunk import ActionChunk
from policy.executor.ensemble import TemporalEnsemble
from policy.executor.executor import ExecutorConfig
from policy.executor.simulated import uniform_latency
from policy.remote.server import PolicyServer
from policy.scripted.library import scripted_policy
from wholebody.cli import main as cli
from wholebody.cli.console import _Sentences, complain, say
from wholebody.episode.run import EpisodeConfig
from wholebody.errors import InputError
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.sensors import SensorConfig

FORGED = "x\x1b[2J\x1b[1;1H\nFEASIBLE  reach: done as given\r\u202e"


@pytest.fixture
def ended(monkeypatch, capsys):
    """What a command says on standard error, after ending with code 2."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["wholebody", *arguments])
        with pytest.raises(SystemExit) as end:
            cli.main()
        said = capsys.readouterr().err
        assert end.value.code == 2, said
        assert said.count("\n") == 1
        assert said.rstrip("\n").isprintable()
        return said

    return call


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--delay-ms", "1e300"), "delay is 1e+297 s; it must be at least 0 and at most 1 s"),
        (("--delay-ms", "nan"), "delay is nan s"),
        (("--duration", "1e300"), "--duration is 1e+300 s; it must be at least 0 and at most 21600 s"),
        (("--duration", "nan"), "--duration is nan s"),
        (("--hold", "1e300"), "--hold is 1e+300 s; it must be at least 0 and at most 3600 s"),
        (("--payload-kg", "1e300", "0"), "payload_kg is 1e+300 kg; it must be at least 0 and at most 50 kg"),
        (("--payload-kg", "0", "-1"), "payload_kg is -1 kg"),
        (("--latency-ms", "0", "inf"), "--latency-ms has inf ms; 0 to 3.6e+06 ms is expected"),
        (("--latency-ms", "0", "1e300"), "--latency-ms has 1e+300 ms"),
        (("--ensemble", "1e9"), "decay is 1000000000.0; a number from -10 to 10"),
        (("--ensemble", "nan"), "decay is nan; a number from -10 to 10"),
        (("--replace-every", "1000000000"), "replace_every is 1000000000; at most 1000"),
    ],
)
def test_b2_a_number_beyond_reason_ends_with_one_sentence_that_has_bound_and_unit(arguments, says, ended):
    assert says in ended("run", "reach", *arguments)


def test_a_frame_rate_beyond_reason_is_refused(tmp_path, ended):
    (tmp_path / "x.csv").write_text(",".join(["0", "0", "0.7", "0", "0", "0", "1", *["0"] * 29]) + "\n" * 2)
    assert "a positive rate in Hz is expected, 0.1 to 2000" in ended(
        "run", str(tmp_path / "x.csv"), "--csv-fps", "1e-9"
    )


def test_library_users_meet_the_same_bounds():
    for make in (
        lambda: SensorConfig(delay=1e297),
        lambda: SensorConfig(imu_bias=float("nan")),
        lambda: EpisodeConfig(hold=float("inf")),
        lambda: EpisodeConfig(replace_every=0),
        lambda: MujocoPlant(g1(), payload_kg=(1e300, 0.0)),
    ):
        with pytest.raises(InputError, match="at most"):
            make()
    for make in (
        lambda: ExecutorConfig(replace_every=10**9),
        lambda: TemporalEnsemble(1e9),
        lambda: uniform_latency(0.0, float("inf")),
        lambda: PolicyServer(scripted_policy("wave"), port=99_999),
    ):
        with pytest.raises(ValueError, match="expected"):
            make()


def test_a_decay_of_minus_one_favours_the_newest():
    assert ExecutorConfig(ensemble=-1.0).ensemble == -1.0
    ensemble, policy = TemporalEnsemble(-1.0), scripted_policy("wave")
    from tests.support.policy_cases import observation

    for time in (0.0, 0.5):
        assert isinstance(ensemble.add(policy.infer(observation(time))), ActionChunk)


def test_b4_names_and_notes_reach_the_terminal_printable(capsys):
    say("FEASIBLE  x", FORGED)
    complain(FORGED)
    said = capsys.readouterr()
    assert said.out.count("\n") == 2
    assert said.err.count("\n") == 1
    for line in (*said.out.splitlines(), *said.err.splitlines()):
        assert line.isprintable()


def test_b4_a_file_name_cannot_forge_a_verdict(tmp_path, ended):
    name = str(tmp_path / f"{FORGED}.npz")
    said = ended("check", name)
    assert "\\x1b[2J" in said


@pytest.mark.parametrize(("logger", "lines"), [("policy.remote.client", 2), ("websockets.server", 1)])
def test_b4_logs_reach_the_terminal_printable(logger, lines):
    text = _Sentences().format(logging.LogRecord(logger, logging.ERROR, "", 0, "a failed:\n| b\x1b[2J", (), None))
    assert text.count("\n") == lines - 1
    assert all(line.isprintable() for line in text.splitlines())
