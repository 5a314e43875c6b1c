"""The state of the robot from what it reads itself: joints, their torques, and the IMU in the pelvis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio
from models.spec import RobotSpec
from wholebody.errors import InputError
from wholebody.estimation.kernels import estimate as kernel
from wholebody.estimation.kernels.estimate import BEGIN, LEVEL_FIRST
from wholebody.estimation.kernels.invariant_filter import SIZE
from wholebody.estimation.readings import Readings
from wholebody.jit.entry import Entry
from wholebody.jit.packed import Packed
from wholebody.robot.body_table import body_table
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.kernels.bodies import BODY
from wholebody.types import RobotState

GAP_MAX = 0.05
"""Longest time between readings that the IMU bridges [s]; chosen: beyond it the filter begins anew."""
PRESSED_SHARE = 0.06
"""Share of the weight below which a foot does not stand, and twice that above which it stands again; chosen: 20 N, what
dry friction of a leg's joints can feign."""
GYRO_NOISE, ACC_NOISE = 4.5e-4, 0.02
"""Noise of gyro [rad/s per sqrt(Hz)] and accelerometer [m/s^2 per sqrt(Hz)]; chosen: 0.01 rad/s and some 0.4 m/s^2
at 500 Hz, of which most is the pelvis shaking, not the sensor."""
GYRO_WALK, ACC_WALK = 1e-4, 1e-3
"""How their biases wander [rad/s, m/s^2 per sqrt(s)]; chosen: as slowly as they warm up."""
SOLE_WALK, SOLE_FREE = 2e-4, 3.0
"""How soles wander that stand, and that do not [m per sqrt(s)]; chosen: 1.5 mm in a minute, which with `LEG_NOISE`
believes a sole that has slid within a second; and wherever the leg says."""
ACC_UNKNOWN = 1.0
"""What the velocity may do without an accelerometer [m/s per sqrt(s)]; chosen: 3 m/s^2 for a tenth of a second."""
TILT_NOISE, LEG_NOISE = 2e-3, 1e-3
"""Noise of the IMU's vertical [rad] and of a sole's place by the legs [m] at each reading; chosen: 0.1 degrees, of
which a part stays; a sole that gives."""
LEVEL_SHARE = 0.7
"""Share of the soles' normal in the vertical on a level floor, the IMU has the rest [no unit]; derived: 0.3 degrees
of tilt are 3.7 mrad about an axis, encoders that are off by 2 mrad turn the mean of both soles by 2.2, weights go by
the inverse squares."""
FIRST = (5e-3, 1e-3, 0.05, 1e-3, 1e-3, 1e-3, 0.01, 0.1)
"""First errors of tilt [rad], yaw [rad], velocity [m/s], place and soles [m], gyro [rad/s] and accelerometer
[m/s^2]; chosen: offsets of 2 mrad in the legs, 0.3 degrees in the IMU."""

_estimate = Entry(kernel.estimate)


class StateEstimator:
    """Contact-aided invariant filter for a robot on its feet.

    World is midway between the soles at the first reading, x the mean of their directions, z up. Afterwards gyro and
    accelerometer carry the state on; the IMU's vertical, and soles that stand where they are, correct it. Its yaw,
    which drifts, is not used: the soles hold the yaw, and tell the gyro's bias. Which foot stands is known by the
    torques of its leg and by what it is told to `expect`; without either both are taken to. Without an accelerometer
    the legs alone say how fast it is.

    An error of the IMU's tilt and a floor that slopes cannot be told apart. A floor that looks less steep than
    0.015 rad is taken to be level, and both soles to be flat on it: the vertical is a mean of the soles' and the IMU's
    then. On one that looks twice as steep the IMU alone counts.

    Args:
        spec: The robot.
        level_floor: Whether floors that look nearly level are; if not, the IMU alone says what is vertical.

    Attributes:
        stands: Whether each foot stands, shape (2,), left first.
        pressed: Force of the floor along the normal of each sole, shape (2,), [N]; zeros without torques.
        gyro_bias: As learned [rad/s]. acc_bias: Likewise [m/s^2].
        covariance: That of the last state.
    """

    settling = LEVEL_FIRST
    """Time at rest that it takes until its states are as good as they get [s]; derived: noise is gone by then."""

    def __init__(self, spec: RobotSpec, *, level_floor: bool = True) -> None:
        whole = load_pinocchio(spec)
        self._names = list(whole.names)[2:]
        ankles = [whole.frames[whole.getFrameId(foot.frame)].parentJoint for foot in spec.feet]
        legs = sorted({joint for ankle in ankles for joint in whole.supports[ankle]} - {0, 1})
        locked = [joint for joint in range(2, whole.njoints) if joint not in legs]
        model = pin.buildReducedModel(whole, locked, pin.neutral(whole))
        memory = self._memory = _memory(len(legs))
        memory.table[:], memory.parent[:] = body_table(model)
        memory.joint[:] = [whole.idx_vs[joint] - 6 for joint in legs]
        for k, foot in enumerate(spec.feet):
            ankle = model.frames[model.getFrameId(foot.frame)]
            memory.ankle[k] = ankle.parentJoint - 1
            memory.sole[k] = ankle.placement.act(foot.sole_center)
        memory.imu[:] = model.frames[model.getFrameId(spec.imu_frame)].placement.translation
        memory.R[0], memory.gravity[:] = np.eye(3), model.gravity.linear
        memory.press_min = PRESSED_SHARE * pin.computeTotalMass(whole) * -memory.gravity[2]
        walks = GYRO_NOISE, ACC_NOISE, GYRO_WALK, ACC_WALK, SOLE_WALK, SOLE_FREE, ACC_UNKNOWN
        memory.noise[:], memory.variance[:] = np.square(walks), np.square((TILT_NOISE, LEG_NOISE))
        tilt, yaw, speed, place, left, right, gyro, acc = np.square(FIRST)
        memory.first[:] = np.repeat([tilt, speed, place, left, right, gyro, acc], 3)
        memory.first[2], memory.level_share = yaw, LEVEL_SHARE if level_floor else 0.0
        self.stands, self.pressed = memory.stands, memory.pressed
        self.gyro_bias, self.acc_bias = memory.gyro_bias, memory.acc_bias
        self._n = n = len(self._names)
        self._no_acc, self._no_tau = np.full(3, np.nan), np.full(n, np.nan)
        given = np.zeros(4), self._no_acc, self._no_acc, self._no_tau, self._no_tau, self._no_tau
        self._estimate = _estimate.native(memory, 0.0, *given, np.zeros(7 + n), np.zeros(6 + n), np.zeros((9, 9)))
        self.expect(None)
        self.reset()

    def expect(self, contacts: ContactSchedule | None) -> None:
        """Take no foot to stand while it is up by a schedule on the clock of the readings; without one, either may."""
        self._contacts, self._memory.may_stand[:] = contacts, 1

    def reset(self) -> None:
        """Begin with the next readings; biases and the floor are forgotten."""
        self._memory.looked, self._memory.lean[:] = 0.0, 0.0
        self.gyro_bias[:], self.acc_bias[:], self._time = 0.0, 0.0, -inf
        self.stands[:], self._memory.xi[:] = 1, 0.0
        self.covariance = np.full((9, 9), np.nan)

    def state(
        self,
        *,
        time: float,
        joints: Mapping[str, float],
        speeds: Mapping[str, float],
        quat_xyzw: Sequence[float],
        gyro: Sequence[float],
        acc: Sequence[float] | None = None,
        torques: Mapping[str, float] | None = None,
    ) -> RobotState:
        """The state for one set of readings, for `Supervisor.step`.

        Args:
            time: When they were taken, on the clock of the robot [s].
            joints: Position of every joint by its name in the URDF [rad]; others are ignored.
            speeds: Likewise [rad/s].
            quat_xyzw: Orientation of the pelvis, as its IMU has it: x, y, z, w. Unitree's messages begin with w.
            gyro: Angular velocity of the pelvis in its own axes [rad/s].
            acc: What the accelerometer of the IMU says, in the same axes [m/s^2]; 9.81 upwards at rest.
            torques: Torque of every joint by its name, as the motors tell it [N m], if they do.

        Raises:
            InputError: If a joint is missing, or the quaternion or a vector has another length.
        """
        quat, w = np.array(quat_xyzw, dtype=float), np.array(gyro, dtype=float)
        f = self._no_acc if acc is None else np.array(acc, dtype=float)
        if quat.shape != (4,) or w.shape != (3,) or f.shape != (3,):
            raise InputError(
                f"quat_xyzw has shape {quat.shape}, gyro {w.shape} and acc {f.shape}; a quaternion (4,) x, y, z, w, an "
                "angular velocity (3,) [rad/s] and a specific force (3,) [m/s^2] of the pelvis are expected"
            )
        tau = None if torques is None else self._all(torques, "torques")
        return self.estimate(Readings(time, quat, w, self._all(joints, "joints"), self._all(speeds, "speeds"), tau, f))

    def estimate(self, readings: Readings) -> RobotState:
        """Estimate from readings as arrays.

        Readings of the IMU or the legs that are no numbers, or a quaternion that is none, give a state that is not
        finite and change nothing: the supervisor predicts the robot meanwhile and says so (`state_invalid`). Readings
        that are not newer change nothing either. After a gap of more than 50 ms the filter begins anew.
        """
        r, n = readings, self._n
        q, v, dt = np.empty(7 + n), np.empty(6 + n), r.time - self._time
        self.covariance = covariance = np.empty((9, 9))
        acc, tau = self._no_acc if r.acc is None else r.acc, self._no_tau if r.tau is None else r.tau
        # The compiled code takes what it is given as it lies in memory.
        given = [np.ascontiguousarray(one, dtype=float) for one in (r.quat_xyzw, r.gyro, acc, r.q, r.dq, tau)]
        if self._contacts is not None:
            self._memory.may_stand[:] = self._contacts.at(r.time).stands
        dt = max(dt, 0.0) if -GAP_MAX <= dt <= GAP_MAX else BEGIN
        if self._estimate(self._memory, dt, *given, q, v, covariance) and dt != 0.0:
            self._time = r.time
        return RobotState(r.time, q, v, r.tau, covariance, (bool(self.stands[0]), bool(self.stands[1])))

    def _all(self, readings: Mapping[str, float], what: str) -> np.ndarray:
        try:
            return np.array([readings[name] for name in self._names], dtype=float)
        except KeyError:
            missing = [name for name in self._names if name not in readings]
            raise InputError(
                f"{what} lack {', '.join(missing[:5])}{' and others' if len(missing) > 5 else ''}: {len(missing)} of "
                f"{len(self._names)}; a number for every joint of the robot is expected, by its name in the URDF"
            ) from None


def _memory(joints: int) -> Packed:
    """What goes on from reading to reading, for legs of so many joints together.

    ``x`` is position [m] and orientation of the IMU in world, ``v`` its velocity, ``d`` are the soles; ``P`` is the
    covariance of the filter's error ``xi``. ``lean`` is the mean difference of the soles' normal and the IMU's vertical
    [rad], ``looked`` the time in it [s]; ``landings`` are feet that were set down. ``h`` are the soles from the IMU in
    the axes of the base. Constant are what stands in ``table`` to ``first`` and the integers but ``stands`` and
    ``may_stand``; the rest is for the arithmetic.
    """
    bodies = 1 + joints
    constant = {"table": (bodies, BODY), "sole": (2, 3), "imu": (3,), "gravity": (3,), "noise": (7,)}
    constant |= {"variance": (2,), "first": (SIZE,), "press_min": (), "level_share": ()}
    kept = {"x": (7,), "v": (3,), "d": (2, 3), "gyro_bias": (3,), "acc_bias": (3,), "P": (SIZE, SIZE), "pressed": (2,)}
    kept |= {"lean": (2,), "looked": (), "landings": ()}
    body = {"R": (bodies, 3, 3), "p": (bodies, 3), "S": (5 + bodies, 6), "angles": (6 + bodies,), "h": (2, 3)}
    body |= {"J": (6, 6), "force": (6,), "wrench": (2, 6), "place": (3,)}
    work = {"gyro": (3,), "felt": (3,), "Rw": (3, 3), "Ri": (3, 3), "Re": (3, 3), "E": (7,), "B": (15, 3)}
    work |= {"K": (SIZE,), "xi": (SIZE,)}
    integers = {"parent": (bodies,), "joint": (joints,), "ankle": (2,), "stands": (2,)}
    integers["may_stand"] = (2,)
    return Packed(constant | kept | body | work, integers)
