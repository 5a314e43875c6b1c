"""From an observation to an action chunk: specs, codecs, policies, and how they are run.

Importing the package loads numpy only; what needs torch, lerobot or websockets is imported when it is first used.
"""

from importlib import import_module

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.codec import decode, encode
from policy.action_spec.slot import Slot
from policy.action_spec.spec import ActionSpec, require_same
from policy.base import Policy
from policy.chunk import ActionChunk
from policy.errors import ChunkError, FileFormatError, ObservationError, PolicyError, RotationError, SpecError
from policy.executor.executor import Executor, ExecutorConfig
from policy.executor.simulated import simulated_executor, uniform_latency
from policy.observation import Observation
from policy.recorded.chunk_file import ChunkFile, read_chunk_file, write_chunk_file
from policy.recorded.convert import convert
from policy.recorded.motion_csv import Motion, motion_chunk, read_motion_csv, write_motion_csv
from policy.recorded.replay import ReplayPolicy, open_recording
from policy.scripted.library import SCRIPTS, scripted_policy
from policy.scripted.policy import ScriptedPolicy
from policy.targets.stream import TargetStream

_LATER = {
    "LeRobotPolicy": "policy.lerobot.policy",
    "PolicyServer": "policy.remote.server",
    "RemotePolicy": "policy.remote.client",
}
"""Public name and the module that it is imported from when it is first used."""

__all__ = [
    "LAYOUTS",
    "SCRIPTS",
    "ActionChunk",
    "ActionSpec",
    "Anchor",
    "ChunkError",
    "ChunkFile",
    "Executor",
    "ExecutorConfig",
    "FileFormatError",
    "LeRobotPolicy",
    "Motion",
    "Observation",
    "ObservationError",
    "Policy",
    "PolicyError",
    "PolicyServer",
    "RemotePolicy",
    "ReplayPolicy",
    "RotationError",
    "ScriptedPolicy",
    "Slot",
    "SpecError",
    "TargetStream",
    "builtin",
    "convert",
    "decode",
    "encode",
    "motion_chunk",
    "open_recording",
    "read_chunk_file",
    "read_motion_csv",
    "require_same",
    "scripted_policy",
    "simulated_executor",
    "uniform_latency",
    "write_chunk_file",
    "write_motion_csv",
]


def __getattr__(name: str) -> object:
    """A public name that is imported when it is first used.

    Raises:
        AttributeError: If there is no such name.
    """
    if name not in _LATER:
        raise AttributeError(f"module 'policy' has no attribute '{name}'; it offers {', '.join(__all__)}")
    return getattr(import_module(_LATER[name]), name)
