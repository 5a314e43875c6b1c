"""The MuJoCo plant: torque-limited position loops with feed-forward, stepped, never slept."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from models.conversion import Conversion
from models.moving_bodies import moving_joints, poses_of, put
from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio
from models.spec import FLOOR_FRICTION, RobotSpec
from wholebody.config.bounds import require_run
from wholebody.errors import InputError, SimulationError
from wholebody.jit.entry import Entry
from wholebody.sim.kernels import motors
from wholebody.sim.scene_file import scene_of
from wholebody.types import JointCommand, RobotState, check_command, check_state

_drive, _read = Entry(motors.drive), Entry(motors.read)

VALUE_MAX = 1e10
"""Positions and speeds beyond this are no motion: MuJoCo's own bound [m, rad; per s]."""


class MujocoPlant:
    """One robot in one scene.

    At every physics step the torque of a joint is ``clip(tau + kp (q_cmd - q) + kd (dq_cmd - dq), -effort, effort)``.

    Args:
        spec: The robot.
        scene: Name of a scene of `models.scenes`, or a MuJoCo file (.xml).
        timestep: Physics step [s].
        control_dt: Time that one command is applied for, a multiple of the timestep [s].
        payload_kg: Mass held by the left and right hand [kg].
        friction: Friction coefficient of the floor.

    Raises:
        InputError: If the control period is no multiple of the timestep, or a mass is beyond what a hand can hold.
    """

    def __init__(
        self,
        spec: RobotSpec,
        *,
        scene: str = "floor",
        timestep: float = 0.002,
        control_dt: float = 0.002,
        payload_kg: tuple[float, float] = (0.0, 0.0),
        friction: float = FLOOR_FRICTION,
    ) -> None:
        steps = round(control_dt / timestep)
        if steps < 1 or abs(steps * timestep - control_dt) > 1e-9:
            raise InputError(f"control_dt {control_dt} s is no multiple of the timestep {timestep} s")
        for mass in payload_kg:
            require_run("payload_kg", mass)
        self.spec, self.control_dt, self._steps = spec, control_dt, steps
        world = scene_of(scene)
        self.model = load_mujoco(spec, scene=world, timestep=timestep, payload_kg=payload_kg, friction=friction)
        # MuJoCo would put a robot whose state is not finite back to its first pose, at time 0, and go on.
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self.data = mujoco.MjData(self.model)
        self._conversion = Conversion(spec, load_pinocchio(spec), self.model)
        self._state, self._ctrl = (self.data.qpos, self.data.qvel), self.data.ctrl
        index = self._conversion
        self._motors = np.array([index.motor_qpos_index, index.motor_qvel_index, index.actuator_index])
        self._entries = index.qpos_index, index.qvel_index
        self._effort = np.array(spec.effort_max, dtype=float)
        self._sizes = len(index.qpos_index), len(index.qvel_index)
        self._feet = {self._body_id(foot.frame) for foot in spec.feet}
        self._robot = self._bodies_of_robot()
        self._part = _parts(self.model, self._feet)
        self._sites = np.array([self.model.site(f"{foot.side}_sole").id for foot in spec.feet])
        self._site_xpos = self.data.site_xpos
        self._touching: tuple[np.ndarray, np.ndarray] | None = None
        self._moving = moving_joints(self.model)
        self._pushes: list[tuple[int, np.ndarray, float, float]] = []
        self.torque = np.zeros(spec.n_joints)
        """Motor torques of the last physics step, motor order, [N m]."""
        self.torque_asked = np.zeros(spec.n_joints)
        """Largest magnitude asked of each motor during the last control period, before the effort limit [N m]."""
        self.reset()

    def reset(self, begin: RobotState | None = None) -> RobotState:
        """The default stance, at rest, or another state of the robot, at time 0; pushes are forgotten.

        Raises:
            InputError: If that is no state of this robot.
        """
        mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        if begin is not None:
            check_state(begin, self.spec.n_joints)
            self._conversion.to_mujoco(begin.q, begin.v, *self._state)
        mujoco.mj_forward(self.model, self.data)
        self._touching = None
        self._pushes.clear()
        self.torque[:] = self.torque_asked[:] = 0.0
        return self.state()

    def state(self) -> RobotState:
        """True state in Pinocchio's convention, with the torques of the last physics step."""
        nq, nv = self._sizes
        q, v = np.empty(nq), np.empty(nv)
        _read(self._state, self._entries, q, v)
        return RobotState(float(self.data.time), q, v, self.torque[self._conversion.motor_to_pin])

    def step(self, command: JointCommand) -> RobotState:
        """Apply a command for one control period.

        Raises:
            InputError: If the command has a wrong shape, a value or torque that is not finite, or a negative gain.
            SimulationError: If the simulation becomes non-finite; which joint, and when.
        """
        c = command
        # The compiled code takes what it is given as it lies in memory.
        asked = tuple([np.ascontiguousarray(part, dtype=float) for part in (c.q, c.dq, c.tau, c.kp, c.kd)])
        if {part.shape for part in asked} != {self.torque.shape}:
            check_command(command, self.spec.n_joints)
        for k in range(self._steps):
            if not self._torques(asked, k == 0):
                self._refuse(command)
            self._apply_pushes()
            mujoco.mj_step(self.model, self.data)
        self._touching = None
        self._check()
        return self.state()

    def _torques(self, asked: tuple[np.ndarray, ...], anew: bool) -> bool:
        """Torques of a physics step for ``q dq tau kp kd``; whether the command can be applied."""
        out = self._ctrl, self.torque, self.torque_asked
        return bool(_drive(asked, self._motors, self._effort, self._state, *out, anew))

    def _refuse(self, command: JointCommand) -> None:
        """Say why a command cannot be applied."""
        self._check()
        check_command(command, self.spec.n_joints)
        c, (q, v) = command, self._state
        with np.errstate(over="ignore"):
            asked = c.tau + c.kp * (c.q - q[self._motors[0]]) + c.kd * (c.dq - v[self._motors[1]])
        i = int(np.flatnonzero(~np.isfinite(asked))[0])
        joint = self.spec.joint_names[i]
        raise InputError(f"the command asks joint '{joint}' for a torque of {asked[i]} N m; it must be finite")

    def _check(self) -> None:
        """The simulation is sound: no position or speed is beyond `VALUE_MAX`, or no number."""
        qpos, qvel = self._state
        # A sum of squares is below a bound only if all of its terms are numbers.
        if qpos.dot(qpos) + qvel.dot(qvel) < VALUE_MAX**2:
            return
        for j in range(self.model.njnt):
            joint = self.data.joint(j)
            for what, values in (("position", joint.qpos), ("speed", joint.qvel)):
                wrong = values[~(np.abs(values) < VALUE_MAX)]
                if len(wrong):
                    raise SimulationError(
                        f"the simulation broke down at {self.data.time:.3f} s: the {what} of joint '{joint.name}' is "
                        f"{wrong[0]:g}",
                        joint=joint.name,
                        time=self.data.time,
                    )

    def joint_positions(self) -> np.ndarray:
        """True joint angles, shape (n_joints,), motor order, [rad]."""
        return self.data.qpos[self._conversion.motor_qpos_index]

    def soles(self) -> np.ndarray:
        """Middles of the soles in world, shape (2, 3), left first, [m]."""
        return self._site_xpos[self._sites]

    def contact_points(self) -> np.ndarray:
        """Where the feet may touch the floor, in world, shape (n, 3), [m]."""
        return np.vstack(
            [
                self.data.body(foot.frame).xpos + foot.points @ self.data.body(foot.frame).xmat.reshape(3, 3).T
                for foot in self.spec.feet
            ]
        )

    def foot_load(self) -> tuple[float, np.ndarray]:
        """Normal force of the floor on both feet [N] and centre of pressure (2,) [m]; zeros in the air."""
        contact = self.data.contact
        carrying = self._contact_pairs()[1] & (contact.efc_address >= 0)
        # With elliptic cones the first force of a contact is the normal one.
        force = self.data.efc_force[contact.efc_address[carrying]]
        total = float(force.sum())
        if total <= 0.0:
            return 0.0, np.zeros(2)
        return total, force @ contact.pos[carrying, :2] / total

    def objects(self) -> np.ndarray:
        """Poses of the scene's bodies that move: position [m] and quaternion wxyz, shape (k, 7)."""
        return poses_of(self.model, self.data.qpos, self._moving)

    def place(self, poses: np.ndarray) -> None:
        """Put the scene's bodies that move elsewhere, at rest: poses as `objects` has them, shape (k, 7).

        Raises:
            InputError: If the shape is another one, or a number is not finite.
        """
        shape = (len(self._moving), 7)
        if np.shape(poses) != shape or not np.isfinite(poses).all():
            raise InputError(f"poses have shape {np.shape(poses)}; finite ones of {shape} are expected")
        put(self.model, self.data.qpos, self._moving, np.asarray(poses, dtype=float))
        for joint in self._moving:
            self.data.qvel[self.model.dof_jntid == joint] = 0.0
        mujoco.mj_forward(self.model, self.data)
        self._touching = None

    def is_robot(self, body: str) -> bool:
        """Whether a body of the scene is a part of the robot."""
        return self._body_id(body) in self._robot

    def push(self, body: str, force: np.ndarray, *, start: float, duration: float) -> None:
        """Push a body with a constant force in world axes, at its centre of mass.

        Args:
            body: Body name.
            force: Shape (3,), [N].
            start: Simulated time at which it begins [s].
            duration: [s]
        """
        self._pushes.append((self._body_id(body), np.asarray(force, dtype=float), start, start + duration))

    def hold(self, payload_kg: Sequence[float]) -> None:
        """Change the masses in the left and right hand [kg] while time goes on.

        Raises:
            InputError: If the plant was made without a mass in that hand, or one is beyond what a hand can hold.
        """
        for tool, mass in zip(self.spec.tools, payload_kg, strict=True):
            require_run("payload_kg", mass)
            ball = self._body_id(f"{tool.side}_payload")
            self.model.body_inertia[ball] *= mass / self.model.body_mass[ball]
            self.model.body_mass[ball] = mass
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))

    def set_friction(self, friction: float) -> None:
        """Change the friction coefficient of the floor.

        Raises:
            InputError: If it is not above 0.
        """
        if not (np.isfinite(friction) and friction > 0.0):
            raise InputError(f"friction is {friction}; a number above 0 is expected")
        self.model.geom_friction[np.isin(self.model.geom_bodyid, list(self._feet)), 0] = friction

    def contacts(self) -> list[tuple[str, str]]:
        """Pairs of bodies that touch now, feet on the floor left out."""
        pairs = []
        for first, second in self._unusual_contacts():
            bodies = {int(self.model.geom_bodyid[first]), int(self.model.geom_bodyid[second])}
            if not (bodies & self._robot) or (0 in bodies and bodies & self._feet):
                continue
            names = sorted(self.model.body(body).name for body in bodies)
            pairs.append((names[0], names[-1]))
        return pairs

    def touches_floor(self) -> str | None:
        """A body of the robot, other than the feet, that touches the floor, or None."""
        for first, second in self._unusual_contacts():
            bodies = [int(self.model.geom_bodyid[first]), int(self.model.geom_bodyid[second])]
            geoms = [self.model.geom(int(g)).name for g in (first, second)]
            for body, other in (bodies, bodies[::-1]):
                if other == 0 and "floor" in geoms and body in self._robot - self._feet:
                    return self.model.body(body).name
        return None

    def _unusual_contacts(self) -> np.ndarray:
        """Contacts (k, 2) of geoms, those of the feet with the floor left out."""
        pairs, on_floor = self._contact_pairs()
        return pairs[~on_floor]

    def _contact_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Contacts (k, 2) of geoms, and which of them are a foot on the floor (k,); found once a control period."""
        if self._touching is None:
            pairs = self.data.contact.geom
            self._touching = pairs, self._part[pairs].sum(axis=1) == _FOOT
        return self._touching

    def _apply_pushes(self) -> None:
        if not self._pushes:
            return
        self.data.xfrc_applied[:] = 0.0
        for body, force, start, end in self._pushes:
            if start <= self.data.time < end:
                self.data.xfrc_applied[body, :3] += force

    def _bodies_of_robot(self) -> set[int]:
        base = self._body_id(self.spec.base_body)
        return {b for b in range(self.model.nbody) if int(self.model.body_rootid[b]) == base}

    def _body_id(self, name: str) -> int:
        index = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, name)
        if index < 0:
            names = ", ".join(self.model.body(b).name for b in range(1, self.model.nbody))
            raise InputError(f"the scene has no body '{name}'; it has {names}")
        return index


_FOOT, _OTHER = 1, 3
"""What a geom belongs to, the floor being 0: only a foot and the floor add up to 1."""


def _parts(model: mujoco.MjModel, feet: set[int]) -> np.ndarray:
    """What each geom belongs to, shape (ngeom,)."""
    owner = model.geom_bodyid
    return np.where(owner == 0, 0, np.where(np.isin(owner, list(feet)), _FOOT, _OTHER))


def warm_up() -> None:
    """Compile what a plant calls, or load it from the cache on disk."""
    row, index, entries = np.zeros(1), np.zeros((3, 1), dtype=np.int64), np.zeros(1, dtype=np.int64)
    _drive.compile((row,) * 5, index, row, (row, row), row, row, row, True)
    _read.compile((row, row), (entries, entries), row, row)
