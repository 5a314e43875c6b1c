"""From an observation to an action chunk: specs, codecs, recorded and scripted policies. Imports numpy only."""

from policy.anchor import Anchor
from policy.base import Policy
from policy.chunk import ActionChunk
from policy.chunk_file import ChunkFile, read_chunk_file, write_chunk_file
from policy.codec import decode, encode
from policy.convert import convert
from policy.errors import ChunkError, FileFormatError, ObservationError, PolicyError, RotationError, SpecError
from policy.layouts import LAYOUTS, builtin
from policy.motion_csv import Motion, motion_chunk, read_motion_csv, write_motion_csv
from policy.observation import Observation
from policy.replay import ReplayPolicy, open_recording
from policy.scripted import ScriptedPolicy
from policy.scripts import SCRIPTS, scripted
from policy.slot import Slot
from policy.spec import ActionSpec, require_same

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
    "scripted",
    "write_chunk_file",
    "write_motion_csv",
]
