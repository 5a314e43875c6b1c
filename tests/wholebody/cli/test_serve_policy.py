"""`wholebody serve-policy` and a run against it, in processes of their own."""

import json
import signal
import subprocess
import sys
from contextlib import contextmanager
from functools import partial
from types import SimpleNamespace

import pytest

from policy.remote.client import RemotePolicy
from policy.scripted.library import scripted_policy
from tests.support.policy_cases import observation
from wholebody.cli.sources import length

CODE = "from wholebody.cli.main import main; main()"


def command(*arguments):
    return [sys.executable, "-c", CODE, *arguments]


@contextmanager
def serving(*arguments, ending=signal.SIGINT):
    """Address and process of a server."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    # A shell that starts the tests in the background makes their children deaf to Ctrl-C.
    heedful = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler); {CODE}"
    call = [sys.executable, "-c", heedful, "serve-policy", *arguments, "--port", "0"]
    with subprocess.Popen(call, text=True, **pipes) as process:
        try:
            line = process.stdout.readline()
            assert line, process.stderr.read()
            yield line, process
        finally:
            process.send_signal(ending)
            try:
                process.wait(timeout=30)
            finally:
                process.kill()


def test_a_served_policy_is_announced_used_from_another_process_and_ended_by_ctrl_c():
    with serving("wave") as (line, process):
        assert line.startswith(f"serving 'wave' ({scripted_policy('wave').spec.id}) at ws://127.0.0.1:")
        uri = line.split()[-1]
        policy, local = RemotePolicy.connect(uri), scripted_policy("wave")
        local.reset()
        for k in range(2):
            chunk, expected = policy.infer(observation(0.5 * k)), local.infer(observation(0.5 * k))
            assert all(chunk.arrays()[name].tobytes() == value.tobytes() for name, value in expected.arrays().items())
        policy.close()
        run = command("run", uri, "--duration", "0.2", "--hold", "0.2", "--json", "-")
        done = subprocess.run(run, capture_output=True, text=True, timeout=1000, check=False)
        assert done.returncode == 0, done.stderr
        (verdict,) = json.loads(done.stdout)
        assert (verdict["name"], verdict["fell"]) == (uri, False)
    assert process.returncode == 0


def test_serving_to_every_network_is_possible_and_warned_of():
    with serving("wave", "--host", "0.0.0.0", ending=signal.SIGTERM) as (line, process):
        assert "ws://127.0.0.1:" in line
        assert "everyone who reaches 0.0.0.0 can use the policy" in process.stderr.readline()
    assert process.returncode == 0, "a container's stop ends it as Ctrl-C does"


def test_a_policy_without_an_end_needs_a_duration():
    with pytest.raises(ValueError, match="say how long with --duration SECONDS"):
        length(SimpleNamespace(duration=None), 0.0)
    assert length(SimpleNamespace(duration=None), 2.0) == 2.0
    assert length(SimpleNamespace(duration=9.0), 0.0) == 9.0


def test_a_server_that_is_not_there_ends_with_a_sentence_and_code_2(inside, monkeypatch):
    monkeypatch.setattr(RemotePolicy, "connect", partial(RemotePolicy.connect, connect_timeout=0.3))
    done = inside("run", "ws://127.0.0.1:1")
    assert done.returncode == 2
    assert "no server listens there; start the server" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("serve-policy", "waev"), "no script is called 'waev'; did you mean 'wave'?"),
        (("serve-policy", "wave", "--host", "256.0.0.1"), "wholebody: "),
    ],
)
def test_misuse_ends_with_a_sentence_and_code_2(inside, arguments, complaint):
    done = inside(*arguments)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert "Traceback" not in done.stderr
