"""``wholebody convert`` on datasets: what it prints, writes and returns."""

import json
import sys

import pytest

from policy.action_spec.builtin import builtin
from tests.support.dataset_cases import LENGTHS, write_v30
from wholebody.cli import main as cli


@pytest.fixture(scope="module")
def joints(tmp_path_factory):
    return write_v30(tmp_path_factory.mktemp("cli") / "joints", cameras=False)


@pytest.fixture
def convert(monkeypatch, capsys):
    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["wholebody", "convert", *[str(argument) for argument in arguments]])
        with pytest.raises(SystemExit) as end:
            cli.main()
        said = capsys.readouterr()
        return end.value.code, said.out, said.err

    return call


def test_the_folder_is_named_after_dataset_and_layout_if_none_is_given(convert, joints):
    code, out, err = convert(joints)
    assert code == 0
    assert all(line.startswith("wholebody: joints: ") for line in err.splitlines())  # how far it is, if it takes long
    assert "simulated" not in err
    folder = joints.with_name("joints_wbc32")
    assert (folder / "meta" / "info.json").exists()
    assert f"3 episodes, {sum(LENGTHS)} frames at 30 Hz to wbc32-v2-" in out
    assert "assumed waist_pitch_joint [rad]: 0.0" in out
    assert "0 of 35 frames not reached" in out
    assert str(folder) in out


def test_with_json_nothing_else_is_printed(convert, joints, tmp_path):
    code, out, _ = convert(joints, tmp_path / "out", "--no-check", "--waist", "0.1", "0", "-0.2", "--json", "-")
    said = json.loads(out)
    assert code == 0
    assert said["assumptions"]["waist_pitch_joint [rad]"] == -0.2
    assert said["frames"] == sum(LENGTHS)


def test_options_reach_the_conversion(convert, joints, tmp_path):
    code, out, _ = convert(
        *(joints, tmp_path / "out", "--to", "wbc27", "--synergy", "dex3_open_close", "--episodes", "1"),
        *("--keep-joints", "--no-check", "--least-range", "0.01", "--json", tmp_path / "report.json"),
    )
    assert code == 0
    assert "1 episodes, 9 frames" in out
    said = json.loads((tmp_path / "report.json").read_text())
    assert said["source"]["episodes"] == [1]
    assert said["assumptions"]["synergy"] == "dex3_open_close"
    info = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())
    assert info["features"]["action"]["shape"] == [27]
    assert info["features"]["source.action"]["shape"] == [28]


def test_a_layout_may_be_a_json_file(convert, joints, tmp_path):
    slots = builtin("wbc32").to_dict()
    slots["slots"][0]["tcp_offset"] = slots["slots"][2]["tcp_offset"] = [0.05, 0.0, 0.0]
    (tmp_path / "tool.json").write_text(json.dumps({**slots, "name": "tool32"}))
    code, out, _ = convert(joints, tmp_path / "out", "--to", tmp_path / "tool.json")
    assert code == 0
    assert "tool32-v2-" in out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--to", "wbc23"), "did you mean"),
        (("--unit", "turns"), "'rad' or 'deg'"),
        (("--synergy", "fist"), "dex3_open_close"),
        (("--episodes", "7"), "no episode 7"),
        (("--episodes", "x"), "such as 0-3,7"),
        (("--assume-spec", "joint16"), "'joint16' has 16"),
        (("--least-range", "-1"), "must be at least 0"),
        (("--json", "/no/such/folder/report.json"), "there is no folder"),
    ],
)
def test_misuse_ends_with_one_sentence_and_code_2(convert, joints, tmp_path, arguments, says):
    code, out, err = convert(joints, tmp_path / "out", *arguments)
    assert (code, out) == (2, "")
    assert says in err
    assert err.startswith("wholebody: ")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_not_there_and_a_file_without_a_target_are_misuse(convert, tmp_path):
    assert "the one with meta and data in it" in convert(tmp_path / "nothing")[2]
    assert "name the file to write" in convert(tmp_path / "chunk.npz")[2]
