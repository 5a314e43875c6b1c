"""No code from a file: a canary for each way in which a checkpoint could name something that LeRobot runs.

Strategy: a tiny real checkpoint gets one change that, if anything ran it, would write a file. Loading it must be
refused with the step or file and a cure, and the file must not be there. Where LeRobot would run it, a control shows
that, so that the canary is known to sing.
"""

import json
import pickle
import sys

import lerobot.policies  # noqa: F401 - registers the policy types
import pytest
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.processor import PolicyProcessorPipeline, ProcessorStep, ProcessorStepRegistry

from policy.findings import CheckpointError
from policy.lerobot.trust import POLICY_TYPES, check_policy_type, check_steps, no_foreign_code
from policy.lerobot.weights import WEIGHTS_FILE
from tests.support import tiny_policies as tiny
from wholebody.cli import main as cli

PRE, POST = "policy_preprocessor.json", "policy_postprocessor.json"


class Canary:
    """A file that only foreign code would write."""

    def __init__(self, folder):
        self.file = folder / "canary"
        self.command = f"touch {self.file}"

    @property
    def sang(self):
        return self.file.exists()

    @property
    def source(self):
        """Code of a module that sings when it is imported."""
        return f"open({str(self.file)!r}, 'w').close()\n"


@pytest.fixture
def canary(tmp_path):
    return Canary(tmp_path)


@pytest.fixture
def act(tmp_path, tmp_path_factory):
    return tiny.copied("act", tmp_path_factory, tmp_path)


def edit(file, change):
    data = json.loads(file.read_text())
    change(data)
    file.write_text(json.dumps(data))


def add_step(folder, step, file=PRE):
    edit(folder / file, lambda data: data["steps"].insert(0, step))


def refusal(folder, **options):
    with pytest.raises(CheckpointError) as refused:
        tiny.load(folder, **options)
    return str(refused.value)


@pytest.mark.parametrize("file", [PRE, POST])
def test_b1_a_step_that_names_a_command_is_refused_and_not_run(file, act, canary):
    add_step(act, {"class": "os.system", "config": {"command": canary.command}}, file)
    said = refusal(act)
    assert not canary.sang
    assert f"step 0 of {act / file} names the class 'os.system'" in said
    assert "only steps of LeRobot's registry and ours are run" in said
    # LeRobot itself runs it.
    with pytest.raises(Exception, match=r"ProcessorStep|processor step"):
        PolicyProcessorPipeline.from_pretrained(str(act), config_filename=file)
    assert canary.sang


def test_b1_a_step_that_names_a_module_is_refused_before_it_is_imported(act, canary, tmp_path, monkeypatch):
    (tmp_path / "chirping.py").write_text(canary.source)
    monkeypatch.syspath_prepend(tmp_path)
    add_step(act, {"class": "chirping.Step"})
    assert "names the class 'chirping.Step'" in refusal(act)
    assert not canary.sang
    assert "chirping" not in sys.modules


def test_a_step_with_a_registered_name_and_a_class_does_not_import_the_class(act, canary):
    add_step(act, {"registry_name": "device_processor", "class": "os.system", "config": {}})
    tiny.load(act)
    assert not canary.sang


@pytest.mark.parametrize("command", ["run", "check", "doctor", "serve-policy"])
def test_b1_no_command_runs_what_a_checkpoint_names(command, act, canary, monkeypatch, capsys):
    add_step(act, {"class": "os.system", "config": {"command": canary.command}})
    length = ["--duration", "1"] if command in ("run", "check") else []
    monkeypatch.setattr(sys, "argv", ["wholebody", command, str(act), *length])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == 2
    assert not canary.sang
    said = capsys.readouterr()
    assert "names the class 'os.system'" in said.out + said.err


def write_code_tokenizer(folder, canary):
    """A tokenizer whose configuration names a class in a file beside it."""
    tiny.write_tokenizer(folder)
    (folder / "chirp.py").write_text(canary.source + "class Tokenizer: pass\n")
    # A class that transformers has not: else its own is taken.
    names = {"AutoTokenizer": ["chirp.Tokenizer", "chirp.Tokenizer"], "AutoProcessor": "chirp.Tokenizer"}
    for file in ("tokenizer_config.json", "config.json"):
        (folder / file).write_text(json.dumps({"auto_map": names, "tokenizer_class": "Chirp", "model_type": "chirp"}))
    (folder / "processor_config.json").write_text(json.dumps({"auto_map": names}))
    return folder


def test_b1_a_step_that_trusts_foreign_code_is_refused(act, canary, tmp_path):
    folder = write_code_tokenizer(tmp_path / "fast", canary)
    step = {
        "registry_name": "action_tokenizer_processor",
        "config": {"action_tokenizer_name": str(folder), "trust_remote_code": True},
    }
    add_step(act, step)
    said = refusal(act)
    assert "step 0" in said
    assert "'action_tokenizer_processor', which loads code or models that it names" in said
    assert not canary.sang
    with pytest.raises(Exception, match=r"ProcessorStep|processor step"):
        PolicyProcessorPipeline.from_pretrained(str(act), config_filename=PRE)
    assert canary.sang


def test_b1_a_tokenizer_that_brings_code_is_refused_whatever_is_typed(tmp_path, tmp_path_factory, canary, monkeypatch):
    """transformers asks "Do you wish to run the custom code? [y/N]" on the terminal."""
    folder = tiny.copied("pi05", tmp_path_factory, tmp_path)
    write_code_tokenizer(folder / "tokenizer", canary)
    monkeypatch.setattr("builtins.input", lambda _: "y")
    said = refusal(folder)
    assert "config.json names code to be run (auto_map)" in said
    assert not canary.sang


def test_a_tokenizer_elsewhere_that_brings_code_is_refused_whatever_is_typed(
    tmp_path, tmp_path_factory, canary, monkeypatch
):
    folder = tiny.copied("pi05", tmp_path_factory, tmp_path)
    other = write_code_tokenizer(tmp_path / "elsewhere", canary)
    (folder / "tokenizer").rename(tmp_path / "away")

    def point(data):
        (step,) = (step for step in data["steps"] if step["registry_name"] == "tokenizer_processor")
        step["config"]["tokenizer_name"] = str(other)

    edit(folder / PRE, point)
    monkeypatch.setattr("builtins.input", lambda _: "y")
    said = refusal(folder)
    assert "tokenizer_processor" in said
    assert not canary.sang


def test_b1_a_backbone_that_brings_code_is_refused(tmp_path, tmp_path_factory, canary, monkeypatch):
    folder = tiny.copied("smolvla", tmp_path_factory, tmp_path)
    other = write_code_tokenizer(tmp_path / "vlm", canary)
    edit(folder / "config.json", lambda data: data.update(vlm_model_name=str(other)))
    monkeypatch.setattr("builtins.input", lambda _: "y")
    assert f"{other}" in refusal(folder)
    assert not canary.sang


def test_transformers_is_as_it_was_afterwards():
    from transformers import dynamic_module_utils

    before = dynamic_module_utils.TIME_OUT_REMOTE_CODE
    with no_foreign_code():
        assert dynamic_module_utils.TIME_OUT_REMOTE_CODE == 0
    assert before == dynamic_module_utils.TIME_OUT_REMOTE_CODE > 0


@pytest.mark.parametrize("kind", sorted(set(PreTrainedConfig.get_known_choices()) - set(POLICY_TYPES)))
def test_b1_a_policy_type_that_loads_what_its_file_names_is_refused(kind, tmp_path):
    (tmp_path / "config.json").write_text(json.dumps({"type": kind, "action_tokenizer_name": str(tmp_path)}))
    with pytest.raises(CheckpointError, match=f"policy type '{kind}', which loads code or models that its file names"):
        check_policy_type(tmp_path / "config.json")


@pytest.mark.parametrize("kind", ["os.system", "nobody.Config", "", None, ["act"], 3])
def test_a_policy_type_that_nobody_registered_is_refused(kind, act):
    edit(act / "config.json", lambda data: data.update(type=kind))
    assert "is not registered" in refusal(act)


def test_a_step_that_the_program_itself_registered_is_allowed(act):
    @ProcessorStepRegistry.register("step_of_a_test")
    class Step(ProcessorStep):
        def __call__(self, transition):
            return transition

        def transform_features(self, features):
            return features

    try:
        add_step(act, {"registry_name": "step_of_a_test", "config": {}})
        tiny.load(act)
    finally:
        ProcessorStepRegistry.unregister("step_of_a_test")


@pytest.mark.parametrize("step", [{"registry_name": "os.system"}, {"registry_name": ["a"]}, {"class": 3}, {}])
def test_a_step_that_nobody_registered_is_refused(step, act):
    add_step(act, step)
    said = refusal(act)
    assert f"step 0 of {act / PRE}" in said
    assert "regist" in said


@pytest.mark.parametrize("name", ["reward_classifier_processor", "groot_n1_7_vlm_encode_v1", "eo1_qwen_processor"])
def test_b1_a_step_that_loads_a_model_by_name_is_refused(name, act):
    add_step(act, {"registry_name": name, "config": {"pretrained_path": str(act)}})
    with pytest.raises(CheckpointError, match=f"'{name}', which loads code or models that it names"):
        check_steps(act / PRE)


@pytest.mark.parametrize("name", ["../stolen.safetensors", "/etc/passwd", "stolen.pkl", "", 7, "a\n.safetensors/b"])
def test_a_step_reads_its_numbers_from_the_checkpoint_alone(name, act, tmp_path):
    (tmp_path / "stolen.safetensors").write_bytes(b"")
    edit(act / PRE, lambda data: data["steps"][-1].update(state_file=name))
    with pytest.raises(CheckpointError, match="which is no file of the checkpoint"):
        check_steps(act / PRE)


class Chirp:
    """Sings when it is unpickled."""

    def __init__(self, canary):
        self.canary = canary

    def __reduce__(self):
        return open, (str(self.canary.file), "w")


def test_weights_that_are_a_pickle_are_refused(act, canary):
    (act / WEIGHTS_FILE).write_bytes(pickle.dumps(Chirp(canary)))
    assert "is cut short or damaged" in refusal(act)
    torch.save(Chirp(canary), act / "pytorch_model.bin")
    (act / WEIGHTS_FILE).unlink()
    assert f"{WEIGHTS_FILE} is missing" in refusal(act)
    assert not canary.sang


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"steps": ' * 50_000, "{", "[]", "1e999", "\x00", '{"type": 1' + "0" * 5000 + "}"]
)
def test_json_that_is_none_is_refused(text, tmp_path):
    for check, file in ((check_policy_type, tmp_path / "config.json"), (check_steps, tmp_path / PRE)):
        file.write_text(text)
        with pytest.raises(CheckpointError, match=str(file)):
            check(file)


@pytest.mark.parametrize("backbone", ["resnet", "resnet19", "resnet18/../x"])
@pytest.mark.parametrize("kind", ["act", "diffusion"])
def test_a_backbone_that_is_no_network_is_refused(kind, backbone, tmp_path, tmp_path_factory):
    """`torchvision.models.resnet` is a module: calling it was a fault of ours."""
    folder = tiny.copied(kind, tmp_path_factory, tmp_path)
    edit(folder / "config.json", lambda data: data.update(vision_backbone=backbone))
    assert "vision_backbone" in refusal(folder)


def test_a_network_is_not_compiled_because_its_file_says_so(tmp_path, tmp_path_factory, monkeypatch):
    """It was killed after 100 s of compiling."""
    folder = tiny.copied("diffusion", tmp_path_factory, tmp_path)
    edit(folder / "config.json", lambda data: data.update(compile_model=True))

    def compiled(*_, **__):
        raise AssertionError("compiled")

    monkeypatch.setattr(torch, "compile", compiled)
    assert tiny.load(folder).checkpoint.network.config.compile_model is False


def test_a_tokenizer_that_gives_up_on_the_prompt_is_told(tmp_path, tmp_path_factory):
    """A pattern that backtracks for ever ends in a panic, which no ``except Exception`` sees."""
    folder = tiny.copied("pi05", tmp_path_factory, tmp_path)
    bomb = {"type": "Split", "pattern": {"Regex": "(5+5+)+y"}, "behavior": "Isolated", "invert": False}

    def spoil(data):
        data["normalizer"] = {"type": "Replace", "pattern": {"Regex": "[^5]"}, "content": "5"}
        data["pre_tokenizer"] = {"type": "Sequence", "pretokenizers": [bomb, data["pre_tokenizer"]]}

    edit(folder / "tokenizer" / "tokenizer.json", spoil)
    assert "the tokenizer gives up on the prompt" in refusal(folder)
