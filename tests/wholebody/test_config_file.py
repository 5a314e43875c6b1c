"""Strategy: small YAML files as a user would write them, good and bad."""

import re

import pytest
import yaml

from wholebody.config import ControllerConfig
from wholebody.config_file import config_from, dump_config, load_config
from wholebody.errors import ConfigError
from wholebody.resources import configs_folder


def written(tmp_path, text):
    file = tmp_path / "c.yaml"
    file.write_text(text)
    return file


def test_a_file_changes_only_what_it_names(tmp_path):
    text = "solver: proxqp\nhand:\n  kp: 400\nplanner:\n  posture:\n    zmp_margin: 0.04\n"
    config = load_config(written(tmp_path, text))
    assert (config.solver, config.hand.kp, config.planner.posture.zmp_margin) == ("proxqp", 400.0, 0.04)
    assert config.hand.kd == ControllerConfig().hand.kd


def test_a_changed_part_keeps_the_defaults_of_its_owner_not_of_its_class(tmp_path):
    default = ControllerConfig().planner.posture
    config = load_config(written(tmp_path, "planner:\n  posture:\n    com: 1e-1\n"))
    assert config.planner.posture.com == 0.1
    assert config.planner.posture.position == default.position


def test_an_empty_file_is_the_default(tmp_path):
    assert load_config(written(tmp_path, "")) == ControllerConfig()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"solvr": "daqp"}, "did you mean 'solver'"),
        ({"planner": {"calm": {}}}, "it is called 'weights_unreachable' now"),
        ({"planner": {"posture": {"sweep": 0.1}}}, "it is called 'approach_time' now"),
        ({"hand": {"kq": 1.0}}, "unknown setting 'hand.kq'"),
        ({"hand": {"kp": "stiff"}}, "hand.kp must be a finite number in SI units, got 'stiff'"),
        ({"dt": "2 ms"}, "dt must be a finite number in SI units, got '2 ms'"),
        ({"hand": {"kp": True}}, "must be a finite number"),
        ({"hand": {"kp": None}}, "must be a finite number"),
        ({"hand": {"kp": -1.0}}, "hand.kp must be at least 0, got -1.0"),
        ({"hand": 3}, "hand must be a mapping"),
        ([1, 2], "must be a mapping"),
        (False, "must be a mapping"),
        ({"hand": {"kp": float("nan")}}, "must be a finite number"),
        ({"solver": 3}, "solver must be a name"),
        ({"body": {"com_weight": [1.0, 2.0]}}, "body.com_weight"),
        ({"body": {"com_weight": 1.0}}, "body.com_weight must be a list of numbers"),
        ({"body": {"com_weight": [1.0, 2.0, "x"]}}, "must be a finite number"),
    ],
)
def test_a_mistake_is_named_with_its_place(changes, says):
    with pytest.raises(ConfigError, match=re.escape(says)):
        config_from(changes)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("solver: daqp\n# comment\nsolvr: daqp\n", 3),
        ("hand:\n  kp: 400\n  kd: many\n", 3),
        ("planner:\n  posture:\n    zmp_margin: 0.04\n    zmp_margn: 0.04\n", 4),
        ("hand:\n  - 1\n", 1),
    ],
)
def test_a_mistake_is_named_with_file_and_line(tmp_path, text, line):
    file = written(tmp_path, text)
    with pytest.raises(ConfigError, match=re.escape(f"{file}:{line}: ")):
        load_config(file)


def test_broken_yaml_says_so(tmp_path):
    with pytest.raises(ConfigError, match="is not YAML"):
        load_config(written(tmp_path, "a: [1"))


def test_yaml_cannot_make_objects(tmp_path):
    with pytest.raises(ConfigError, match="is not YAML"):
        load_config(written(tmp_path, "solver: !!python/object/apply:os.system ['true']\n"))


def test_what_is_written_reads_back_equal():
    assert config_from(yaml.safe_load(dump_config(ControllerConfig()))) == ControllerConfig()


def test_every_written_setting_says_what_it_is():
    text = dump_config(ControllerConfig())
    settings = [line for line in text.splitlines() if ": " in line and not line.strip().startswith("#")]
    lines = text.splitlines()
    silent = [line.strip() for line in settings if not lines[lines.index(line) - 1].strip().startswith("#")]
    assert silent == []


def test_every_shipped_file_loads():
    for file in configs_folder().glob("*.yaml"):
        load_config(file)


def test_the_shipped_default_is_the_default():
    stored = (configs_folder() / "default.yaml").read_text()
    assert stored == dump_config(ControllerConfig()), "make configs writes it anew"
