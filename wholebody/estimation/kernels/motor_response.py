"""How motors answer, by many models of them side by side; compiled by `wholebody.jit.entry`.

A motor is asked for ``u + p``: by the commands ``u = tau + kp q_cmd + kd dq_cmd``, which may be late, and by its own
position loop ``p = -kp q - kd dq``. A model is a filter of the torque and a delay of the commands. Each predicts the
changes of the torques of a group of joints, added up with weights; that of the largest correlation is the likeliest.
"""

from __future__ import annotations

from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.packed import Packed


def sent(memory: Packed, tau: Vector, q: Vector, dq: Vector, kp: Vector, kd: Vector) -> None:
    """Take in what motors were asked for by the last command, arrays (n,) in motor order."""
    groups, models, length = memory.before.shape[1], memory.step.shape[0], memory.late.shape[1] // 2
    memory.at = memory.at - 1 if memory.at > 0 else length - 1
    at = memory.at
    for g in range(groups):
        weight, total = memory.of_motor[g], 0.0
        for j in range(tau.shape[0]):
            total += weight[j] * (tau[j] + kp[j] * q[j] + kd[j] * dq[j])
        change = total - memory.before[0, g]
        memory.before[0, g] = total
        for m in range(models):
            row = g * models + m
            filtered = advance(memory.step[m], memory.given[m], memory.commanded[row], change)
            memory.late[row, at] = memory.late[row, at + length] = filtered


def told(memory: Packed, tau: Vector, q: Vector, v: Vector, age: int, weigh: bool, keep: float) -> None:
    """Take in torques that motors tell, and hold the models to them.

    Args:
        memory: Of the models, as in `wholebody.estimation.motor_response`.
        tau: Torques (n,), Pinocchio order [N m].
        q: Configuration (nq,) at the same time.
        v: Velocity (nv,).
        age: Control periods that have passed since.
        weigh: Whether the change since the call before counts.
        keep: Share that sums keep, 0 to 1.
    """
    groups, models, delays = memory.before.shape[1], memory.step.shape[0], memory.xx.shape[1]
    first, kp, kd = memory.at + age, memory.kp, memory.kd
    for g in range(groups):
        weight, own, measured = memory.of_joint[g], 0.0, 0.0
        for j in range(tau.shape[0]):
            own -= weight[j] * (kp[j] * q[7 + j] + kd[j] * v[6 + j])
            measured += weight[j] * tau[j]
        # A torque belongs to the state before it.
        change, y = memory.before[2, g] - memory.before[1, g], measured - memory.before[3, g]
        memory.before[1, g], memory.before[2, g], memory.before[3, g] = memory.before[2, g], own, measured
        if weigh:
            memory.yy[g] = keep * memory.yy[g] + y * y
        for m in range(models):
            row = g * models + m
            p = advance(memory.step[m], memory.given[m], memory.own[row], change)
            if weigh:
                weigh_delays(memory.late[row][first : first + delays], p, y, keep, memory.xx[row], memory.xy[row])


def weigh_delays(late: Vector, p: float, y: float, keep: float, xx: Vector, xy: Vector) -> None:
    """Add the products of a prediction ``p + late`` and of it with ``y`` to their sums, for each delay (n,)."""
    for d in range(xx.shape[0]):
        x = p + late[d]
        xx[d] = keep * xx[d] + x * x
        xy[d] = keep * xy[d] + x * y


def advance(step: Matrix, given: Vector, state: Vector, value: float) -> float:
    """Output of a filter of second order after a period: ``state' = step state + given value``, step (2, 2)."""
    y = step[0, 0] * state[0] + step[0, 1] * state[1] + given[0] * value
    state[1] = step[1, 0] * state[0] + step[1, 1] * state[1] + given[1] * value
    state[0] = y
    return y


def likeliest(memory: Packed, least: float, floor: float) -> None:
    """Leave the model and delay in ``best`` whose product of shares that it leaves unexplained is least.

    Args:
        memory: Of the models; ``score`` are that product and that of the model that is believed now.
        least: Share below which groups are as well explained as can be.
        floor: Sum of squares below which a group says nothing [N^2 m^2].
    """
    groups, models, delays = memory.before.shape[1], memory.step.shape[0], memory.xx.shape[1]
    memory.score[0] = 2.0
    for m in range(models):
        for d in range(delays):
            score = 1.0
            for g in range(groups):
                xx, yy = memory.xx[g * models + m, d], memory.yy[g]
                if yy > floor and xx > 0.0:
                    unexplained = 1.0 - memory.xy[g * models + m, d] ** 2 / (xx * yy)
                    score *= max(unexplained, least)
            if score < memory.score[0]:
                memory.score[0], memory.best[0], memory.best[1] = score, m, d
            if m == memory.believed[0] and d == memory.believed[1]:
                memory.score[1] = score
