"""From one recording format or action layout to another; datasets by `policy.dataset.conversion`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import as_spec
from policy.action_spec.codec import encode
from policy.action_spec.mask import full_mask
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.dataset.inspection import action_findings, read_as_said, settled, with_notes
from policy.errors import FileFormatError
from policy.geometry.rotations import matrix_to_quaternion
from policy.geometry.se3 import interpolate, inverse
from policy.kinematics.inverse import upper_body_joints
from policy.reading import FPS_MAX, FPS_MIN, STEPS_MAX
from policy.recorded.chunk_file import ChunkFile, read_chunk_file, write_chunk_file
from policy.recorded.motion_csv import DEFAULT_FPS, Motion, motion_chunk, write_motion_csv
from policy.recorded.motion_npz import is_motion_npz
from policy.recorded.replay import read_motion


def convert(
    source: str | Path,
    target: str | Path,
    *,
    to: str | ActionSpec = "wbc32",
    csv_fps: float | None = None,
    assume: ActionSpec | None = None,
    robot: RobotSpec | None = None,
    read_as: Sequence[str] = (),
) -> ActionChunk:
    """Convert a recording; the formats follow from the file names.

    * motion ``.csv`` to chunk ``.npz``: wrists relative to each frame's pelvis, anchored at the nominal stance.
    * motion ``.npz`` to motion ``.csv`` or chunk ``.npz``: as it is, at its own rate; as a ``.csv``.
    * chunk ``.npz`` to chunk ``.npz``: another layout, with the same anchor.
    * chunk ``.npz`` to motion ``.csv``: the robot stays in its stance, arms and waist by inverse kinematics.

    Args:
        source: File to read.
        target: File to write.
        to: Layout of a written chunk file, built-in name or spec.
        csv_fps: Frame rate of the CSV file, read or written [Hz]; if None, `DEFAULT_FPS`, or what the name of a file
            that is read says, and a note of the chunk tells so.
        assume: Spec of a chunk file that does not say it (``--assume-spec``).
        robot: The robot that is recorded; the G1 with Dex3 hands if None.
        read_as: What the numbers are instead of what they are called, of `policy.suspicion.corrections.READ_AS`.

    Returns:
        What was converted, in world, with what is odd about it in its notes.

    Raises:
        FileFormatError: If a file is malformed, its numbers cannot be what they are called, or the pair of formats is
            not one of these.
        ChunkError: If the arms cannot reach what a joint layout or a CSV needs.
    """
    source, target = Path(source), Path(target)
    formats = (source.suffix.lower(), target.suffix.lower())
    if formats[0] == ".csv" or (formats[0] == ".npz" and is_motion_npz(source)):
        if formats not in ((".csv", ".npz"), (".npz", ".npz"), (".npz", ".csv")):
            raise _no_pair(source, target)
        motion, notes = read_motion(source, csv_fps, robot, read_as)
        chunk = with_notes(motion_chunk(motion), notes)
        if formats[1] == ".csv":
            write_motion_csv(target, motion)
        else:
            _write(target, chunk, to, Anchor.nominal(robot=robot), {})
    elif formats in ((".npz", ".npz"), (".npz", ".csv")):
        file = read_chunk_file(source, assume=assume, robot=robot)
        actions, fps = read_as_said(file.spec, file.actions, file.fps, read_as)
        file = replace(file, actions=actions, fps=fps)
        found = action_findings(file.spec, actions, file.anchor(), fps, file.q0_joints)
        chunk = with_notes(file.chunk(), settled(found, read_as, str(source)))
        if formats[1] == ".csv":
            rate = DEFAULT_FPS if csv_fps is None else csv_fps
            write_motion_csv(target, chunk_motion(chunk, file.anchor(), fps=rate))
        else:
            _write(target, chunk, to, file.anchor(), _start_of(file))
    else:
        raise _no_pair(source, target)
    return chunk


def _no_pair(source: Path, target: Path) -> FileFormatError:
    return FileFormatError(
        f"cannot become '{target.name}'; possible are .csv to .npz, .npz to .npz and .npz to .csv", path=str(source)
    )


def chunk_motion(chunk: ActionChunk, anchor: Anchor, *, fps: float = DEFAULT_FPS) -> Motion:
    """Whole-body motion of a robot that stays in its posture but for the arms, and the waist where they need it.

    Args:
        chunk: Targets in world.
        anchor: Posture and pelvis of the robot.
        fps: Frame rate of the motion [Hz].

    Raises:
        ChunkError: If waist and arms cannot reach a pose without the legs.
        FileFormatError: If the rate or the number of frames is beyond bounds.
    """
    times = chunk.times - chunk.t_obs
    if not (FPS_MIN <= fps <= FPS_MAX and times[-1] * fps < STEPS_MAX):
        raise FileFormatError(
            f"{times[-1]:.6g} s at {fps:.6g} Hz; a rate of {FPS_MIN:g} to {FPS_MAX:g} Hz and fewer than {STEPS_MAX} "
            "frames are expected"
        )
    # The last step has a frame, in which the rate may have it a little later; a rounding error must not cost one more.
    at = np.arange(int(np.ceil(times[-1] * fps - 1e-9)) + 1) / fps
    T_l, T_r = (
        inverse(anchor.T_world_base) @ interpolate(T, times, at) for T in (chunk.T_world_lhand, chunk.T_world_rhand)
    )
    q_body = upper_body_joints(T_l, T_r, anchor.q_body, robot=anchor.robot)
    return Motion(float(fps), np.tile(anchor.T_world_base, (len(at), 1, 1)), q_body, anchor.robot)


def _write(path: Path, chunk: ActionChunk, to: str | ActionSpec, anchor: Anchor, start: dict) -> None:
    spec = as_spec(to, anchor.robot)
    start["mask"] = full_mask(spec)
    write_chunk_file(path, ChunkFile(spec, encode(spec, chunk, anchor), chunk.fps, chunk.t_obs, **start))


def _start_of(file: ChunkFile) -> dict:
    """The start of a file in full, so that relative layouts find their reference again."""
    if file.q0_base is None and not file.q0_joints:
        return {}
    anchor = file.anchor()
    quat = matrix_to_quaternion(anchor.T_world_base[:3, :3], "xyzw")
    angles = np.concatenate([anchor.q_body, anchor.q_lhand, anchor.q_rhand])
    return {
        "q0_base": np.concatenate([anchor.T_world_base[:3, 3], quat]),
        "q0_joints": dict(zip(anchor.robot.joint_names, angles.tolist(), strict=True)),
    }
