"""How near a chunk and its plan come to what stands around the robot: the planner sees none of it.

What cannot be moved counts: furniture, not the objects on it. The hands are looked at where the chunk asks them to be,
fingers as they are there, whatever the body does. A hand that meets something yields and stays outside: what is asked
of it inside is a palm that is as far off. Nothing bounds the force of an arm, a leg or the trunk that does.
"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from models.conversion import Conversion
from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio
from models.spec import RobotSpec
from policy.chunk import ActionChunk
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.trajectory import GRID
from wholebody.sim.scene_file import scene_of

SEEN = 0.1
"""Distance up to which shapes are measured [m]; chosen: there is room beyond it."""
SCENE_SPACING = 0.04
"""Time from one posture of a plan that is measured to the next [s]; chosen: 4 cm at 1 m/s."""
SCALE = 1e-3
"""Depth that counts as one [m]; chosen: the rounding of files."""
INTO_SCENE_MAX = 2e-3
"""How far what is no hand may be planned into the scene [m]; chosen: the error of a plan that is followed."""


class SceneDistance:
    """Measures distances of the robot from a scene.

    Args:
        spec: The robot. scene: Name of a scene of `models.scenes`, or a MuJoCo file (.xml).
        gives: How far a hand may be asked into the scene, and be as far off [m].

    Raises:
        RobotSpecError: If there is no such scene.
    """

    def __init__(self, spec: RobotSpec, scene: str, gives: float) -> None:
        m = self._model = load_mujoco(spec, scene=scene_of(scene))
        self._data, pin_model = mujoco.MjData(m), load_pinocchio(spec)
        self._conversion = Conversion(spec, pin_model, m)
        solid = (m.geom_contype != 0) | (m.geom_conaffinity != 0)
        mine = m.body_rootid[m.geom_bodyid] == m.body_rootid[m.body(spec.base_body).id]
        plane = m.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        still = m.body_weldid[m.geom_bodyid] == 0
        self._scene = np.flatnonzero(solid & still & ~mine & ~plane)
        self._robot, self._gives = np.flatnonzero(solid & mine), np.full(m.ngeom, INTO_SCENE_MAX)
        self._wrists = [m.body(tool.wrist_frame).id for tool in spec.tools]
        self._hands = [
            np.array([g for g in self._robot if wrist in self._carriers(int(m.geom_bodyid[g]))])
            for wrist in self._wrists
        ]
        self._gives[np.concatenate(self._hands)] = gives

    def asked(self, chunk: ActionChunk) -> Margin | None:
        """Least room of the hands, but for those that are to touch something, where a chunk asks them to be."""
        m, d, found = self._model, self._data, []
        apart = [geoms for geoms, told in zip(self._hands, chunk.pushes, strict=True) if not told]
        mujoco.mj_resetDataKeyframe(m, d, m.key("stance").id)
        mujoco.mj_kinematics(m, d)
        shapes = [self._from_wrist(wrist, geoms) for wrist, geoms in zip(self._wrists, self._hands, strict=True)]
        for k in range(len(chunk)):
            for T, geoms, (p, R) in zip((chunk.T_world_lhand, chunk.T_world_rhand), self._hands, shapes, strict=True):
                d.geom_xpos[geoms] = T[k, :3, 3] + p @ T[k, :3, :3].T
                d.geom_xmat[geoms] = (T[k, :3, :3] @ R).reshape(-1, 9)
            found += [(k / chunk.fps, *one) for geoms in apart for one in self._nearest(geoms)]
        return self._worst(found, chunk.fps)

    def planned(self, plan: ChunkPlan, chunk: ActionChunk) -> Margin | None:
        """Least room of the robot along a plan of a chunk."""
        m, d, track, found = self._model, self._data, plan.trajectory, []
        touching = [geoms for geoms, told in zip(self._hands, chunk.pushes, strict=True) if told]
        apart = np.setdiff1d(self._robot, np.concatenate([*touching, []]))
        mujoco.mj_resetDataKeyframe(m, d, m.key("stance").id)
        for row in range(0, len(track.q), round(SCENE_SPACING / GRID)):
            self._conversion.to_mujoco(track.q[row], track.v[row], d.qpos, d.qvel)
            mujoco.mj_kinematics(m, d)
            time = plan.start + row * GRID / plan.rate
            found += [(time, *one) for one in self._nearest(apart)]
        return self._worst(found, chunk.fps)

    def _carriers(self, body: int) -> set[int]:
        """A body and those that carry it."""
        found = {body}
        while body:
            body = int(self._model.body_parentid[body])
            found.add(body)
        return found

    def _from_wrist(self, wrist: int, geoms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (n, 3) and rotations (n, 3, 3) of shapes in the axes of a wrist."""
        d = self._data
        R, p = d.xmat[wrist].reshape(3, 3), d.xpos[wrist]
        return (d.geom_xpos[geoms] - p) @ R, R.T @ d.geom_xmat[geoms].reshape(-1, 3, 3)

    def _nearest(self, geoms: np.ndarray) -> Iterator[tuple[float, int, int]]:
        """The pair of one of these shapes and one of the scene with the least room, with its distance [m]."""
        m, d, gives, best = self._model, self._data, self._gives, (SEEN, -1, -1)
        for other in self._scene.tolist():
            # Spheres around the shapes first; a box is nearer to a point than its corner.
            at = (d.geom_xpos[geoms] - d.geom_xpos[other]) @ d.geom_xmat[other].reshape(3, 3)
            around = m.geom_aabb[other]
            gap = np.linalg.norm(np.maximum(np.abs(at - around[:3]) - around[3:], 0.0), axis=1) - m.geom_rbound[geoms]
            least = best[0] + (gives[best[1]] if best[1] >= 0 else 0.0)
            for geom in geoms[gap + gives[geoms] < least].tolist():
                distance = mujoco.mj_geomDistance(m, d, geom, other, SEEN, None)
                if distance < SEEN and distance + gives[geom] < least:
                    best, least = (distance, geom, other), distance + gives[geom]
        if best[1] >= 0:
            yield best

    def _worst(self, found: list[tuple[float, float, int, int]], fps: float) -> Margin | None:
        if not found:
            return None
        time, distance, geom, other = min(found, key=lambda one: one[1] + self._gives[one[2]])
        bound = -float(self._gives[geom])
        m = self._model
        names = m.body(m.geom_bodyid[geom]).name, m.geom(other).name or m.body(m.geom_bodyid[other]).name
        room = distance - bound
        share = room / SCALE if room >= 0.0 else min(room / SCALE, -1.0)
        return Margin(
            code=Limit.SCENE_DISTANCE, subject=" - ".join(names), time=time, step=max(round(time * fps), 0),
            value=distance, bound=bound, unit="m", margin=room, share=share,
        )  # fmt: skip
