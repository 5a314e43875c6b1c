"""From an observation to an action chunk: specs, codecs, recorded and scripted policies. Imports numpy only."""

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.codec import decode, encode
from policy.action_spec.slot import Slot
from policy.action_spec.spec import ActionSpec, require_same
from policy.base import Policy
from policy.chunk import ActionChunk
from policy.errors import ChunkError, FileFormatError, ObservationError, PolicyError, RotationError, SpecError
from policy.observation import Observation
from policy.recorded.chunk_file import ChunkFile, read_chunk_file, write_chunk_file
from policy.recorded.convert import convert
from policy.recorded.motion_csv import Motion, motion_chunk, read_motion_csv, write_motion_csv
from policy.recorded.replay import ReplayPolicy, open_recording
from policy.scripted.library import SCRIPTS, scripted_policy
from policy.scripted.policy import ScriptedPolicy

__all__ = [
    "LAYOUTS",
    "SCRIPTS",
    "ActionChunk",
    "ActionSpec",
    "Anchor",
    "ChunkError",
    "ChunkFile",
    "FileFormatError",
    "Motion",
    "Observation",
    "ObservationError",
    "Policy",
    "PolicyError",
    "ReplayPolicy",
    "RotationError",
    "ScriptedPolicy",
    "Slot",
    "SpecError",
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
    "write_chunk_file",
    "write_motion_csv",
]
