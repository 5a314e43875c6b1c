"""Which hands a robot that steps can follow: near its shoulders while the trunk is upright, and not fast."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from policy.geometry.se3 import make_transform
from wholebody.reference import HandLimits
from wholebody.robot.state import Robot

STRETCHED, HELD = 0.8, 0.92
"""Share of an arm's length up to which a wrist may be from its shoulder that a chunk leads, and that is held where it
is [no unit]; measured: up to 0.92, straight down or up, 2 of 2 walks back fell, and none of them up to 0.8."""
BEHIND, BESIDE = 0.1, 0.12
"""How far behind its shoulder a wrist may be, and how near to the body's axis [m]; chosen: beyond, hands and trunk come
into each other's way."""
ASIDE = 0.05
"""Least distance of a wrist from the body's middle, on its own side [m]; measured: where both were allowed 0.02 m
beyond it, hands came into each other's way and 1 walk of 2 fell, of 5 none that are as far."""

LOWERED = 0.08
"""How much lower the pelvis of a robot that steps is, at most, than as it stands [m]; measured: 5 cm, and
`wholebody.execution.feet.walker.LOWER`."""
INSIDE = 0.005
"""How far inside of those bounds hands are drawn that are beyond [m]; chosen: what rounding and sway come to."""
DRAWS = 12
"""Times that they are drawn into one bound after the other; measured: after 8 none is beyond any of them."""
TOWARDS = 11
"""Shares of the way to a posture that are looked at [no unit]; chosen: a tenth of it apart."""

LOW, BACK, RAMP, OUT = 0.15, 0.1, 0.1, 0.28
"""Height over the pelvis and place ahead of it below which recorded hands are beside the thighs, the way over which
they come to be, and their least distance from the body's middle there [m]; measured: the pelvis sways by 0.1 m, and of
hands behind it 0.22 and 0.24 m aside a walk stopped for them, 0.28 m aside it kept all of their weight."""


class HandsOfWalks:
    """Where the arms of a robot reach while its trunk is upright over its feet.

    Args:
        robot: The robot; its state is not used.
        stance: Of its joints and base, shape (nq,).
    """

    def __init__(self, robot: Robot, stance: np.ndarray) -> None:
        arms = np.concatenate([robot.spec.limbs[f"{side}_arm"] for side in ("left", "right")])
        self._robot, self._stance = robot, stance.copy()
        self._is_arm = np.concatenate([np.zeros(7), np.isin(robot.motor_to_pin, arms)])
        self._frames = (robot.spec.base_body, *(tool.wrist_frame for tool in robot.spec.tools))
        pin.framesForwardKinematics(robot.model, robot.scratch, stance)
        base = robot.scratch.oMf[robot.frame_id(robot.spec.base_body)]
        chains = []
        for side in ("left", "right"):
            joints = [robot.spec.joints[k].name for k in robot.spec.limbs[f"{side}_arm"]]
            ids = [robot.model.getJointId(name) for name in joints]
            chains.append(np.array([base.actInv(robot.scratch.oMi[i]).translation for i in ids]))
        self._shoulders = np.array([chain[0] for chain in chains])
        self._lengths = np.array([np.linalg.norm(np.diff(chain, axis=0), axis=1).sum() for chain in chains])

    def towards(self, q_there: np.ndarray) -> np.ndarray:
        """Wrists in the upright pelvis, shape (2, 4, 4), with arms as near to a posture (nq,) as a walk can have them.

        They are on the way of the joints from the stance to it.
        """
        robot, still = self._robot, self._stance
        low = make_transform(np.eye(3), np.array([0.0, 0.0, -LOWERED]))
        for share in np.linspace(1.0, 0.0, TOWARDS):
            q = still + share * self._is_arm * (q_there - still)
            pin.framesForwardKinematics(robot.model, robot.scratch, q)
            base, *wrists = (robot.scratch.oMf[robot.frame_id(name)] for name in self._frames)
            T = np.stack([base.actInv(wrist).homogeneous for wrist in wrists])
            if all(self.why_not_there(T[:, None, :3, 3], pelvis) is None for pelvis in (np.eye(4), low)):
                break
        return T

    def why_not(self, chunk: ActionChunk, T_pelvis: np.ndarray, limits: tuple[HandLimits, ...]) -> str | None:
        """Why hands of a chunk are none that a walk can have, in words; None where it can.

        Args:
            chunk: The chunk.
            T_pelvis: Pose of the upright robot's pelvis among the chunk's poses, shape (4, 4).
            limits: Of the left and the right hand of a robot that steps.
        """
        hands = np.stack([chunk.T_world_lhand, chunk.T_world_rhand])
        if (fault := self.why_not_there(hands[:, :, :3, 3], T_pelvis)) is not None:
            return fault
        for side, T, most in zip(("left", "right"), hands, limits, strict=True):
            speed = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1).max(initial=0.0) * chunk.fps
            turn = angle_between(T[:-1, :3, :3], T[1:, :3, :3]).max(initial=0.0) * chunk.fps
            if speed > most.position.speed or turn > most.orientation.speed:
                return f"the {side} hand moves at up to {speed:.1f} m/s and {turn:.1f} rad/s"
        return None

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """The nearest wrists that a walk can have, or nearly so, to points (2, n, 3) in the upright pelvis [m].

        They are so, too, once the pelvis is lower by `LOWERED` and they are not.
        """
        p, sides, inside = np.array(points, dtype=float), np.array([[1.0], [-1.0]]), INSIDE
        shoulders = self._shoulders[:, None]
        balls = [(shoulders - np.array([0.0, 0.0, low]), STRETCHED * self._lengths - inside) for low in (0.0, LOWERED)]
        for _ in range(DRAWS):
            p[..., 0] = np.maximum(p[..., 0], shoulders[..., 0] - BEHIND + inside)
            low, back = (np.clip((top - p[..., i]) / RAMP, 0.0, 1.0) for i, top in ((2, LOW), (0, BACK)))
            p[..., 1] = sides * np.maximum(sides * p[..., 1], ASIDE + inside + (OUT - ASIDE) * low * back)
            p[..., :2] *= np.maximum((BESIDE + inside) / np.linalg.norm(p[..., :2], axis=-1), 1.0)[..., None]
            for middle, radius in balls:
                away = np.linalg.norm(p - middle, axis=-1)
                p = middle + (p - middle) * np.minimum(radius[:, None] / np.maximum(away, inside), 1.0)[..., None]
        return p

    def why_not_there(self, points: np.ndarray, T_pelvis: np.ndarray, most: float = STRETCHED) -> str | None:
        """Why a walk cannot have its wrists at points (2, n, 3) [m], in words; None where it can.

        Args:
            points: Of the left and the right wrist, among the poses that the pelvis' is one of.
            T_pelvis: Pose of the upright robot's pelvis, shape (4, 4).
            most: Share of an arm's length up to which they may be from their shoulders.
        """
        for i, (side, outwards) in enumerate((("left", 1.0), ("right", -1.0))):
            p = (points[i] - T_pelvis[:3, 3]) @ T_pelvis[:3, :3]
            away = np.linalg.norm(p - self._shoulders[i], axis=1).max() / self._lengths[i]
            near = np.linalg.norm(p[:, :2], axis=1).min()
            if away > most:
                return f"the {side} hand is {away:.2f} arm lengths from its shoulder, {most:g} are walked with"
            if (outwards * p[:, 1]).min() < ASIDE or near < BESIDE or p[:, 0].min() < self._shoulders[i, 0] - BEHIND:
                return f"the {side} hand is behind the body, inside it or near its middle"
        return None
