"""The program at one state, from dynamics to the factored Hessian."""

from __future__ import annotations

from wholebody.jit.packed import Packed
from wholebody.qp.kernels.active_set import NO_CONTACT, NOT_CONVEX, SOLVED
from wholebody.qp.kernels.constraints import bounds
from wholebody.qp.kernels.contacts import contacts
from wholebody.qp.kernels.cost import cost
from wholebody.qp.kernels.limits import limits
from wholebody.qp.kernels.targets import targets
from wholebody.robot.kernels.frames import PALM_FRAME, frame_columns, move_frames, place_frames
from wholebody.robot.kernels.rigid_body import dynamics
from wholebody.robot.kernels.spatial import add_force_at
from wholebody.robot.touch import FORCE, MOMENT, SHARE


def move(tick: Packed) -> None:
    """Dynamics, frames and their Jacobians at ``q`` and ``v``."""
    q, body, frame_p = tick.q, tick.frame_body, tick.frame_p
    dynamics(
        q, tick.v, tick.bodies, tick.parent, tick.armature, tick.gravity, tick.R, tick.p, tick.S, tick.V, tick.A,
        tick.inertia, tick.momentum, tick.force, tick.M, tick.F, tick.nle, tick.sums,
    )  # fmt: skip
    place_frames(tick.R, tick.p, body, tick.frame_R_local, tick.frame_p_local, tick.frame_R, frame_p)
    move_frames(tick.V, tick.A, body, frame_p, tick.frame_V, tick.frame_A)
    for f in range(body.shape[0]):
        frame_columns(tick.S, tick.parent, body[f], frame_p[f], tick.J, 6 * f)
    for k in range(3):
        tick.centre[k] = tick.sums[k] - q[k]
    for k in range(6):
        tick.f_0[k], tick.com[k] = tick.force[0, k], tick.sums[k]
    for i in range(2):
        count_on_touch(tick, i, PALM_FRAME + i)


def count_on_touch(tick: Packed, i: int, f: int) -> None:
    """Take the force and moment on hand ``i``, at frame ``f``, out of the bias forces ``nle`` and ``f_0``."""
    touch, nle, J = tick.touch[i], tick.nle, tick.J
    if not touch[SHARE] > 0.0:
        return
    for k in range(6):
        for c in range(nle.shape[0]):
            nle[c] -= J[6 * f + k, c] * touch[FORCE + k]
    add_force_at(tick.frame_p[f], -touch[FORCE], -touch[FORCE + 1], -touch[FORCE + 2], tick.f_0)
    for k in range(3):
        tick.f_0[3 + k] -= touch[MOMENT + k]


def assemble(tick: Packed) -> int:
    """Everything before the solution; one of the codes of `active_set`."""
    limits(tick)
    bounds(tick)
    if not contacts(tick):
        return NO_CONTACT
    targets(tick)
    return SOLVED if cost(tick) else NOT_CONVEX
