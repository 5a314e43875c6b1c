"""The command `wholebody` in the process of the tests."""

import sys
from types import SimpleNamespace

import pytest

from wholebody.cli import main as cli


@pytest.fixture
def inside(monkeypatch, capsys):
    """Exit code and output of a command, for what ends before a simulation begins."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["wholebody", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        said = capsys.readouterr()
        return SimpleNamespace(returncode=end.value.code, stdout=said.out, stderr=said.err)

    return call
