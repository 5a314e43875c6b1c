"""Recorded whole-body motion of the G1 as CSV: 36 columns a frame, no header.

Root position x y z [m], root quaternion x y z w, then the 29 body joints in motor order [rad]: the format of the
public retargeted LAFAN1 and AMASS files for the G1. There are no hands in it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.slot_values import NOT_FOLLOWED
from policy.chunk import ActionChunk
from policy.errors import ChunkError, FileFormatError, RotationError
from policy.geometry.rotations import angle_between, matrix_to_quaternion, quaternion_to_matrix
from policy.geometry.se3 import interpolate, make_transform
from policy.kinematics.forward import kinematics
from policy.reading import FPS_MAX, FPS_MIN, STEPS_MAX, ReadingError, read_text
from policy.suspicion.corrections import ROWS, Table, corrected, require_known
from policy.writing import whole

ROOT_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
"""Columns of the root; those of the body joints follow, 36 in all of the G1."""
DEFAULT_FPS = 60.0
RATES = (30.0, 50.0, 60.0, 100.0, 120.0)
"""Frame rates of public motions [Hz]."""
CHUNK_FPS = 30.0
CSV_QUATERNION_TOLERANCE = 1e-2
"""Retargeted files carry three to six digits."""
FILE_MAX = 80 * 2**20
"""Largest file [bytes]: `STEPS_MAX` rows of 36 numbers with eight digits."""
HANDS_ONLY = "hands only: the feet of this motion "
"""How a note begins that says that root and legs of a motion are not followed."""
FEET_MOVE, FEET_TURN = 0.25, np.deg2rad(45.0)
"""How far a pelvis goes or turns at most while the feet may stay [m, rad]; chosen: a lean, a twist of the legs."""
HANDS = {"lhand": "left", "rhand": "right"}
"""Sides of the wrists' frames."""
STRAY_MAX = 0.02, np.deg2rad(10.0)
"""How far a frame may be off the way from step to step [m, rad]: what verdicts call as given."""
_NAMED_RATE = re.compile(r"(?<![a-z0-9])(?:(\d{2,3}) ?(?:hz|fps)|(?:hz|fps) ?(\d{2,3}))(?![a-z0-9])", re.IGNORECASE)
_MAGNITUDE_MAX = 1e3
"""Neither metres nor radians of a motion come near it: such a file has another unit or is damaged."""


@dataclass(frozen=True)
class Motion:
    """A recorded whole-body motion.

    Attributes:
        fps: Frames per second [Hz].
        T_world_base: Pelvis, shape (n, 4, 4).
        q_body: Body joints in motor order, shape (n, m), [rad]; 29 of the G1.
        robot: The robot that moves; the G1 with Dex3 hands if not given.
    """

    fps: float
    T_world_base: np.ndarray
    q_body: np.ndarray
    robot: RobotSpec = field(default_factory=g1, repr=False)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.q_body)

    @property
    def duration(self) -> float:
        """Time from the first to the last frame [s]."""
        return (len(self) - 1) / self.fps


def read_motion_csv(
    path: str | Path, fps: float = DEFAULT_FPS, robot: RobotSpec | None = None, *, read_as: Sequence[str] = ()
) -> Motion:
    """Read a motion.

    Args:
        path: The file.
        fps: Its frame rate [Hz]; the file does not say it.
        robot: The robot that moves; the G1 with Dex3 hands if None.
        read_as: What it is to be read as instead of what its columns are called, of
            `policy.suspicion.corrections.READ_AS`.

    Raises:
        FileFormatError: Naming row and column of what is wrong.
    """
    path, robot = Path(path), robot or g1()
    columns = (*ROOT_COLUMNS, *robot.body_joints)
    if not FPS_MIN <= fps <= FPS_MAX:
        text = f"fps is {fps}; a positive rate in Hz is expected, {FPS_MIN:g} to {FPS_MAX:g}, such as {DEFAULT_FPS:g}"
        raise FileFormatError(text, path=str(path))
    return motion_of(_read_table(path, columns), fps, robot, read_as, str(path))


def motion_of(table: np.ndarray, fps: float, robot: RobotSpec, read_as: Sequence[str], path: str) -> Motion:
    """Motion of a table (n, 7 + m): root position, its quaternion x y z w, joints in motor order.

    Args:
        table: Numbers [m], [rad].
        fps: Frames per second [Hz].
        robot: The robot that moves.
        read_as: As of `read_motion_csv`.
        path: Where it is from, for messages.

    Raises:
        FileFormatError: Naming row and column of what is wrong.
    """
    columns = (*ROOT_COLUMNS, *robot.body_joints)
    table, fps = _as_said(table, fps, robot, read_as)
    bad = ~np.isfinite(table) | (np.abs(table) > _MAGNITUDE_MAX)
    if bad.any():
        row, column = (int(i) for i in np.argwhere(bad)[0])
        raise FileFormatError(
            f"line {row + 1}, column {column + 1} ({columns[column]}) is {table[row, column]:g}; "
            f"a finite number of metres or radians below {_MAGNITUDE_MAX:g} is expected",
            path=path,
        )
    try:
        R = quaternion_to_matrix(table[:, 3:7], "xyzw", tolerance=CSV_QUATERNION_TOLERANCE)
    except RotationError as error:
        norms = np.linalg.norm(table[:, 3:7], axis=1)
        row = int(np.argmax(np.abs(norms - 1.0) > CSV_QUATERNION_TOLERANCE))
        raise FileFormatError(
            f"line {row + 1}: columns 4 to 7 have norm {norms[row]:.4g}, not 1; they must be the root quaternion "
            "in the order x y z w",
            path=path,
        ) from error
    return Motion(float(fps), make_transform(R, table[:, :3]), table[:, 7:], robot)


def named_rate(path: str | Path) -> float | None:
    """Frame rate that the name of a motion file says, as ``walk_30hz.csv`` [Hz]; None if it says none or several."""
    found = {float(before or after) for before, after in _NAMED_RATE.findall(Path(path).stem)}
    return found.pop() if len(found) == 1 else None


def rate_note(motion: Motion, path: str | Path) -> str:
    """Note on a frame rate that was read from a file's name or assumed, with other likely rates."""
    if named_rate(path) == motion.fps:
        return f"frame rate by the file's name: {motion.fps:g} Hz; if that is another, say --fps"
    speed = np.abs(np.diff(motion.q_body, axis=0)).max(axis=0, initial=0.0)
    most = motion.robot.velocity_max[[motion.robot.joint_names.index(name) for name in motion.robot.body_joints]]
    others = [f"{rate:g}" for rate in RATES if rate != motion.fps and (rate * speed <= most).all()]
    *first, last = others or [""]
    would = f"; {', '.join(first)}{' or ' if first else ''}{last} Hz would fit too" if others else ""
    fastest = f"joints up to {motion.fps * speed.max(initial=0.0):.2g} rad/s"
    return (
        f"{motion.fps:g} Hz assumed, the file does not say its frame rate (say --fps): {motion.duration:.1f} s in all "
        f"and {fastest}{would}"
    )


def _as_said(table: np.ndarray, fps: float, robot: RobotSpec, read_as: Sequence[str]) -> tuple[np.ndarray, float]:
    require_known(read_as)
    if not read_as:
        return table, fps
    names = ("",) * len(ROOT_COLUMNS)
    joints = corrected(
        Table(robot.body_joints, table[:, len(names) :], fps, robot), [x for x in read_as if x not in ROWS]
    )
    joined = np.hstack([table[:, : len(names)], joints.values])
    rows = corrected(Table((*names, *robot.body_joints), joined, fps, robot),
                     [x for x in read_as if x in ROWS])  # fmt: skip
    table = rows.values.copy()
    if "millimetres" in read_as:
        table[:, :3] *= 1e-3
    if "w_first" in read_as:
        table[:, 3:7] = table[:, [4, 5, 6, 3]]
    return table, rows.fps


def write_motion_csv(path: str | Path, motion: Motion) -> None:
    """Write a motion with six digits, as the public files do. The frame rate is not part of the file."""
    quat = matrix_to_quaternion(motion.T_world_base[:, :3, :3], "xyzw")
    table = np.hstack([motion.T_world_base[:, :3, 3], quat, motion.q_body])
    with whole(path) as place:
        np.savetxt(place, table, fmt="%.6f", delimiter=",")


def motion_chunk(motion: Motion, *, fps: float = CHUNK_FPS) -> ActionChunk:
    """The whole motion as one long chunk of a standing robot.

    The wrists are taken relative to each frame's own pelvis (root translation, yaw and tilt are dropped), resampled on
    SE(3) from the first frame to the last, and anchored once, at the nominal stance. Fingers are neutral. A note says
    where frames between the steps are further off than `STRAY_MAX`.

    Args:
        motion: What was recorded.
        fps: Rate of the chunk [Hz]; a little more where its steps would not end with the last frame.

    Raises:
        ChunkError: If that is more than `STEPS_MAX` steps.
    """
    anchor = Anchor.nominal(robot=motion.robot)
    if not motion.duration * fps < STEPS_MAX:
        raise ChunkError(
            f"the motion lasts {motion.duration:.6g} s, {motion.duration * fps:.6g} steps at {fps:g} Hz; at most "
            f"{STEPS_MAX} are taken: is its frame rate {motion.fps:g} Hz?"
        )
    poses = kinematics(motion.robot).poses(motion.q_body)
    times = np.arange(len(motion)) / motion.fps
    # A rounding error must not cost a step more.
    last = int(np.ceil(motion.duration * fps - 1e-9))
    if last > motion.duration * fps + 1e-9:
        fps = last / motion.duration
    at = np.arange(last + 1) / fps
    steps = {hand: interpolate(poses[hand], times, at) for hand in HANDS}
    T_l, T_r = (anchor.T_world_base @ steps[hand] for hand in HANDS)
    q_l, q_r = (np.tile(q, (len(at), 1)) for q in (anchor.q_lhand, anchor.q_rhand))
    layout = builtin("wbc32", motion.robot).id
    left_out = frames_between({hand: poses[hand] for hand in HANDS}, steps, times, at)
    chunk = ActionChunk(layout, 0, 0.0, float(fps), T_l, T_r, q_l, q_r, notes=_of_feet(motion) + left_out)
    chunk.validate(robot=motion.robot)
    return chunk


def frames_between(
    frames: dict[str, np.ndarray], steps: dict[str, np.ndarray], times: np.ndarray, at: np.ndarray
) -> tuple[str, ...]:
    """Note on frames between steps that are off the way from step to step, and by how much the farthest is."""
    far, count = {}, np.zeros(len(times), dtype=bool)
    for hand, T in frames.items():
        way = interpolate(steps[hand], at, times)
        away = np.linalg.norm(way[:, :3, 3] - T[:, :3, 3], axis=1)
        turned = angle_between(way[:, :3, :3], T[:, :3, :3])
        share = np.maximum(away / STRAY_MAX[0], turned / STRAY_MAX[1])
        row = int(share.argmax())
        far[HANDS[hand]] = share[row], away[row], turned[row], row
        count |= share > 1.0
    if not count.any():
        return ()
    hand, (_, away, turned, row) = max(far.items(), key=lambda one: one[1])
    where = f"{hand} hand {away * 1e3:.0f} mm and {np.rad2deg(turned):.0f} deg off at row {row} ({times[row]:.2f} s)"
    rate = (len(at) - 1) / times[-1]
    left_out = f"{count.sum()} of {len(times)} rows, between steps of {rate:.3g} Hz, {NOT_FOLLOWED}"
    return (f"what happens in {left_out}: {where} at worst",)


def travels(motion: Motion) -> tuple[float, float] | None:
    """How far a pelvis goes [m] and turns [rad] that moves further than feet that stay allow; None of another."""
    p, yaw = motion.T_world_base[:, :2, 3], headings(motion)
    away, turned = float(np.linalg.norm(p - p[0], axis=1).max()), float(np.abs(yaw - yaw[0]).max())
    return (away, turned) if away > FEET_MOVE or turned > FEET_TURN else None


def headings(motion: Motion) -> np.ndarray:
    """Heading of the pelvis in each frame, shape (n,), without jumps [rad]."""
    R = motion.T_world_base[:, :3, :3]
    return np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))


def _of_feet(motion: Motion) -> tuple[str, ...]:
    """Note on a motion whose pelvis moves further than feet that stay allow."""
    if (far := travels(motion)) is None:
        return ()
    (away, turned), p = far, motion.T_world_base[:, :2, 3]
    path = float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum())
    parts = [f"travel {path:.1f} m"] if away > FEET_MOVE else []
    parts += [f"turn by {np.rad2deg(turned):.0f} deg"] if turned > FEET_TURN else []
    return (HANDS_ONLY + " and ".join(parts),)


def _read_table(path: Path, columns: tuple[str, ...]) -> np.ndarray:
    try:
        text = read_text(path, FILE_MAX)
    except OSError as error:
        raise FileFormatError(f"cannot be read: {error.strerror}", path=str(path)) from error
    except ReadingError as error:
        raise FileFormatError(f"{error}; a CSV file of numbers is expected", path=str(path)) from error
    rows = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if not 1 <= len(rows) <= STEPS_MAX:
        text = f"has {len(rows)} rows" if rows else "is empty"
        text += f"; rows of {len(columns)} numbers are expected, at most {STEPS_MAX}"
        raise FileFormatError(text, path=str(path))
    for number, line in rows:
        if line.count(",") != len(columns) - 1:
            raise FileFormatError(
                f"line {number} has {line.count(',') + 1} columns; {len(columns)} are expected: root x y z, "
                f"root quaternion x y z w, {len(columns) - len(ROOT_COLUMNS)} joints in motor order"
                f"{_columns_hint(line, len(columns))}",
                path=str(path),
            )
    table = np.empty((len(rows), len(columns)))
    for i, (number, line) in enumerate(rows):
        table[i] = [_number(field, number, j, columns, path) for j, field in enumerate(line.split(","))]
    return table


def _columns_hint(line: str, columns: int) -> str:
    """What a row of another number of columns may be, and what makes it one that is read."""
    count = line.count(",") + 1
    if any(character.isalpha() and character not in "eE" for character in line):
        return "; it has words in it: tail -n +2 leaves out a line of names"
    if count == 1 and len(re.split(r"[\s;]+", line.strip())) == columns:
        return "; a comma is expected between numbers: tr -s ' \\t;' ',' writes it"
    if count == columns + 1:
        return "; one in front, of time or a number of rows, is left out by cut -d, -f2-"
    if count == len(ROOT_COLUMNS) + 23:
        return "; of a G1 with 23 joints write a .npz with root_pos, root_rot, dof_pos and fps, which is read"
    return ""


def _number(field: str, row: int, column: int, columns: tuple[str, ...], path: Path) -> float:
    try:
        return float(field)
    except ValueError as error:
        raise FileFormatError(
            f"line {row}, column {column + 1} ({columns[column]}) is {field.strip()[:60]!r}, no number; "
            f"a file without a header is expected{': tail -n +2 leaves it out' if row == 1 else ''}",
            path=str(path),
        ) from error
