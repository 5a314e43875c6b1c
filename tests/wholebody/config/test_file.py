"""Strategy: small YAML files as a user would write them, good and bad."""

import re
from dataclasses import fields, is_dataclass, replace

import pytest
import yaml

from wholebody.config import ControllerConfig, HandConfig
from wholebody.config.bounds import bounds_of, check_config, unit_of
from wholebody.config.file import config_from, dump_config, load_config
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
        (
            {"robot": {"locked": ["waist_roll_joint"]}},
            "'body' is about that: Joints that this G1 has: '29dof'",
        ),
        ({"planner": {"turning": 0.1}}, "it is called 'orientation_relaxed' now"),
        ({"planner": {"posture": {"sweep": 0.1}}}, "it is called 'approach_time' now"),
        ({"hand": {"kq": 1.0}}, "unknown setting 'hand.kq'"),
        ({"hand": {"kp": "stiff"}}, "hand.kp must be a finite number in SI units, got 'stiff'"),
        ({"dt": "2 ms"}, "dt must be a finite number in SI units, got '2 ms'"),
        ({"hand": {"kp": True}}, "must be a finite number"),
        ({"hand": {"kp": None}}, "must be a finite number"),
        ({"hand": {"kp": -1.0}}, "hand.kp is -1; 0 to 1e+06 1/s^2 is expected"),
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
    assert stored == dump_config(ControllerConfig(), everything=False), "make configs writes it anew"


def walked(owner, path=()):
    for field in fields(owner):
        value, here = getattr(owner, field.name), (*path, field.name)
        yield from walked(value, here) if is_dataclass(value) else [(type(owner), here, value)]


NUMBERS = [
    (owner, ".".join(path), value)
    for owner, path, value in walked(ControllerConfig())
    if not isinstance(value, str | bool)
]


@pytest.mark.parametrize(("owner", "path", "value"), NUMBERS, ids=[path for _, path, _ in NUMBERS])
def test_b2_every_setting_has_bounds_that_hold_its_default_and_are_in_the_message(owner, path, value):
    least, most = bounds_of(path, owner)
    assert all(least <= number <= most for number in (value if isinstance(value, tuple) else (value,)))
    changes = (1e300,) * len(value) if isinstance(value, tuple) else 1e300
    for name in reversed(path.split(".")):
        changes = {name: list(changes) if isinstance(changes, tuple) else changes}
    with pytest.raises(ConfigError, match=re.escape(f"{path} is 1e+300; {least:g} to {most:g}")) as refusal:
        config_from(changes)
    assert unit_of(owner, path.rpartition(".")[2]) in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("dt: 0", "dt is 0; 0.0005 to 0.02 s is expected"),
        ("dt: 1e-9", "dt is 1e-09; 0.0005 to 0.02 s"),
        (f"dt: 1{'0' * 400}", "a finite number"),
        ("dt: 2020-01-01", "a finite number"),
        ("dt: 9999999-99-99", "a finite number"),
        ("friction: 1e300", r"friction is 1e\+300; 0.05 to 2 is expected"),
        ("force_max: 0", "force_max is 0; 100 to 10000 N is expected"),
        ("planner: {slowdowns: []}", "has 0 numbers"),
        ("planner: {slowdowns: [" + "2, " * 100 + "2]}", "has 101 numbers"),
        ("[" * 100_000, "nested deeper than 32 levels"),
        ("a: " * 2, "is not YAML"),
        ("x: &a [1]\ny: *a", r"has an alias \(\*a\)"),
        ("dt: !!python/object/apply:os.system [x]", "is not YAML of plain values"),
        ("dt: \x07", "is not YAML"),
        ("\ud800", "is no text"),
        ("dt: {a: {b: 1}}", "a finite number"),
        ("? [a]\n: 1", "is not YAML|unknown setting"),
    ],
)
def test_b2_yaml_that_would_break_its_reader_is_refused(text, says, tmp_path):
    file = tmp_path / "c.yaml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(ConfigError, match=says) as refusal:
        load_config(file)
    assert str(refusal.value).isprintable()


def test_b3_an_alias_bomb_is_refused_before_it_is_unfolded(tmp_path):
    rows = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9) if i else '1'}]" for i in range(12)]
    (tmp_path / "c.yaml").write_text("\n".join(rows))
    with pytest.raises(ConfigError, match="has an alias"):
        load_config(tmp_path / "c.yaml")


def test_names_in_a_file_cannot_move_the_cursor(tmp_path):
    (tmp_path / "c.yaml").write_text('"\\e[2J\\nFEASIBLE": 1\n')
    with pytest.raises(ConfigError, match=r"unknown setting '\\x1b\[2J\\nFEASIBLE'"):
        load_config(tmp_path / "c.yaml")


def test_limits_of_hands_are_a_number_or_one_an_axis():
    read = config_from({"touch": {"force_max": [40, 40, "8"], "stiffness": 300}}).touch
    assert (read.force_max, read.stiffness) == ((40.0, 40.0, 8.0), 300.0)
    assert "force_max: [40.0, 40.0, 8.0]" in dump_config(ControllerConfig(touch=read))
    for wrong, says in (([1, 2], "a list of 3 numbers, got 2"), ([1, 2, -1], "is -1; 0 to 10000 N"), ("a", "a finite")):
        with pytest.raises(ConfigError, match=says):
            config_from({"touch": {"force_max": wrong}})


def test_a_configuration_made_in_python_can_be_checked():
    check_config(ControllerConfig())
    with pytest.raises(ConfigError, match=r"hand\.kp is nan; 0 to 1e\+06 1/s\^2 is expected"):
        check_config(replace(ControllerConfig(), hand=HandConfig(kp=float("nan"))))
