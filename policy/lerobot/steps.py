"""LeRobot processor steps between the G1's joints and a wrist layout, for a policy's saved pipelines.

``g1_joints_to_wrists`` belongs in the pre-processor of a policy that thinks in wrists, on a robot or dataset of
joints: it turns ``observation.state``, and ``action`` where there is one, before the normaliser. Its counterpart
``g1_wrists_to_joints`` belongs behind the un-normaliser of the post-processor.

LeRobot finds a registered step by name only after its module was imported: ``import policy.lerobot.steps`` before
``make_pre_post_processors``. The whole layout is saved with its hash, so an edited layout is refused on loading.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import torch
from lerobot.configs import FeatureType, PipelineFeatureType, PolicyFeature
from lerobot.lerobot_types import EnvTransition, TransitionKey
from lerobot.processor import (
    AbsoluteActionsProcessorStep,
    NormalizerProcessorStep,
    PolicyProcessorPipeline,
    ProcessorStep,
    ProcessorStepRegistry,
    RelativeActionsProcessorStep,
    UnnormalizerProcessorStep,
)
from lerobot.utils.constants import ACTION, OBS_STATE

from policy.action_spec.builtin import builtin
from policy.action_spec.spec import ActionSpec
from policy.dataset.joint_conversion import JointConversion
from policy.dataset.joint_layout import joint_layout
from policy.dataset.joint_values import check_values
from policy.dataset.naming.meaning import UNITREE_DEX3
from policy.errors import ChunkError, SpecError
from policy.kinematics.forward import IK_TOLERANCE

Features = dict[PipelineFeatureType, dict[str, PolicyFeature]]


@dataclass
class _G1Step(ProcessorStep):
    """What both directions share: a joint vector, a wrist layout, and what fills the gaps between them."""

    joint_names: list[str] = field(default_factory=lambda: list(UNITREE_DEX3))
    """Columns of the joint vector, in order."""
    spec: str | dict[str, Any] = "wbc32"
    """Wrist layout: a built-in name, or the plain data of an `ActionSpec`."""
    waist: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    """Waist yaw, roll and pitch [rad] where the joint vector has none."""
    unit: str = "rad"
    """Unit of the joints, ``rad`` or ``deg``."""
    synergy: str | None = None
    """Map between one closing number and fingers, where only one side has fingers."""

    def __post_init__(self) -> None:
        target = ActionSpec.from_dict(self.spec) if isinstance(self.spec, Mapping) else builtin(self.spec)
        names = list(self.joint_names)
        layout = joint_layout(names, len(names), feature="joint_names", unit=self.unit)
        self.conversion = JointConversion(layout, target, tuple(self.waist), self.synergy, **self._chosen())

    def _chosen(self) -> dict[str, Any]:
        """Further settings of the conversion."""
        return {}

    def get_config(self) -> dict[str, Any]:
        """Settings as they are written to JSON."""
        target = self.conversion.target
        return {
            "joint_names": list(self.joint_names),
            "spec": {**target.to_dict(), "hash": target.hash},
            "waist": [float(angle) for angle in self.waist],
            "unit": self.unit,
            "synergy": self.synergy,
        }


@ProcessorStepRegistry.register("g1_joints_to_wrists")
@dataclass
class G1JointsToWristsStep(_G1Step):
    """Joints to a wrist layout by forward kinematics: ``observation.state``, and ``action`` where there is one.

    Tensors of any leading shape keep their type and device. The wrists are in the pelvis of the same frame.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self.measured: np.ndarray | None = None
        """Joint vectors (B, D) of the last observation; a paired `G1WristsToJointsStep` starts there."""

    def __call__(self, transition: EnvTransition) -> EnvTransition:
        """Convert what is there.

        Raises:
            DatasetError: If a tensor has another width, is not finite, or is not in radians.
        """
        changed = transition.copy()
        observation = transition.get(TransitionKey.OBSERVATION) or {}
        if OBS_STATE in observation:
            state = observation[OBS_STATE]
            self.measured = _rows(state)
            changed[TransitionKey.OBSERVATION] = {**observation, OBS_STATE: self._converted(state, OBS_STATE)}
        action = transition.get(TransitionKey.ACTION)
        if isinstance(action, torch.Tensor):
            changed[TransitionKey.ACTION] = self._converted(action, ACTION)
        return changed

    def reset(self) -> None:
        """Forget the last observation."""
        self.measured = None

    def transform_features(self, features: Features) -> Features:
        """State and action become as wide as the wrist layout."""
        return _with_width(features, self.conversion.target.dim, state=True)

    def _converted(self, joints: torch.Tensor, feature: str) -> torch.Tensor:
        rows = _rows(joints)
        check_values(self.conversion.source, rows, feature=feature)
        numbers = torch.from_numpy(self.conversion.forward(rows))
        return numbers.reshape(*joints.shape[:-1], -1).to(device=joints.device, dtype=joints.dtype)


@ProcessorStepRegistry.register("g1_wrists_to_joints")
@dataclass
class G1WristsToJointsStep(_G1Step):
    """Actions in a wrist layout to joints by inverse kinematics.

    An action is (A,) or (B, A), one step each, or (B, H, A), chunks. The elbows are free: each step starts from the one
    before, the first after `reset` from the measured joints of the paired step (`pair`), or else from the stance.
    """

    moving: str = "arms"
    """``arms``, or ``upper_body`` if the waist may help where the arms alone do not reach."""
    on_unreachable: str = "raise"
    """``raise``, or ``nearest`` to go on with the nearest pose."""
    joint_step_max: float = 0.5
    """Largest change of an arm or waist joint from one step to the next [rad]; more is an arm that turns over."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.on_unreachable not in ("raise", "nearest"):
            raise SpecError(f"on_unreachable '{self.on_unreachable}' is unknown; it is 'raise' or 'nearest'")
        if not self.joint_step_max > 0.0:
            raise SpecError(f"joint_step_max is {self.joint_step_max} rad; it must be positive, inf for no bound")
        self.joints_step: G1JointsToWristsStep | None = None
        self._last: np.ndarray | None = None

    def __call__(self, transition: EnvTransition) -> EnvTransition:
        """Convert the action.

        Raises:
            ChunkError: If a number is not finite or no rotation, a pose is out of reach, or a joint would jump; names
                the step.
        """
        action = transition.get(TransitionKey.ACTION)
        if action is None:
            return transition
        if not isinstance(action, torch.Tensor):
            raise ChunkError(
                f"the action is a {type(action).__name__}; a tensor of '{self.conversion.target.name}' is expected"
            )
        numbers = action.detach().cpu().double().numpy()
        if not 1 <= numbers.ndim <= 3:
            raise ChunkError(f"the action has shape {numbers.shape}; (A,), (B, A) or (B, H, A) is expected")
        chunks = numbers.reshape(1, 1, -1) if numbers.ndim == 1 else numbers if numbers.ndim == 3 else numbers[:, None]
        joints = np.stack(
            [self._solved(chunk, start) for chunk, start in zip(chunks, self._starts(len(chunks)), strict=True)]
        )
        self._last = joints[:, -1]
        changed = transition.copy()
        shaped = torch.from_numpy(joints.reshape(*numbers.shape[:-1], -1))
        changed[TransitionKey.ACTION] = shaped.to(device=action.device, dtype=action.dtype)
        return changed

    def reset(self) -> None:
        """Start anew from the measured joints or the stance."""
        self._last = None

    def get_config(self) -> dict[str, Any]:
        """Settings as they are written to JSON."""
        chosen = {"moving": self.moving, "on_unreachable": self.on_unreachable, "joint_step_max": self.joint_step_max}
        return {**super().get_config(), **chosen}

    def transform_features(self, features: Features) -> Features:
        """The action becomes as wide as the joint vector."""
        return _with_width(features, self.conversion.source.dim, state=False)

    def _chosen(self) -> dict[str, Any]:
        return {"moving": self.moving}

    def _starts(self, batch: int) -> list[np.ndarray | None]:
        measured = None if self.joints_step is None else self.joints_step.measured
        for rows in (self._last, measured):
            if rows is not None and len(rows) == batch:
                return list(rows)
        return [None] * batch

    def _solved(self, chunk: np.ndarray, start: np.ndarray | None) -> np.ndarray:
        joints, errors = self.conversion.backward(chunk, start)
        step = int(np.argmax(errors))
        if self.on_unreachable == "raise" and not errors[step] <= IK_TOLERANCE:
            raise ChunkError(
                f"the {'arms' if self.moving == 'arms' else 'upper body'} cannot reach the wrists of step {step}: "
                f"{errors[step]:.3g} (m and rad) remain, {IK_TOLERANCE:g} is allowed; on_unreachable='nearest' goes on "
                "with the nearest pose, the whole-body controller leans and squats",
                step=step,
            )
        self._refuse_jumps(joints, start)
        return joints

    def _refuse_jumps(self, joints: np.ndarray, start: np.ndarray | None) -> None:
        names = self.conversion.source.names
        is_body = np.array(["_hand_" not in name and not name.endswith("_grasp") for name in names])
        path = joints if start is None else np.vstack([start, joints])
        jumps = np.abs(np.diff(path, axis=0)) * is_body
        if self.unit == "deg":
            jumps = np.deg2rad(jumps)
        if jumps.size and jumps.max() > self.joint_step_max:
            before, column = (int(i) for i in np.unravel_index(int(np.argmax(jumps)), jumps.shape))
            step = before + (start is None)
            raise ChunkError(
                f"{names[column]} would move {jumps.max():.3g} rad to step {step}, {self.joint_step_max:g} is allowed: "
                "the wrist jumps, or the arm can only follow by turning over; shorten the way, or raise joint_step_max",
                step=step,
            )


def insert_steps(
    preprocessor: PolicyProcessorPipeline, postprocessor: PolicyProcessorPipeline, **settings: Any
) -> tuple[PolicyProcessorPipeline, PolicyProcessorPipeline]:
    """A policy's pipelines with joints at both ends; the policy goes on in wrists.

    Joints become wrists before LeRobot takes states and actions relative and normalises them, and wrists become joints
    after that is undone.

    Args:
        preprocessor: As from ``make_pre_post_processors``; not changed.
        postprocessor: Likewise.
        settings: Fields of both steps (``joint_names``, ``spec``, ``waist``, ``unit``, ``synergy``) or of
            `G1WristsToJointsStep`.

    Returns:
        Two new pipelines, paired.

    Raises:
        SpecError: If one of the two has no normalising step, or a setting is wrong.
    """
    own = {
        name: value for name, value in settings.items() if name not in ("moving", "on_unreachable", "joint_step_max")
    }
    before, after = list(preprocessor.steps), list(postprocessor.steps)
    entry = [isinstance(step, (RelativeActionsProcessorStep, NormalizerProcessorStep)) for step in before]
    exits = [isinstance(step, (AbsoluteActionsProcessorStep, UnnormalizerProcessorStep)) for step in after]
    if not any(entry) or not any(exits):
        raise SpecError("a pipeline has no step that normalises; joints cannot be put in front of it")
    before.insert(entry.index(True), G1JointsToWristsStep(**own))
    after.insert(len(exits) - exits[::-1].index(True), G1WristsToJointsStep(**settings))
    pipelines = replace(preprocessor, steps=before), replace(postprocessor, steps=after)
    pair(*pipelines)
    return pipelines


def pair(preprocessor: PolicyProcessorPipeline, postprocessor: PolicyProcessorPipeline) -> None:
    """Let the post-processor's inverse kinematics start from the joints that the pre-processor sees.

    Loading a checkpoint makes both apart; call this after ``make_pre_post_processors``.

    Raises:
        SpecError: If one of the two has no such step, or their joints or layouts differ.
    """
    before = next((step for step in preprocessor.steps if isinstance(step, G1JointsToWristsStep)), None)
    after = next((step for step in postprocessor.steps if isinstance(step, G1WristsToJointsStep)), None)
    if before is None or after is None:
        missing = (
            "pre-processor has no g1_joints_to_wrists"
            if before is None
            else "post-processor has no g1_wrists_to_joints"
        )
        raise SpecError(f"the {missing} step; both are needed to pair them")
    if (
        before.conversion.source != after.conversion.source
        or before.conversion.target.hash != after.conversion.target.hash
    ):
        raise SpecError("the steps of pre- and post-processor have other joints or layouts; they must be the same")
    after.joints_step = before


def _rows(values: torch.Tensor) -> np.ndarray:
    """All leading axes as one, (n, D) in double precision."""
    return values.detach().cpu().double().numpy().reshape(-1, values.shape[-1])


def _with_width(features: Features, width: int, *, state: bool) -> Features:
    changed = {kind: dict(named) for kind, named in features.items()}
    wanted = [(PipelineFeatureType.ACTION, ACTION, FeatureType.ACTION)]
    if state:
        wanted.append((PipelineFeatureType.OBSERVATION, OBS_STATE, FeatureType.STATE))
    for kind, key, meaning in wanted:
        if key in changed.get(kind, {}):
            changed[kind][key] = PolicyFeature(type=meaning, shape=(width,))
    return changed
