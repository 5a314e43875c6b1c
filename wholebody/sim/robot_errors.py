"""How a real robot differs from its model: joints with friction, slow motors, other masses, a load that nobody told."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from models.spec import RobotSpec
from models.unitree_g1 import JOINT_FRICTION
from wholebody.config.bounds import require_run
from wholebody.errors import InputError
from wholebody.robot.second_order import second_order_step
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.sensors import Sensors
from wholebody.types import RobotState

STREAM = 1
"""Stream of the random numbers of a seed: the sensors have the first one."""


@dataclass(frozen=True, kw_only=True)
class RobotErrors:
    """Errors of the model of the robot; none by default. What has a range is drawn evenly from it, from one seed."""

    joint_friction: float = 0.0
    """Damping and dry friction of the joints, times those of Unitree's model (`models.unitree_g1.JOINT_FRICTION`)."""
    torque_lag: float = 0.0
    """Time constant of the motors' torques [s]."""
    motor_bandwidth: float = 0.0
    """Natural frequency of torques that answer as a second-order system does; 0 for at once [Hz]."""
    motor_damping: float = 0.5
    """Damping ratio of that system."""
    command_delay: tuple[float, float] = (0.0, 0.0)
    """Least and longest time from a command to the motors [s]."""
    feed_forward: float = 1.0
    """Share of the commanded torques that the motors add to their position loops."""
    delivered: tuple[tuple[str, float], ...] = ()
    """Patterns of joint names, each with the share of its torque that such a joint delivers; 1 for all others."""
    loss_told: bool = True
    """Whether the torques that the motors tell show what `delivered` takes away: a current does not."""
    mass_error: float = 0.0
    """Largest error of the mass and inertia of each body, a share."""
    torso_error: float = 0.0
    """Largest error of the torso's centre of mass along each axis [m]."""
    payload_max: float = 0.0
    """Largest mass in each hand [kg]."""
    floor_friction: float | None = None
    """Friction coefficient of the floor; that of the plant if None."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            values = [share for _, share in value] if name == "delivered" else value
            for number in values if isinstance(values, (list, tuple)) else (values,):
                if number is not None:
                    require_run(name, number, f"robot error {name}")


REALISTIC_ROBOT = RobotErrors(
    joint_friction=1.0,
    torque_lag=0.003,
    command_delay=(0.002, 0.004),
    mass_error=0.05,
    torso_error=0.01,
    payload_max=0.5,
    floor_friction=0.6,
)
"""A G1 as assumed [s, kg, m]. Friction of the joints: Unitree's model; of the floor, 0.6: the menagerie's. Chosen, no
G1 was measured: 3 ms, a current loop of 50 Hz; 2 to 4 ms, one or two messages at 500 Hz; 5 %, 1 cm and 0.5 kg, what
cables, covers and a small object make."""


class RealisticPlant(MujocoPlant):
    """A plant that differs from the model of it.

    Args:
        spec: The robot as the controller knows it.
        errors: How it differs.
        encoders: Whose readings the motors' position loops see; the true angles if not given.
        payload_kg: Mass held by the left and right hand, beside what is drawn [kg].
        world: As of `MujocoPlant`.

    Attributes:
        payload_kg: Mass in the left and right hand, all in all [kg].
        command_delay: What was drawn [s].
    """

    def __init__(
        self,
        spec: RobotSpec,
        errors: RobotErrors,
        *,
        encoders: Sensors | None = None,
        payload_kg: tuple[float, float] = (0.0, 0.0),
        **world: Any,
    ) -> None:
        rng = np.random.default_rng((errors.seed, STREAM))
        left, right = rng.uniform(0.0, errors.payload_max, 2).tolist()
        self.command_delay = float(rng.uniform(*errors.command_delay))
        self.payload_kg = payload_kg[0] + left, payload_kg[1] + right
        if errors.floor_friction is not None:
            world["friction"] = errors.floor_friction
        self._encoders = encoders
        self._sent: deque[tuple[np.ndarray, ...]] = deque(maxlen=1)
        self._answer: MotorAnswer | None = None
        super().__init__(spec, payload_kg=self.payload_kg, **world)
        step = self.model.opt.timestep
        self._sent = deque(maxlen=round(self.command_delay / step) + 1)
        self._answer = MotorAnswer(spec, errors, step)
        self._change(errors, rng)
        self.reset()

    def _change(self, errors: RobotErrors, rng: np.random.Generator) -> None:
        """Give the simulated bodies and joints other numbers than the model has."""
        model, bodies = self.model, sorted(self._robot)
        factors = 1.0 + rng.uniform(-errors.mass_error, errors.mass_error, len(bodies))
        model.body_mass[bodies] *= factors
        model.body_inertia[bodies] *= factors[:, None]
        model.body_ipos[self._body_id(self.spec.torso_body)] += rng.uniform(-errors.torso_error, errors.torso_error, 3)
        for joint in self.spec.joints:
            dof = model.joint(joint.name).dofadr[0]
            (found,) = [numbers for pattern, numbers in JOINT_FRICTION.items() if re.fullmatch(pattern, joint.name)]
            model.dof_damping[dof] += errors.joint_friction * found[0]
            model.dof_frictionloss[dof] += errors.joint_friction * found[1]
        mujoco.mj_setConst(model, mujoco.MjData(model))

    def reset(self, begin: RobotState | None = None) -> RobotState:
        """Reset as `MujocoPlant` does; commands on their way are forgotten."""
        self._sent.clear()
        if self._answer is not None:
            self._answer.reset()
        return super().reset(begin)

    def state(self) -> RobotState:
        """State as of `MujocoPlant`, with the torques that the motors report."""
        state = super().state()
        if self._answer is None or self._answer.reported is None:
            return state
        return replace(state, tau=self._answer.reported[self._conversion.motor_to_pin])

    def _torques(self, asked: tuple[np.ndarray, ...], anew: bool) -> bool:
        """The command that has arrived by now, on the angles that the encoders read, as the motors answer it."""
        self._sent.append(asked)
        q, dq, tau, *gains = self._sent[0]
        if self._encoders is not None:
            q = q - self._encoders.encoder_error[self._conversion.pin_to_motor]
        answer = self._answer
        sound = super()._torques((q, dq, tau if answer is None else answer.feed_forward * tau, *gains), anew)
        if answer is not None:
            answer.answer(self.torque)
        self._ctrl[self._motors[2]] = self.torque
        return sound


class MotorAnswer:
    """What motors make of the torques that their loops ask for: late, with an overshoot, less.

    Args:
        spec: The robot.
        errors: How its motors differ from the model's.
        step: Physics step [s].

    Attributes:
        feed_forward: Share of commanded torques that is added to the position loops.
        reported: Torques that the motors report, (n,), [N m]; None if it is what they deliver.
    """

    def __init__(self, spec: RobotSpec, errors: RobotErrors, step: float) -> None:
        self.feed_forward, self.reported = errors.feed_forward, None if errors.loss_told else np.zeros(spec.n_joints)
        self._delivered = np.ones(spec.n_joints)
        for pattern, share in errors.delivered:
            self._delivered[_matched(spec, pattern)] = share
        self._lag = 1.0 - float(np.exp(-step / errors.torque_lag)) if errors.torque_lag > 0.0 else 1.0
        self._lagged, self._moving = np.zeros(spec.n_joints), np.zeros((2, spec.n_joints))
        self._step = None
        if errors.motor_bandwidth > 0.0:
            self._step = second_order_step(2.0 * np.pi * errors.motor_bandwidth, errors.motor_damping, step)

    def reset(self) -> None:
        """Motors at rest that deliver nothing."""
        self._lagged[:], self._moving[:] = 0.0, 0.0

    def answer(self, torque: np.ndarray) -> None:
        """Torques (n,) that were asked for become those that are delivered after a physics step [N m]."""
        self._lagged += self._lag * (torque - self._lagged)
        torque[:] = self._lagged
        if self._step is not None:
            A, b = self._step
            self._moving = A @ self._moving + b[:, None] * torque
            torque[:] = self._moving[0]
        if self.reported is not None:
            self.reported[:] = torque
        torque *= self._delivered


def _matched(spec: RobotSpec, pattern: str) -> list[int]:
    """Joints whose whole name matches; an `InputError` if there is none."""
    found = [i for i, name in enumerate(spec.joint_names) if re.fullmatch(pattern, name)]
    if not found:
        raise InputError(
            f"robot error delivered: no joint is called '{pattern}'; there are {', '.join(spec.joint_names)}"
        )
    return found
