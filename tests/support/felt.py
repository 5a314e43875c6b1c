"""What hands feel in MuJoCo: forces on each arm, control period by control period, beside where the palms are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

from models import g1
from models.pinocchio_model import load_pinocchio
from policy.scripted.policy import ScriptedPolicy
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant
from wholebody.sim.sensors import REALISTIC_READINGS, Sensors

SPEC = g1()
SIDES = ("left", "right")
THERE = 0.005
"""Distance from the chunk within which a palm is back on it [m]; the issue's."""
BUMP_TIME = 0.02
"""Time of a bump [s]; the issue's."""
NOTHING = 1e-4
"""Mass in a hand that can be changed later [kg]."""
ON_CONE = 8
"""Sides of the pyramid inside the friction cone of a corner of a sole."""


def robot_in(scene: str, realistic: int | None = None, load: float = 0.0) -> tuple[MujocoPlant, Sensors | None]:
    """A true robot in a scene, or a realistic one of a seed with its sensors; a load in each hand [kg]."""
    world = {"scene": scene, "payload_kg": (load, load)}
    if realistic is None:
        return MujocoPlant(SPEC, **world), None
    sensors = Sensors(SPEC, replace(REALISTIC_READINGS, seed=realistic), 0.002, StateEstimator(SPEC))
    return RealisticPlant(SPEC, replace(REALISTIC_ROBOT, seed=realistic), encoders=sensors, **world), sensors


class Felt:
    """Watches a plant: after every control period, what the scene does to each arm, and where the palms are.

    Args:
        plant: Stepped by whoever has it; its `step` is watched from now on.
        found: Asked after every period which hands the controller takes for touching, left first; nothing if None.
        pull: A side, and the force on its palm at a time [s] in a configuration, shape (3,), world axes, [N].
        loads: From when on [s] how much is in both hands, left first [kg], in order.

    Attributes:
        rows: Time [s], forces (2, 3) [N], palms (2, 3) [m], soles (2, 3) [m], found (2,), the
            fixture's joint [m, rad], the object's position (3,) [m].
    """

    def __init__(
        self,
        plant: MujocoPlant,
        found: Callable[[], tuple[bool, bool]] | None = None,
        pull: tuple[str, Callable[[float, np.ndarray], np.ndarray]] | None = None,
        loads: Sequence[tuple[float, tuple[float, float]]] = (),
    ) -> None:
        self.plant, self.rows, self._found, self._pull, self._loads = plant, [], found, pull, list(loads)
        self._own = getattr(plant, "payload_kg", (NOTHING, NOTHING))
        self._arm = _arms(plant)
        self._sites = [plant.model.site(tool.palm_frame).id for tool in SPEC.tools]
        joints = [j for j in range(plant.model.njnt) if plant.model.joint(j).name == "fixture"]
        self._fixture = plant.model.joint(joints[0]).qposadr[0] if joints else -1
        self._step, plant.step = plant.step, self.step

    def step(self, command: object) -> object:
        """As of the plant."""
        plant = self.plant
        while self._loads and plant.data.time >= self._loads[0][0]:
            plant.hold([own + more for own, more in zip(self._own, self._loads.pop(0)[1], strict=True)])
        if self._pull is not None:
            side, force = self._pull
            tool = SPEC.tools[SIDES.index(side)]
            body, f = plant.model.body(tool.wrist_frame).id, force(plant.data.time, plant.state().q)
            at = plant.data.site(tool.palm_frame).xpos - plant.data.xipos[body]
            plant.data.xfrc_applied[body] = [*f, *np.cross(at, f)]
        state, d = self._step(command), plant.data
        found = (False, False) if self._found is None else tuple(self._found())
        fixture = d.qpos[self._fixture] if self._fixture >= 0 else 0.0
        objects = plant.objects()
        thing = objects[0, :3] if len(objects) else np.zeros(3)
        palms, soles = d.site_xpos[self._sites].copy(), plant.soles().copy()
        self.rows.append((d.time, self.forces(), palms, soles, found, fixture, thing))
        return state

    def forces(self) -> np.ndarray:
        """Force of the scene on the left and the right arm, shape (2, 3), world axes, [N]."""
        d, total, wrench = self.plant.data, np.zeros((2, 3)), np.zeros(6)
        arms = self._arm[d.contact.geom]
        for i in np.flatnonzero((arms >= 0).any(axis=1) & (arms == _SCENE).any(axis=1)):
            mujoco.mj_contactForce(self.plant.model, d, int(i), wrench)
            # Of the first geom on the second, in axes that are the rows of the frame.
            f = d.contact.frame[i].reshape(3, 3).T @ wrench[:3]
            first, second = arms[i]
            total[max(first, second)] += f if second >= 0 else -f
        return total

    def column(self, index: int) -> np.ndarray:
        """One of `rows` over time."""
        return np.array([row[index] for row in self.rows])


_SCENE, _OTHER = -1, -2


def _arms(plant: MujocoPlant) -> np.ndarray:
    """0 or 1 for a geom of the left or right arm, -1 for one of the scene, -2 for the rest of the robot; (ngeom,)."""
    m, roots = plant.model, [plant.model.body(f"{side}_shoulder_pitch_link").id for side in SIDES]
    base = m.body_rootid[m.body(SPEC.base_body).id]
    of_body = np.full(m.nbody, _SCENE)
    for body in range(1, m.nbody):
        parent = of_body[m.body_parentid[body]]
        mine = _OTHER if m.body_rootid[body] == base else _SCENE
        of_body[body] = roots.index(body) if body in roots else parent if parent >= 0 else mine
    return of_body[m.geom_bodyid]


def supervisor_of() -> tuple[Supervisor, Callable[[], tuple[bool, bool]]]:
    """A supervisor, and which hands it takes for touching."""
    supervisor = Supervisor(SPEC)

    def found() -> tuple[bool, bool]:
        # Before hands are felt there is nothing to ask.
        shares = getattr(getattr(supervisor, "touch", None), "shares", (0.0, 0.0))
        return shares[0] > 0.0, shares[1] > 0.0

    return supervisor, found


class Run:
    """One episode of a script in a scene, and what was felt."""

    def __init__(
        self, policy: ScriptedPolicy, scene: str, *, seed: int | None = None, phase: float = 0.0, hold: float = 2.0,
        duration: float | None = None, pull: tuple | None = None, bump: tuple | None = None,
        loads: Sequence[tuple[float, tuple[float, float]]] = (),
    ) -> None:  # fmt: skip
        supervisor, found = supervisor_of()
        plant, sensors = robot_in(scene, seed, NOTHING if loads else 0.0)
        self.policy, self.plant, self.felt, self.settle = policy, plant, Felt(plant, found, pull, loads), 1.0 + phase
        config = EpisodeConfig(settle=self.settle, hold=hold)
        if bump is not None:
            # `run_episode` resets the plant, which forgets its pushes.
            reset = plant.reset
            plant.reset = lambda *begin: (reset(*begin), plant.push(*bump[:2], start=bump[2], duration=BUMP_TIME))[0]
        self.result = run_episode(
            policy, supervisor, plant, duration=duration or policy.duration, config=config, sensors=sensors
        )
        felt = self.felt
        self.times, self.forces, self.palms = felt.column(0), felt.column(1), felt.column(2)
        self.sizes = np.linalg.norm(self.forces, axis=2)
        motion = policy.script(np.maximum(self.times - self.settle, 0.0))
        asked = np.stack([motion.p_world_lpalm, motion.p_world_rpalm], axis=1)
        self.errors = np.linalg.norm(self.palms - asked, axis=2)

    def told(self) -> dict:
        """What every line says."""
        soles, reasons = self.felt.column(3), self.result.reasons
        slid = np.linalg.norm(soles - soles[0], axis=2).max()
        fall = self.result.fall
        return {
            "fell": fall is not None,
            "fall": "" if fall is None else f"{fall.time:.2f} s {fall.cause}",
            "peak_N": round(float(self.sizes.max()), 1),
            "slid_mm": round(1e3 * float(slid), 1),
            "off_plan_s": round(sum(reasons.get(name, 0.0) for name in ("off_plan", "beyond_plan")), 2),
        }

    def back(self, since: float) -> float:
        """How long after a time both palms are within `THERE` of the chunk for 0.2 s [s]; nan if never."""
        near = (self.errors.max(axis=1) < THERE) & (self.times >= since)
        run = np.convolve(near, np.ones(100), "valid") >= 100
        return float(self.times[np.argmax(run)] - since) if run.any() else float("nan")


def still_force(q: np.ndarray, side: str, direction: np.ndarray, friction: float) -> float:
    """Largest force on a palm that a still robot stands in this posture [N].

    A linear program: forces of the floor at the corners of the soles within pyramids of friction, and torques of the
    joints within their limits, which together with gravity and the force on the palm leave the robot at rest.

    Args:
        q: Configuration of Pinocchio's model.
        side: Of the palm.
        direction: Of the force, a unit vector in world axes, shape (3,).
        friction: Coefficient of the floor.
    """
    model = load_pinocchio(SPEC)
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    gravity, columns = pin.computeGeneralizedGravity(model, data, q), []
    angles = 2.0 * np.pi * np.arange(ON_CONE) / ON_CONE
    edges = np.stack([friction * np.cos(angles), friction * np.sin(angles), np.ones(ON_CONE)], axis=1)
    for foot in SPEC.feet:
        frame = model.getFrameId(foot.frame)
        J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        for point in foot.points:
            lever = data.oMf[frame].rotation @ point
            columns += [J[:3].T @ edge + J[3:].T @ np.cross(lever, edge) for edge in edges]
    palm = model.getFrameId(SPEC.tool(side).palm_frame)
    columns.append(pin.getFrameJacobian(model, data, palm, pin.LOCAL_WORLD_ALIGNED)[:3].T @ direction)
    A = np.array(columns).T
    effort = model.effortLimit[6:]
    # gravity - A x is what the joints give; at the base it has to be nothing.
    rows, bounds = np.vstack([A[6:], -A[6:]]), np.concatenate([effort + gravity[6:], effort - gravity[6:]])
    cost = np.zeros(A.shape[1])
    cost[-1] = -1.0
    answer = linprog(cost, A_ub=rows, b_ub=bounds, A_eq=A[:6], b_eq=gravity[:6])
    return float(answer.x[-1]) if answer.success else 0.0
