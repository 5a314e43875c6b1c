"""Our steps inside LeRobot's own pipelines: saved, loaded, paired, and around a real policy."""

import json

import numpy as np
import pytest
import torch
from lerobot.configs import FeatureType, NormalizationMode, PipelineFeatureType, PolicyFeature
from lerobot.lerobot_types import TransitionKey
from lerobot.policies import make_pre_post_processors
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.processor import PolicyProcessorPipeline, ProcessorStepRegistry
from lerobot.processor.converters import create_transition

from policy.action_spec.builtin import builtin
from policy.dataset.joint_conversion import JointConversion
from policy.dataset.naming.meaning import UNITREE_DEX1, UNITREE_DEX3
from policy.errors import ChunkError, DatasetError, SpecError
from policy.lerobot.steps import G1JointsToWristsStep, G1WristsToJointsStep, insert_steps, pair
from tests.support.joint_cases import DEX1, DEX3, swinging

CONVERSION = JointConversion(DEX3, builtin("wbc32"))
Q = swinging(frames=20, share=0.2)
WRISTS = CONVERSION.forward(Q).astype(np.float32)


def stats():
    low, high = WRISTS.min(axis=0) - 0.2, WRISTS.max(axis=0) + 0.2
    numbers = {"min": low, "max": high, "mean": 0.5 * (low + high), "std": 0.5 * (high - low), "q01": low, "q99": high}
    return dict.fromkeys(("observation.state", "action"), numbers)


def config():
    features = (FeatureType.STATE, FeatureType.ENV, FeatureType.ACTION)
    state, env, action = (PolicyFeature(type=kind, shape=(32,)) for kind in features)
    return ACTConfig(
        device="cpu",
        input_features={"observation.state": state, "observation.environment_state": env},
        output_features={"action": action},
        normalization_mapping=dict.fromkeys(("STATE", "ACTION"), NormalizationMode.QUANTILES)
        | {"ENV": NormalizationMode.IDENTITY},
        chunk_size=6,
        n_action_steps=6,
        dim_model=32,
        n_heads=2,
        dim_feedforward=32,
        n_encoder_layers=1,
        n_decoder_layers=1,
        n_vae_encoder_layers=1,
        latent_dim=4,
        pretrained_backbone_weights=None,
    )


@pytest.fixture
def pipelines():
    return insert_steps(*make_pre_post_processors(config(), dataset_stats=stats()))


def saved_and_loaded(pipelines, folder):
    for pipeline in pipelines:
        pipeline.save_pretrained(folder)
    return make_pre_post_processors(config(), pretrained_path=str(folder))


def observed(row):
    return {"observation.state": torch.from_numpy(Q[row])}


def test_the_state_is_wrists_before_it_is_normalised(pipelines):
    made = pipelines[0](observed(3))["observation.state"]
    low, high = stats()["action"]["q01"], stats()["action"]["q99"]
    assert made.shape == (1, 32)
    assert np.allclose(made[0].numpy(), 2.0 * (WRISTS[3] - low) / (high - low) - 1.0, atol=1e-5)


def test_pipelines_do_the_same_after_save_pretrained_and_from_pretrained(pipelines, tmp_path):
    loaded = saved_and_loaded(pipelines, tmp_path)
    pair(*loaded)
    for pair_of in (pipelines, loaded):
        for pipeline in pair_of:
            pipeline.reset()
    outputs = []
    for before, after in (pipelines, loaded):
        made = before(observed(0))
        outputs.append((made["observation.state"], after(made["observation.state"][None].repeat(1, 4, 1))))
    assert torch.equal(outputs[0][0], outputs[1][0])
    assert torch.equal(outputs[0][1], outputs[1][1])


def test_settings_survive_saving(tmp_path):
    made = insert_steps(
        *make_pre_post_processors(config(), dataset_stats=stats()),
        waist=[0.1, 0.0, 0.2],
        on_unreachable="nearest",
        joint_step_max=0.3,
    )
    before, after = saved_and_loaded(made, tmp_path)
    forth = next(step for step in before.steps if isinstance(step, G1JointsToWristsStep))
    back = next(step for step in after.steps if isinstance(step, G1WristsToJointsStep))
    assert forth.waist == back.waist == [0.1, 0.0, 0.2]
    assert (back.on_unreachable, back.joint_step_max) == ("nearest", 0.3)
    assert forth.conversion.target.hash == builtin("wbc32").hash


def test_a_layout_that_was_edited_in_the_saved_file_is_refused(pipelines, tmp_path):
    for pipeline in pipelines:
        pipeline.save_pretrained(tmp_path)
    file = tmp_path / "policy_preprocessor.json"
    said = json.loads(file.read_text())
    step = next(step for step in said["steps"] if step["registry_name"] == "g1_joints_to_wrists")
    step["config"]["spec"]["slots"][0]["tcp_offset"] = [0.05, 0.0, 0.0]
    file.write_text(json.dumps(said))
    with pytest.raises(ValueError, match="it was edited"):
        make_pre_post_processors(config(), pretrained_path=str(tmp_path))


def test_lerobot_names_the_step_that_was_not_imported(pipelines, tmp_path):
    pipelines[0].save_pretrained(tmp_path)
    kind = ProcessorStepRegistry.get("g1_joints_to_wrists")
    ProcessorStepRegistry.unregister("g1_joints_to_wrists")
    try:
        with pytest.raises(ImportError, match="g1_joints_to_wrists"):
            PolicyProcessorPipeline.from_pretrained(tmp_path, config_filename="policy_preprocessor.json")
    finally:
        ProcessorStepRegistry.register("g1_joints_to_wrists")(kind)


def test_joints_come_back_from_the_wrists_they_made(pipelines):
    before, after = pipelines
    numbers = torch.stack([before(observed(row))["observation.state"][0] for row in range(20)])
    before.reset()
    before(observed(0))
    joints = after(numbers[None])[0].numpy()
    assert np.array_equal(joints.shape, Q.shape)
    found, given = CONVERSION.wrists(joints), CONVERSION.wrists(Q)
    for hand in given:
        assert np.allclose(found[hand], given[hand], atol=1e-5)
    assert np.allclose(joints[:, 14:], Q[:, 14:], atol=1e-6)


def test_a_real_policy_reads_and_writes_joints(pipelines):
    torch.manual_seed(0)
    policy = ACTPolicy(config()).eval()
    before, after = insert_steps(
        *make_pre_post_processors(config(), dataset_stats=stats()), on_unreachable="nearest", joint_step_max=np.inf
    )
    batch = before(observed(0) | {"observation.environment_state": torch.zeros(32)})
    joints = after(policy.predict_action_chunk(batch))
    assert joints.shape == (1, 6, 28)
    assert torch.isfinite(joints).all()


def test_a_training_batch_keeps_type_and_shape():
    step = G1JointsToWristsStep()
    chunk = torch.from_numpy(Q.reshape(4, 5, 28))
    made = step(create_transition(observation={"observation.state": chunk[:, 0]}, action=chunk))
    assert made[TransitionKey.ACTION].shape == (4, 5, 32)
    assert made[TransitionKey.ACTION].dtype == torch.float32
    assert np.array_equal(made[TransitionKey.ACTION].numpy().reshape(20, 32), WRISTS)
    assert made[TransitionKey.OBSERVATION]["observation.state"].shape == (4, 32)


def test_features_become_as_wide_as_the_layout_and_back():
    joints = {
        PipelineFeatureType.OBSERVATION: {"observation.state": PolicyFeature(type=FeatureType.STATE, shape=(28,))},
        PipelineFeatureType.ACTION: {"action": PolicyFeature(type=FeatureType.ACTION, shape=(28,))},
    }
    wrists = G1JointsToWristsStep().transform_features(joints)
    assert wrists[PipelineFeatureType.OBSERVATION]["observation.state"].shape == (32,)
    assert wrists[PipelineFeatureType.ACTION]["action"].shape == (32,)
    back = G1WristsToJointsStep().transform_features(wrists)
    assert back[PipelineFeatureType.ACTION]["action"].shape == (28,)


def test_single_actions_start_where_the_last_one_ended():
    step = G1WristsToJointsStep(joint_step_max=np.inf)
    rows = [step(create_transition(action=torch.from_numpy(WRISTS[i])))[TransitionKey.ACTION] for i in range(5)]
    steps = np.abs(np.diff(torch.stack(rows).numpy(), axis=0)).max()
    assert steps < 0.1
    step.reset()
    assert step._last is None


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ((slice(None), 0, np.nan), "not finite"),
        ((slice(None), slice(3, 9), 0.0), "left_wrist_rotation at step 0"),
        ((4, 0, 3.0), "cannot reach the wrists of step 4"),
    ],
)
def test_actions_that_no_arm_can_follow_are_refused(change, says):
    rows, columns, value = change
    wrists = WRISTS[:6].copy()
    wrists[rows, columns] = value
    with pytest.raises(ChunkError, match=says):
        G1WristsToJointsStep()(create_transition(action=torch.from_numpy(wrists[None])))


def test_an_arm_that_would_turn_over_between_two_steps_is_refused():
    far = CONVERSION.forward(swinging(frames=2, seed=5, share=0.4)[:1])
    wrists = torch.from_numpy(np.vstack([WRISTS[:3], far]))
    with pytest.raises(ChunkError, match=r"would move .* rad to step 3, 0\.5 is allowed") as caught:
        G1WristsToJointsStep()(create_transition(action=wrists[None]))
    assert caught.value.step == 3
    G1WristsToJointsStep(joint_step_max=np.inf)(create_transition(action=wrists[None]))


@pytest.mark.parametrize(
    ("change", "says"),
    [(lambda q: q * 57.3, "--unit deg"), (lambda q: q * torch.nan, "not finite"), (lambda q: q[:, :20], "28")],
)
def test_states_that_are_no_joints_in_radians_are_refused(change, says):
    state = change(torch.from_numpy(Q[:2]))
    with pytest.raises(DatasetError, match=says):
        G1JointsToWristsStep()(create_transition(observation={"observation.state": state}))


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"joint_names": list(UNITREE_DEX1)}, "--synergy"),
        ({"joint_names": list(UNITREE_DEX3)[:5]}, "none for"),
        ({"spec": "wbc33"}, "did you mean"),
        ({"waist": [0.0]}, "waist_yaw_joint, waist_roll_joint"),
        ({"on_unreachable": "clamp"}, "'raise' or 'nearest'"),
        ({"joint_step_max": 0.0}, "must be positive"),
        ({"moving": "upper_body"}, "moving='arms'"),
    ],
)
def test_settings_that_cannot_work_are_refused_at_once(settings, says):
    with pytest.raises(ValueError, match=says):
        G1WristsToJointsStep(**settings)


def test_grippers_go_to_wbc27_and_back():
    q = swinging(DEX1, frames=2)
    settings = {"joint_names": list(UNITREE_DEX1), "spec": "wbc27"}
    made = G1JointsToWristsStep(**settings)(create_transition(action=torch.from_numpy(q)))
    back = G1WristsToJointsStep(**settings)(made)[TransitionKey.ACTION].numpy()
    assert made[TransitionKey.ACTION].shape == (2, 27)
    assert np.allclose(back[:, 14:], q[:, 14:], atol=1e-5)


def test_only_steps_of_the_same_joints_and_layout_are_paired(pipelines):
    before, after = pipelines
    plain = make_pre_post_processors(config(), dataset_stats=stats())
    with pytest.raises(SpecError, match="pre-processor has no"):
        pair(plain[0], after)
    with pytest.raises(SpecError, match="post-processor has no"):
        pair(before, plain[1])
    other = insert_steps(*plain, joint_names=list(reversed(UNITREE_DEX3)))
    with pytest.raises(SpecError, match="must be the same"):
        pair(before, other[1])


def test_pipelines_that_do_not_normalise_are_refused():
    empty = PolicyProcessorPipeline(steps=[])
    with pytest.raises(SpecError, match="no step that normalises"):
        insert_steps(empty, empty)
