"""Chunk files: raw actions with their spec as ``.npz``, readable and writable without pickle.

=============  ========  ==================================================================================
``actions``    needed    (H, A) float, raw actions in the units of the spec
``fps``        needed    steps per second [Hz]
``spec``       needed    name of a built-in layout, or the JSON of a spec
``t_obs``      optional  time of step 0 [s]
``q0_base``    optional  pelvis that the actions are relative to: x y z [m], quaternion x y z w
``q0_names``   optional  joint names of ``q0_joints``
``q0_joints``  optional  joint angles at step 0 [rad]
``mask``       optional  numbers (A,), steps (H,) or both (H, A) that are there, bool; needed by a layout with a mask
=============  ========  ==================================================================================

Without ``q0_base`` the actions are anchored at the nominal stance; joints that are not given are the stance's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode
from policy.action_spec.frame_guess import pelvis_guess
from policy.action_spec.spec import ActionSpec
from policy.archive import read_arrays
from policy.chunk import ActionChunk
from policy.errors import FileFormatError, RotationError, SpecError, did_you_mean
from policy.geometry.rotations import quaternion_to_matrix
from policy.geometry.se3 import inverse, make_transform, yaw_frame
from policy.reading import SPEC_MAX, STEPS_MAX, ReadingError, require_rate
from policy.recorded.exports import of_a_person
from policy.writing import whole

KEYS = ("actions", "fps", "spec", "t_obs", "q0_base", "q0_names", "q0_joints", "mask")
UPRIGHT_MIN, BASE_FAR = 0.5, 0.5
"""Least cosine of a standing pelvis's tilt [no unit], and its distance from the midpoint of the soles along an axis
from which a chunk has a note [m]; chosen: past what balance allows."""
TIME_MAX = 1e9
"""Largest time of a step 0 [s]: thirty years."""


@dataclass(frozen=True)
class ChunkFile:
    """What a chunk file says.

    Attributes:
        spec: Meaning of the numbers.
        actions: Raw actions, shape (H, A).
        fps: Steps per second [Hz].
        t_obs: Time of step 0 [s].
        q0_base: Pelvis at step 0, ``[x y z qx qy qz qw]``, or None.
        q0_joints: Joint angles at step 0 by name [rad]; may be empty.
        mask: Which numbers are there, as `policy.action_spec.mask.unmasked` takes it, or None.
    """

    spec: ActionSpec
    actions: np.ndarray
    fps: float
    t_obs: float = 0.0
    q0_base: np.ndarray | None = None
    q0_joints: dict[str, float] | None = None
    mask: np.ndarray | None = None

    def anchor(self) -> Anchor:
        """Pelvis and state that the actions refer to; what the file does not say is the nominal stance.

        Raises:
            SpecError: If a joint does not exist.
            RotationError: If the quaternion is not a unit quaternion.
        """
        robot = self.spec.robot
        nominal, n = Anchor.nominal(robot=robot), len(robot.body_joints)
        q = np.concatenate([nominal.q_body, nominal.q_lhand, nominal.q_rhand])
        for name, angle in (self.q0_joints or {}).items():
            if name not in robot.joint_names:
                known = ", ".join(robot.joint_names)
                raise SpecError(
                    f"q0_names has the joint '{name}', which the robot lacks; "
                    f"{did_you_mean(name, robot.joint_names)}joints: {known}"
                )
            q[robot.joint_names.index(name)] = angle
        T, stance = nominal.T_world_base, None
        if self.q0_base is not None:
            T = make_transform(quaternion_to_matrix(self.q0_base[3:], "xyzw"), self.q0_base[:3])
        legs = {robot.joint_names[i] for side in ("left", "right") for i in robot.limbs[f"{side}_leg"]}
        if not legs & set(self.q0_joints or {}):
            # Legs that are not given do not say where the soles are: they are on the floor, as in the stance.
            stance = yaw_frame(T) @ inverse(nominal.T_world_base)
            stance[2, 3] = 0.0
        return Anchor(T, q[:n], *robot.by_hand(q[n:]), robot, stance)

    def chunk(self) -> ActionChunk:
        """The actions in world.

        Raises:
            ChunkError: If they are malformed.
            SpecError: If a joint does not exist.
            RotationError: If ``q0_base`` has no unit quaternion.
        """
        chunk = decode(self.spec, self.actions, self.anchor(), t_obs=self.t_obs, fps=self.fps, mask=self.mask)
        if self.q0_base is None or np.abs(self.q0_base[:2]).max() <= BASE_FAR:
            return chunk
        x, y = self.q0_base[:2]
        far = f"q0_base has the pelvis at x {x:.3g}, y {y:.3g} m: its place over the midpoint of the soles is expected"
        return replace(chunk, notes=(*chunk.notes, f"{far}, not that in a room"))


def read_chunk_file(path: str | Path, *, assume: ActionSpec | None = None, robot: RobotSpec | None = None) -> ChunkFile:
    """Read a chunk file.

    Args:
        path: The file.
        assume: Spec that the user vouches for (``--assume-spec``); replaces what the file says.
        robot: The robot that it is for; the G1 with Dex3 hands if None.

    Raises:
        FileFormatError: If the file is malformed; says what would work.
    """
    path = Path(path)
    try:
        return _read(path, read_arrays(path, KEYS), assume, robot)
    except OSError as error:
        raise FileFormatError(f"cannot be read: {error.strerror or error}", path=str(path)) from error
    except ReadingError as error:
        how = of_a_person(path)
        raise FileFormatError(f"{error}; {how}" if how else str(error), path=str(path)) from error


def _read(path: Path, arrays: dict[str, np.ndarray], assume: ActionSpec | None, robot: RobotSpec | None) -> ChunkFile:
    needed = ("actions", "fps") if assume else ("actions", "fps", "spec")
    missing = [key for key in needed if key not in arrays]
    if missing:
        raise FileFormatError(
            f"lacks {missing}; a chunk file has actions (H, A), fps and spec (a built-in name or JSON)"
            + ("; say --assume-spec NAME if you know the layout" if missing == ["spec"] else ""),
            path=str(path),
        )
    spec = assume or _spec(arrays["spec"], path, robot)
    actions = _numbers(arrays, "actions", path)
    if actions.ndim != 2 or actions.shape[1] != spec.dim or not 1 <= len(actions) <= STEPS_MAX:
        text = f"actions has shape {actions.shape}; '{spec.name}' needs (steps, {spec.dim}), at most {STEPS_MAX} steps"
        raise FileFormatError(text, path=str(path))
    fps = _single(arrays, "fps", path)
    require_rate("fps", fps)
    t_obs = _single(arrays, "t_obs", path) if "t_obs" in arrays else 0.0
    if abs(t_obs) > TIME_MAX:
        text = f"t_obs is {t_obs:g} s; at most {TIME_MAX:g} s are read: count it from a start of your own"
        raise FileFormatError(text, path=str(path))
    file = ChunkFile(
        spec=spec,
        actions=actions,
        fps=fps,
        t_obs=t_obs,
        q0_base=_base(arrays, path),
        q0_joints=_joints(arrays, path),
        mask=arrays.get("mask"),
    )
    try:
        anchor = file.anchor()
    except (SpecError, RotationError) as error:
        raise FileFormatError(str(error), path=str(path)) from error
    if assume is None and arrays["spec"].astype(str).item().strip() == spec.name:
        # A name without a version says the last one; files from before it are not to be carried out in another frame.
        with np.errstate(over="ignore", invalid="ignore"):
            for guess in pelvis_guess(spec, actions, anchor):
                stance = f"'{spec.name}' is {spec.id}: --assume-spec {spec.name} reads them in the stance"
                raise FileFormatError(f"{guess}; {stance}", path=str(path))
    return file


def write_chunk_file(path: str | Path, file: ChunkFile) -> None:
    """Write a chunk file, its spec as JSON with the hash beside it; the name is kept as it is given."""
    arrays: dict[str, Any] = {
        "actions": np.asarray(file.actions, dtype=float),
        "fps": np.float64(file.fps),
        "spec": np.str_(file.spec.to_json()),
        "t_obs": np.float64(file.t_obs),
    }
    if file.q0_base is not None:
        arrays["q0_base"] = np.asarray(file.q0_base, dtype=float)
    if file.q0_joints:
        arrays["q0_names"] = np.array(list(file.q0_joints))
        arrays["q0_joints"] = np.array(list(file.q0_joints.values()), dtype=float)
    if file.mask is not None:
        arrays["mask"] = np.asarray(file.mask)
    # np.savez would append ".npz" to another name.
    with whole(path) as place, place.open("wb") as stream:
        np.savez_compressed(stream, **arrays)


def _spec(value: np.ndarray, path: Path, robot: RobotSpec | None) -> ActionSpec:
    if value.shape != () or value.dtype.kind not in "US":
        raise FileFormatError("spec must be one string: the name of a built-in layout, or JSON", path=str(path))
    item = value.item()
    text = item.decode("utf-8", "replace") if isinstance(item, bytes) else item
    if len(text) > SPEC_MAX:
        raise FileFormatError(f"spec has {len(text)} characters; at most {SPEC_MAX} are read", path=str(path))
    try:
        named = not text.lstrip().startswith("{")
        return builtin(text.strip(), robot) if named else ActionSpec.from_json(text, robot)
    except SpecError as error:
        raise FileFormatError(str(error), path=str(path)) from error


def _numbers(arrays: dict[str, np.ndarray], key: str, path: Path) -> np.ndarray:
    value = arrays[key]
    if value.dtype.kind not in "fiu":
        raise FileFormatError(f"{key} is of type {value.dtype}; numbers are expected", path=str(path))
    with np.errstate(over="ignore"):
        # Long doubles reach further than what we compute with.
        value = value.astype(float)
    bad = ~np.isfinite(value)
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        at = list(index) or ""
        raise FileFormatError(f"{key}{at} is {value[index]}; finite numbers are expected", path=str(path))
    return value


def _single(arrays: dict[str, np.ndarray], key: str, path: Path) -> float:
    value = _numbers(arrays, key, path)
    if value.size != 1:
        raise FileFormatError(f"{key} has shape {value.shape}; a single number is expected", path=str(path))
    return float(value.reshape(())) if value.ndim == 0 else float(value.ravel()[0])


def _base(arrays: dict[str, np.ndarray], path: Path) -> np.ndarray | None:
    if "q0_base" not in arrays:
        return None
    value = _numbers(arrays, "q0_base", path)
    if value.shape != (7,):
        raise FileFormatError(
            f"q0_base has shape {value.shape}; seven numbers x y z qx qy qz qw are expected", path=str(path)
        )
    up = _upright(value[3:])
    if up < UPRIGHT_MIN:
        other = _upright(np.roll(value[3:], -1)) >= UPRIGHT_MIN
        hint = "; w first? the quaternion is x y z w" if other else ""
        tilt = np.rad2deg(np.arccos(np.clip(up, -1.0, 1.0)))
        raise FileFormatError(f"q0_base tilts the pelvis by {tilt:.0f} deg: no robot stands so{hint}", path=str(path))
    return value


def _upright(quaternion: np.ndarray) -> float:
    """Cosine of the tilt of a pelvis, 1 where it is no quaternion, which is told elsewhere."""
    x, y, z, w = quaternion
    size = x * x + y * y + z * z + w * w
    return 1.0 - 2.0 * (x * x + y * y) / size if size > 0.0 else 1.0


def _joints(arrays: dict[str, np.ndarray], path: Path) -> dict[str, float]:
    if ("q0_names" in arrays) != ("q0_joints" in arrays):
        raise FileFormatError("q0_names and q0_joints only go together", path=str(path))
    if "q0_names" not in arrays:
        return {}
    names, angles = arrays["q0_names"], _numbers(arrays, "q0_joints", path)
    if names.dtype.kind != "U" or names.ndim != 1 or names.shape != angles.shape:
        raise FileFormatError(
            f"q0_names {names.dtype} {names.shape} and q0_joints {angles.shape}; a list of joint names and as many "
            "angles in radians are expected",
            path=str(path),
        )
    if len(set(names.tolist())) != len(names):
        raise FileFormatError("q0_names has a joint twice", path=str(path))
    return dict(zip(names.tolist(), angles.tolist(), strict=True))
