"""Retargeted motions as ``.npz``: of GMR, of PHC and ASAP, of Isaac Lab (AMP), of BeyondMimic. No pickle.

========================  ===================================================  ===========================  ==========
of                        root                                                 joints                       quaternion
========================  ===================================================  ===========================  ==========
GMR                       ``root_pos``, ``root_rot``                           ``dof_pos``, motor order     x y z w
PHC, ASAP                 ``root_trans_offset``, ``root_rot``                  ``dof``, motor order         x y z w
Isaac Lab's AMP           ``body_positions``, ``body_rotations`` of the pelvis ``dof_positions``, by names  w x y z
BeyondMimic               ``body_pos_w``, ``body_quat_w`` of the first body    ``joint_pos``, Isaac's order w x y z
========================  ===================================================  ===========================  ==========

Source:
    GMR ``scripts/smplx_to_robot.py``, PHC's G1 retargeting, Isaac Lab ``motions/README.md``, BeyondMimic
    ``scripts/csv_to_npz.py``.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.archive import array_names, read_arrays
from policy.dataset.naming.meaning import meaning
from policy.errors import FileFormatError
from policy.joints import joints_of
from policy.reading import ReadingError, require_rate
from policy.recorded.motion_csv import Motion, motion_of
from policy.suspicion.orders import ISAAC


@dataclass(frozen=True)
class _Kind:
    """How a tool calls its arrays.

    Attributes:
        position, rotation, joints: Names of the root's position and quaternion, and of the joints.
        w_first: Whether quaternions are w x y z.
        isaac: Whether joints are in Isaac's order.
    """

    position: str
    rotation: str
    joints: str
    w_first: bool = False
    isaac: bool = False


KINDS = (
    _Kind("root_pos", "root_rot", "dof_pos"),
    _Kind("root_trans_offset", "root_rot", "dof"),
    _Kind("body_positions", "body_rotations", "dof_positions", w_first=True),
    _Kind("body_pos_w", "body_quat_w", "joint_pos", w_first=True, isaac=True),
)
"""Source: as of this module."""
_MORE = ("fps", "dof_names", "body_names")


def is_motion_npz(path: str | Path) -> bool:
    """Whether an archive has the arrays of a motion; False of what cannot be read, which its reader tells."""
    try:
        return _kind(array_names(Path(path))) is not None
    except (OSError, ReadingError):
        return False


def _kind(names: Collection[str]) -> _Kind | None:
    return next((kind for kind in KINDS if {kind.position, kind.rotation, kind.joints} <= set(names)), None)


def read_motion_npz(
    path: str | Path, fps: float, robot: RobotSpec | None = None, *, read_as: Sequence[str] = ()
) -> tuple[Motion, tuple[str, ...]]:
    """Read a motion, and what was taken for granted.

    Args:
        path: The file.
        fps: Its frame rate where it does not say one [Hz].
        robot: The robot that moves; the G1 with Dex3 hands if None.
        read_as: What it is to be read as instead, of `policy.suspicion.corrections.READ_AS`.

    Raises:
        FileFormatError: Naming the array that is wrong.
    """
    path, robot = Path(path), robot or g1()
    try:
        names = array_names(path)
        kind = _kind(names)
        if kind is None:
            raise FileFormatError("has none of the arrays of a motion", path=str(path))
        wanted = {kind.position, kind.rotation, kind.joints, *_MORE}
        arrays = read_arrays(path, names, wanted=wanted)
        notes: tuple[str, ...] = ()
        if "fps" in arrays and arrays["fps"].size == 1 and arrays["fps"].dtype.kind in "fiu":
            fps = float(arrays["fps"].ravel()[0])
        else:
            notes = (f"its rate is taken as {fps:g} Hz, which the file does not say: --csv-fps says another",)
        require_rate("its rate", fps)
    except OSError as error:
        raise FileFormatError(f"cannot be read: {error.strerror or error}", path=str(path)) from error
    except ReadingError as error:
        raise FileFormatError(str(error), path=str(path)) from error
    position, rotation = (_of_pelvis(arrays, key, path) for key in (kind.position, kind.rotation))
    if kind.w_first:
        rotation = rotation[:, [1, 2, 3, 0]] if rotation.shape[1] == 4 else rotation
    joints, more = _body(arrays, kind, robot, path)
    shapes = (position.shape, rotation.shape, joints.shape)
    n = len(joints)
    if position.shape != (n, 3) or rotation.shape != (n, 4) or not n:
        text = f"{kind.position}, {kind.rotation} and joints have the shapes {shapes}; (n, 3), (n, 4) and (n, joints)"
        raise FileFormatError(f"{text} are expected", path=str(path))
    table = np.hstack([position, rotation, joints])
    return motion_of(table, fps, robot, read_as, str(path)), (*notes, *more)


def _numbers(arrays: Mapping[str, np.ndarray], key: str, path: Path) -> np.ndarray:
    value = arrays[key]
    if value.dtype.kind not in "fiu":
        raise FileFormatError(f"{key} is of type {value.dtype}; numbers are expected", path=str(path))
    with np.errstate(over="ignore"):
        return value.astype(float)


def _of_pelvis(arrays: Mapping[str, np.ndarray], key: str, path: Path) -> np.ndarray:
    """Rows of the pelvis, of an array that has all bodies or the root alone."""
    value = _numbers(arrays, key, path)
    if value.ndim == 3 and value.shape[1]:
        names = _texts(arrays, "body_names")
        return value[:, names.index("pelvis") if "pelvis" in names[: value.shape[1]] else 0]
    if value.ndim != 2:
        raise FileFormatError(f"{key} has shape {value.shape}; a row a frame is expected", path=str(path))
    return value


def _texts(arrays: Mapping[str, np.ndarray], key: str) -> list[str]:
    value = arrays.get(key)
    return [str(one) for one in value.tolist()] if value is not None and value.ndim == 1 else []


def _body(
    arrays: Mapping[str, np.ndarray], kind: _Kind, robot: RobotSpec, path: Path
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Joints (n, m) in motor order, and notes on them."""
    values, body = _numbers(arrays, kind.joints, path), robot.body_joints
    if values.ndim == 3 and values.shape[2] == 1:  # PHC's last axis of one
        values = values[:, :, 0]
    if values.ndim != 2:
        raise FileFormatError(f"{kind.joints} has shape {values.shape}; a row a frame is expected", path=str(path))
    names = [meaning(name, robot=robot).name for name in _texts(arrays, "dof_names")]
    notes: tuple[str, ...] = ()
    if len(names) != values.shape[1]:
        names = list(body)
        if kind.isaac and len(body) == len(ISAAC):
            names, notes = [body[i] for i in ISAAC], ("joints are taken in Isaac's order, as BeyondMimic writes them",)
        if values.shape[1] == len(_few(robot)):
            names = list(_few(robot))
    if len(names) != values.shape[1] or len(set(names)) != len(names):
        text = f"{kind.joints} has {values.shape[1]} joints without 'dof_names'; {len(body)} or {len(_few(robot))}"
        raise FileFormatError(f"{text} in motor order are read", path=str(path))
    found = np.zeros((len(values), len(body)))
    for i, name in enumerate(body):
        if name in names:
            found[:, i] = values[:, names.index(name)]
    absent = [name for name in body if name not in names]
    if absent:
        notes += (f"{len(absent)} joints are not in it and are at 0: {', '.join(absent[:6])}",)
    return found, notes


def _few(robot: RobotSpec) -> tuple[str, ...]:
    """Joints of a G1 with 23, in motor order."""
    short = [*joints_of(robot, "left_arm")[5:], *joints_of(robot, "right_arm")[5:], *joints_of(robot, "waist")[1:]]
    return tuple(name for name in robot.body_joints if name not in short)
