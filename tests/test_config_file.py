"""Strategy: small YAML files as a user would write them, good and bad."""

import pytest

from wholebody.config import ControllerConfig
from wholebody.config_file import config_from, dump_config, load_config
from wholebody.errors import ConfigError
from wholebody.resources import configs_folder


def test_a_file_changes_only_what_it_names(tmp_path):
    file = tmp_path / "c.yaml"
    file.write_text("solver: proxqp\nhand:\n  kp: 400\nplanner:\n  posture:\n    zmp_margin: 0.04\n")
    config = load_config(file)
    assert (config.solver, config.hand.kp, config.planner.posture.zmp_margin) == ("proxqp", 400.0, 0.04)
    assert config.hand.kd == ControllerConfig().hand.kd


def test_an_empty_file_is_the_default(tmp_path):
    file = tmp_path / "c.yaml"
    file.write_text("")
    assert load_config(file) == ControllerConfig()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"solvr": "daqp"}, "did you mean 'solver'"),
        ({"hand": {"kq": 1.0}}, "unknown setting 'hand.kq'"),
        ({"hand": {"kp": "stiff"}}, "must be a finite number"),
        ({"hand": {"kp": True}}, "must be a finite number"),
        ({"hand": 3}, "hand must be a mapping"),
        ([1, 2], "must be a mapping"),
        ({"hand": {"kp": float("nan")}}, "must be a finite number"),
    ],
)
def test_a_mistake_is_named_with_its_place(changes, says):
    with pytest.raises(ConfigError, match=says.replace(".", r"\.")):
        config_from(changes)


def test_broken_yaml_says_so(tmp_path):
    file = tmp_path / "c.yaml"
    file.write_text("a: [1")
    with pytest.raises(ConfigError, match="is not YAML"):
        load_config(file)


def test_what_is_written_reads_back_equal():
    import yaml

    assert config_from(yaml.safe_load(dump_config(ControllerConfig()))) == ControllerConfig()


def test_every_shipped_file_loads():
    for file in configs_folder().glob("*.yaml"):
        load_config(file)
