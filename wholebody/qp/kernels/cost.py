r"""The cost of the whole-body program in reduced variables; compiles with numba as it stands.

The equalities of `wholebody.qp.formulation` are eliminated:

* ``dv = dv_p + Z y``: ``Z`` spans the accelerations that the contacts allow. Columns of ``v`` that move a contact are
  *bound*; the others are *free* and are entries of ``y`` themselves, after the coordinates of ``Z``.
* ``f = G' W (F' dv + f_0) + e``: the shortest point forces with the wrench on the robot that ``dv`` needs (``F`` and
  ``f_0`` of `rigid_body`, ``G`` maps point forces to that wrench, ``W = (G G')^-1``), plus forces ``e`` that cancel.

Cost and constraints of ``y`` and ``e`` are then apart: ``1/2 y' H y + g' y`` and ``1/2 price |e|^2``.
"""

from wholebody.robot.kernels.frames import shorten
from wholebody.robot.kernels.rotation import rotation_between


def frame_targets(q, ref, share, gain, R, x, velocity, drift, target, weight, scratch):
    """Target and weights (6,) of a hand, as `HandTask`.

    Args:
        q: Configuration; its first three entries are the origin of the base.
        ref: Rotation (9), position (3), twist (6) and acceleration (6), (24,).
        share: Factor on the weights.
        gain: ``kp kd pull_linear pull_angular weight_position weight_orientation`` (6,).
        R: Rotation of the frame (3, 3).
        x: Its offset (3,).
        velocity: (6,).
        drift: (6,).
        target: Out (6,).
        weight: Out (6,).
        scratch: (6,).
    """
    rotation_between(ref[:9].reshape((3, 3)), R, scratch[3:])
    for k in range(3):
        scratch[k] = gain[0] * (ref[9 + k] - q[k] - x[k])
        scratch[3 + k] *= gain[0]
    shorten(scratch, 0, gain[2])
    shorten(scratch, 3, gain[3])
    for k in range(6):
        target[k] = ref[18 + k] + gain[1] * (ref[12 + k] - velocity[k]) + scratch[k] - drift[k]
        weight[k] = share * gain[4 + k // 3]


def turn_target(ref, gain, R, velocity, drift, target, weight, scratch):
    """Target and weights of the angular rows of a body, as `OrientationTask`.

    Args:
        ref: Rotation (9), rate (3) and acceleration (3), (15,).
        gain: ``kp kd pull weight`` (4,).
        R: Rotation of the body (3, 3).
        velocity: (6,).
        drift: (6,).
        target: Out (6,).
        weight: Out (6,).
        scratch: (6,).
    """
    rotation_between(ref[:9].reshape((3, 3)), R, scratch)
    for k in range(3):
        scratch[k] *= gain[0]
    shorten(scratch, 0, gain[2])
    for k in range(3):
        target[3 + k] = ref[12 + k] + scratch[k] + gain[1] * (ref[9 + k] - velocity[3 + k]) - drift[3 + k]
        weight[3 + k] = gain[3]


def height_target(ref, gain, z, velocity, drift, target, weight):
    """Target and weight of the vertical row of a body, as `HeightTask`; ``ref`` is height, rate, acceleration."""
    pull = min(max(gain[0] * (ref[0] - z), -gain[2]), gain[2])
    target[2] = ref[2] + pull + gain[1] * (ref[1] - velocity[2]) - drift[2]
    weight[2] = gain[3]


def whole_body_target(sums, ref, com_gain, momentum_gain, target, weight, scratch):
    """Targets and weights of centre of mass and angular momentum, (6,) each, as `ComTask` and `AngularMomentumTask`.

    Args:
        sums: Of `rigid_body`: centre of mass, velocity, drift, momentum, its drift.
        ref: Position, velocity and acceleration of the centre of mass, momentum and its rate, (15,).
        com_gain: ``kp kd pull`` and three weights (6,).
        momentum_gain: ``kd weight`` (2,).
        target: Out (6,).
        weight: Out (6,).
        scratch: (3,).
    """
    for k in range(3):
        scratch[k] = com_gain[0] * (ref[k] - sums[k])
    shorten(scratch, 0, com_gain[2])
    for k in range(3):
        target[k] = ref[6 + k] + com_gain[1] * (ref[3 + k] - sums[3 + k]) + scratch[k] - sums[6 + k]
        weight[k] = com_gain[3 + k]
        target[3 + k] = ref[12 + k] + momentum_gain[0] * (ref[9 + k] - sums[9 + k]) - sums[12 + k]
        weight[3 + k] = momentum_gain[1]


def posture_target(q, v, ref, gain, pull, target):
    """Targets of the joints (n,), as `PostureTask`; ``ref`` and ``gain`` are rows ``q dq ddq`` and ``kp kd weight``."""
    for j in range(target.shape[0]):
        error = min(max(gain[0, j] * (ref[0, j] - q[7 + j]), -pull), pull)
        target[j] = ref[2, j] + gain[1, j] * (ref[1, j] - v[6 + j]) + error


def contact_gram(P, gram):
    """``G G'`` (6, 6) of the contact points at offsets P (k, 3)."""
    for a in range(6):
        for b in range(6):
            gram[a, b] = 0.0
    n = P.shape[0]
    for i in range(n):
        x, y, z = P[i, 0], P[i, 1], P[i, 2]
        gram[0, 4] += z
        gram[0, 5] -= y
        gram[1, 3] -= z
        gram[1, 5] += x
        gram[2, 3] += y
        gram[2, 4] -= x
        gram[3, 3] += y * y + z * z
        gram[4, 4] += x * x + z * z
        gram[5, 5] += x * x + y * y
        gram[3, 4] -= x * y
        gram[3, 5] -= x * z
        gram[4, 5] -= y * z
    for a in range(3):
        gram[a, a] = n
    for a in range(6):
        for b in range(a):
            gram[a, b] = gram[b, a]


def reduce_row(row, bound, free, Z, out):
    """``out = row Z_full``: a row over ``v`` in the reduced variables."""
    nr = Z.shape[1]
    for r in range(nr):
        out[r] = 0.0
    for i in range(bound.shape[0]):
        c = row[bound[i]]
        if c != 0.0:
            for r in range(nr):
                out[r] += c * Z[i, r]
    for k in range(free.shape[0]):
        out[nr + k] = row[free[k]]


def expand(y, dv_p, bound, free, Z, dv):
    """``dv = dv_p + Z y``; ``dv_p`` lists the bound columns only."""
    nr = Z.shape[1]
    for i in range(bound.shape[0]):
        total = dv_p[i]
        for r in range(nr):
            total += Z[i, r] * y[r]
        dv[bound[i]] = total
    for k in range(free.shape[0]):
        dv[free[k]] = y[nr + k]


def add_six(left, right, ny, H):
    """Add ``left' right`` of two blocks of rows (6, ny), symmetric, to the upper triangle of H."""
    r0, r1, r2, r3, r4, r5 = right[0], right[1], right[2], right[3], right[4], right[5]
    for a in range(ny):
        c0, c1, c2, c3, c4, c5 = left[0, a], left[1, a], left[2, a], left[3, a], left[4, a], left[5, a]
        if c0 == 0.0 and c1 == 0.0 and c2 == 0.0 and c3 == 0.0 and c4 == 0.0 and c5 == 0.0:
            continue
        row = H[a]
        # Whole rows: what lies below the diagonal is never read, and vectors need no ragged start.
        for b in range(ny):
            row[b] += c0 * r0[b] + c1 * r1[b] + c2 * r2[b] + c3 * r3[b] + c4 * r4[b] + c5 * r5[b]


def add_frame(rows, weight, left, weighted, ny, H, g):
    """Add ``1/2 sum weight_r (rows_r y - left_r)^2`` of the six rows of a frame to the cost; upper triangle of H."""
    for r in range(6):
        w, t, row, scaled = weight[r], weight[r] * left[r], rows[r], weighted[r]
        for j in range(ny):
            scaled[j] = w * row[j]
            g[j] -= t * row[j]
    add_six(rows, weighted, ny, H)


def wrench_cost(centre, mass, W, root, target, weight, price, K, k):
    """Cost of the wrench ``w = F' dv`` on the robot: centre of mass, momentum and contact forces, ``1/2 w'Kw - k'w``.

    Args:
        centre: Offset of the centre of mass from the base (3,).
        mass: [kg].
        W: ``(G G')^-1`` (6, 6).
        root: Force on the robot for ``dv = 0``, ``f_0`` (6,).
        target: Of `whole_body_target`.
        weight: Of `whole_body_target`.
        price: Of the squared forces.
        K: Out (6, 6).
        k: Out (6,).
    """
    x, y, z = centre[0], centre[1], centre[2]
    for a in range(6):
        k[a] = 0.0
        for b in range(6):
            K[a, b] = price * W[a, b]
            k[a] -= price * W[a, b] * root[b]
    for a in range(3):
        K[a, a] += weight[a] / (mass * mass)
        k[a] += weight[a] * target[a] / mass
        # Row a of the momentum task: moment about the base less centre x force.
        l0 = 0.0 if a == 0 else (-z if a == 1 else y)
        l1 = z if a == 0 else (0.0 if a == 1 else -x)
        l2 = -y if a == 0 else (x if a == 1 else 0.0)
        w = weight[3 + a]
        K[0, 0] += w * l0 * l0
        K[0, 1] += w * l0 * l1
        K[0, 2] += w * l0 * l2
        K[1, 0] += w * l1 * l0
        K[1, 1] += w * l1 * l1
        K[1, 2] += w * l1 * l2
        K[2, 0] += w * l2 * l0
        K[2, 1] += w * l2 * l1
        K[2, 2] += w * l2 * l2
        K[0, 3 + a] += w * l0
        K[1, 3 + a] += w * l1
        K[2, 3 + a] += w * l2
        K[3 + a, 0] += w * l0
        K[3 + a, 1] += w * l1
        K[3 + a, 2] += w * l2
        K[3 + a, 3 + a] += w
        k[0] += w * l0 * target[3 + a]
        k[1] += w * l1 * target[3 + a]
        k[2] += w * l2 * target[3 + a]
        k[3 + a] += w * target[3 + a]


def add_wrench(FR, w_p, K, k, ny, KF, H, g):
    """Add `wrench_cost` of ``w = w_p + FR' y``; FR is (6, ny), KF scratch (6, ny)."""
    for a in range(6):
        for j in range(ny):
            KF[a, j] = 0.0
        for b in range(6):
            c = K[a, b]
            for j in range(ny):
                KF[a, j] += c * FR[b, j]
        target = k[a]
        for b in range(6):
            target -= K[a, b] * w_p[b]
        for j in range(ny):
            g[j] -= target * FR[a, j]
    add_six(FR, KF, ny, H)


def add_posture(weight, target, price, bound, free, Z, dv_p, H, g):
    """Add the posture task and the price of accelerations."""
    nr = Z.shape[1]
    for i in range(bound.shape[0]):
        w, t = price, 0.0
        if bound[i] >= 6:
            w += weight[bound[i] - 6]
            t = weight[bound[i] - 6] * target[bound[i] - 6]
        pull = t - w * dv_p[i]
        for r in range(nr):
            g[r] -= pull * Z[i, r]
            for s in range(r, nr):
                H[r, s] += w * Z[i, r] * Z[i, s]
    for k in range(free.shape[0]):
        j = free[k]
        H[nr + k, nr + k] += price
        if j >= 6:
            H[nr + k, nr + k] += weight[j - 6]
            g[nr + k] -= weight[j - 6] * target[j - 6]
