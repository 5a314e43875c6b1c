"""A chunk followed by the program of the tick alone, its answers integrated as if the robot were exactly its model.

What makes a chunk fall as given is that this program cannot keep the robot up any more. Integrated in long steps, it
says so much sooner than a simulation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from policy.chunk import ActionChunk
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.control.tick_report import TickLevel, TickReport
from wholebody.execution import statuses
from wholebody.execution.as_given import AsGiven
from wholebody.lending import Lending
from wholebody.planning.judgement.chunk_judge import Begin
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.types import RobotState

STEP_TIME = 0.02
"""Time over which an answer is integrated [s]; chosen: the longest that the program allows."""
AFTER = 0.6
"""How long after the last step is looked at [s]; chosen: what topples has left the soles by then."""
AT_BOUND, PAST_BOUND = 0.001, 0.005
"""How near its bound, and how far past it, time of the capture point counts [m]; chosen."""
STANDING_WELL = {
    "roll_failed": 0.0, "roll_left": 0.0, "roll_no_hands": 0.0, "roll_zmp": 0.05, "roll_capture": 0.06,
    "roll_capture_end": 0.06, "roll_at_bound": 0.0, "roll_past_bound": 0.0, "roll_com": 0.06, "roll_com_end": 0.06,
    "roll_slack": 0.0, "roll_load": 340.0, "roll_off": 0.0, "roll_off_end": 0.0, "roll_push": 1.0,
    "roll_friction": 0.02, "roll_corner": 0.12, "roll_corner_end": 0.12, "roll_foot": 0.45, "roll_foot_end": 0.45,
    "roll_speed": 0.02, "roll_speed_end": 0.0, "roll_torque": 0.5, "roll_torque_end": 0.4,
}  # fmt: skip
"""What a robot that stands well comes to [m, s, N, m/s^2]; chosen: about the stance."""


class Rollout:
    """What the program of the tick makes of chunks in a world that is as it believes."""

    def __init__(self, config: ControllerConfig) -> None:
        # A second solver seldom finds what the first does not.
        config = replace(config, backend=ControllerConfig().backend, fallback="none")
        self._follower, self._margin = AsGiven(describe(config.robot), config), config.safety.balance_margin
        spec, robot = self._follower.spec, self._follower.robot
        fingers = {name for tool in spec.tools for name in tool.finger_joints}
        effort = {name: e for name, e in zip(spec.joint_names, spec.effort_max, strict=True) if name not in fingers}
        self._body, self._effort = robot.joint_indices(list(effort)), np.array(list(effort.values()))

    def quantities(self, chunk: ActionChunk, begin: Begin, loads: tuple[float, float]) -> dict[str, float]:
        """Quantities by name, each a finite number: how far the program gets, and with how much room.

        Times for which it has no answer any more, drops the hands, or has the capture point at or past its bound [s],
        room of centre of pressure, capture point and centre of mass to the edge of the soles, least and last [m], slack
        of the bounds [m/s], least force on the floor [N], distance of the palms, largest and last [m], acceleration of
        the base [m/s^2, rad/s^2], force along the floor by force on it, how far the capture point is from a corner of
        the soles [m], share of the weight on the foot that carries less, both least and last, speed of the centre of
        mass [m/s] and torque of a joint as a share of its limit, largest and last.

        Args:
            chunk: A valid chunk; followed from its first step on.
            begin: Where it is begun.
            loads: Masses in the left and right hand that are counted on [kg].
        """
        self._follower.controller.carry(loads)
        ticks, left = self._follow(replace(chunk, t_obs=0.0), begin)
        columns = self._rooms(ticks) if ticks else np.zeros((13, 1))
        zmp, capture, com, slack, normal, off, push, sideways, no_hands, corner, foot, speed, torque = columns
        return {
            "roll_failed": float(left > 0.0),
            "roll_left": left,
            "roll_no_hands": float(no_hands.sum()) * STEP_TIME,
            "roll_zmp": float(zmp.min()),
            "roll_capture": float(capture.min()),
            "roll_capture_end": float(capture[-1]),
            "roll_at_bound": float((capture < self._margin + AT_BOUND).sum()) * STEP_TIME,
            "roll_past_bound": float((capture < self._margin - PAST_BOUND).sum()) * STEP_TIME,
            "roll_com": float(com.min()),
            "roll_com_end": float(com[-1]),
            "roll_slack": float(slack.sum()) * STEP_TIME,
            "roll_load": float(normal.min()),
            "roll_off": float(off.max()),
            "roll_off_end": float(off[-1]),
            "roll_push": float(push.max()),
            "roll_friction": float(sideways.max()),
            "roll_corner": float(corner.min()),
            "roll_corner_end": float(corner[-1]),
            "roll_foot": float(foot.min()),
            "roll_foot_end": float(foot[-1]),
            "roll_speed": float(speed.max()),
            "roll_speed_end": float(speed[-1]),
            "roll_torque": float(torque.max()),
            "roll_torque_end": float(torque[-1]),
        }

    def _follow(self, chunk: ActionChunk, begin: Begin) -> tuple[list[tuple], float]:
        """What each tick came to, for `_rooms`, and the time that is left when there is no answer any more [s]."""
        follower, q, v, ticks = self._follower, begin.body.q.copy(), begin.body.v.copy(), []
        follower.reset(RobotState(0.0, q, v))
        follower.accept(chunk, -1e-6)
        steps = int(np.ceil(((len(chunk) - 1) / chunk.fps + AFTER) / STEP_TIME))
        for k in range(steps):
            follower.step(RobotState(k * STEP_TIME, q, v), k * STEP_TIME)
            tick = follower.last_tick
            if follower.status is statuses.STANDING_LOST or tick.level is TickLevel.FAILED:
                return ticks, (steps - k) * STEP_TIME
            ticks.append(self._seen(tick))
            dv = tick.solution.dv
            q, v = pin.integrate(follower.robot.model, q, STEP_TIME * (v + 0.5 * STEP_TIME * dv)), v + STEP_TIME * dv
        return ticks, 0.0

    def _seen(self, tick: TickReport) -> tuple:
        """What `_rooms` is made of: centre of mass, its velocity, forces on the soles, torques, and numbers."""
        follower, answer = self._follower, tick.solution
        palms = np.array([pose[:3, 3] for pose in follower.palm_reference().values()])
        away = follower.controller.palm_positions() - palms
        numbers = answer.slack[0], np.einsum("hi,hi->h", away, away).max(), tick.level is TickLevel.NO_HANDS
        robot = follower.robot
        return (
            robot.com.copy(),
            robot.com_velocity.copy(),
            answer.forces,
            answer.tau[self._body],
            answer.dv[:6],
            numbers,
        )

    def _rooms(self, ticks: list[tuple]) -> np.ndarray:
        """What `quantities` takes the least, the largest, the last or the sum of, a column a tick."""
        com, com_velocity, forces, tau, base, numbers = (np.array(one, dtype=float) for one in zip(*ticks, strict=True))
        controller = self._follower.controller
        support = controller.balance.support
        points = [foot.T_world_ref.translation + foot.points @ foot.T_world_ref.rotation.T for foot in controller.feet]
        normal = np.maximum(forces[:, :, 2].sum(axis=1), 1.0)
        pressed = forces[:, :, 2] @ np.vstack(points)[:, :2] / normal[:, None]
        speed = np.hypot(com_velocity[:, 0], com_velocity[:, 1])
        omega = np.array([natural_frequency(height) for height in com[:, 2].tolist()])
        capture = com[:, :2] + com_velocity[:, :2] / omega[:, None]
        zmp, falling, still = (np.sort(support.offsets - p @ support.normals.T) for p in (pressed, capture, com[:, :2]))
        feet = [part.sum(axis=1) for part in np.split(forces[:, :, 2], len(controller.feet), axis=1)]
        slack, away, no_hands = numbers.T
        return np.array(
            [
                zmp[:, 0],
                falling[:, 0],
                still[:, 0],
                slack,
                normal,
                np.sqrt(away),
                np.abs(base).max(axis=1),
                np.hypot(*forces[:, :, :2].sum(axis=1).T) / normal,
                no_hands,
                np.hypot(*np.maximum(falling[:, :2], 0.0).T),
                np.min(feet, axis=0) / normal,
                speed,
                (np.abs(tau) / self._effort).max(axis=1),
            ]
        )


rollouts = Lending(Rollout)
"""One for some settings, lent to a thread at a time."""
