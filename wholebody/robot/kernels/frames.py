r"""Frames, rotations and nearest points from what `rigid_body` computed; compiles with numba as it stands.

Offsets are from the origin of the base, in world axes. A frame is fixed to a body; the velocities that move it are
those of the base and of the joints on the way from its body to the base.
"""

import math


def place_frames(R, p, table, body, FR, FP):
    """Rotations (k, 3, 3) and offsets (k, 3) of frames given as rows ``[R (9), p (3)]`` in their bodies."""
    for f in range(body.shape[0]):
        b = body[f]
        for a in range(3):
            x, y, z = R[b, a, 0], R[b, a, 1], R[b, a, 2]
            for c in range(3):
                FR[f, a, c] = x * table[f, c] + y * table[f, 3 + c] + z * table[f, 6 + c]
            FP[f, a] = p[b, a] + x * table[f, 9] + y * table[f, 10] + z * table[f, 11]


def move_frames(V, A, body, FP, FV, FA):
    """Velocities and classical drifts (k, 6) at the frames' own origins."""
    for f in range(body.shape[0]):
        b = body[f]
        x, y, z = FP[f, 0], FP[f, 1], FP[f, 2]
        a, b_, c = V[b, 3], V[b, 4], V[b, 5]
        vx, vy, vz = V[b, 0] + b_ * z - c * y, V[b, 1] + c * x - a * z, V[b, 2] + a * y - b_ * x
        FV[f, 0], FV[f, 1], FV[f, 2], FV[f, 3], FV[f, 4], FV[f, 5] = vx, vy, vz, a, b_, c
        d, e, g = A[b, 3], A[b, 4], A[b, 5]
        FA[f, 0] = A[b, 0] + e * z - g * y + b_ * vz - c * vy
        FA[f, 1] = A[b, 1] + g * x - d * z + c * vx - a * vz
        FA[f, 2] = A[b, 2] + d * y - e * x + a * vy - b_ * vx
        FA[f, 3], FA[f, 4], FA[f, 5] = d, e, g


def frame_columns(S, parent, body, x, J, row):
    """Fill rows ``row`` to ``row + 5`` of J with the Jacobian of a frame at offset ``x``; other columns stay zero."""
    k = body
    while k > 0:
        fill_column(S, 5 + k, x, J, row)
        k = parent[k]
    for column in range(6):
        fill_column(S, column, x, J, row)


def fill_column(S, c, x, J, row):
    """One column of `frame_columns`."""
    a, b, g = S[c, 3], S[c, 4], S[c, 5]
    J[row, c] = S[c, 0] + b * x[2] - g * x[1]
    J[row + 1, c] = S[c, 1] + g * x[0] - a * x[2]
    J[row + 2, c] = S[c, 2] + a * x[1] - b * x[0]
    J[row + 3, c], J[row + 4, c], J[row + 5, c] = a, b, g


def rotation_error(ref, R, out):
    """Rotation vector (3,) of ``R_ref R'``; ``ref`` is flat (9,), ``R`` (3, 3).

    The formula next to half a turn is Pinocchio's, so that both give the same vector there.
    """
    xx = ref[0] * R[0, 0] + ref[1] * R[0, 1] + ref[2] * R[0, 2]
    xy = ref[0] * R[1, 0] + ref[1] * R[1, 1] + ref[2] * R[1, 2]
    xz = ref[0] * R[2, 0] + ref[1] * R[2, 1] + ref[2] * R[2, 2]
    yx = ref[3] * R[0, 0] + ref[4] * R[0, 1] + ref[5] * R[0, 2]
    yy = ref[3] * R[1, 0] + ref[4] * R[1, 1] + ref[5] * R[1, 2]
    yz = ref[3] * R[2, 0] + ref[4] * R[2, 1] + ref[5] * R[2, 2]
    zx = ref[6] * R[0, 0] + ref[7] * R[0, 1] + ref[8] * R[0, 2]
    zy = ref[6] * R[1, 0] + ref[7] * R[1, 1] + ref[8] * R[1, 2]
    zz = ref[6] * R[2, 0] + ref[7] * R[2, 1] + ref[8] * R[2, 2]
    x, y, z = 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)
    s, c = math.sqrt(x * x + y * y + z * z), 0.5 * (xx + yy + zz - 1.0)
    angle = math.atan2(s, c)
    if angle >= math.pi - 1e-2:
        factor = angle * angle / (1.0 - c)
        out[0] = math.copysign(math.sqrt(max((xx - c) * factor, 0.0)), x)
        out[1] = math.copysign(math.sqrt(max((yy - c) * factor, 0.0)), y)
        out[2] = math.copysign(math.sqrt(max((zz - c) * factor, 0.0)), z)
        return
    factor = angle / s if s > 1e-8 else 1.0
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


def shorten(x, start, largest):
    """Scale three entries to a norm of at most ``largest``; keeps their direction."""
    size = math.sqrt(x[start] * x[start] + x[start + 1] * x[start + 1] + x[start + 2] * x[start + 2])
    if size > largest:
        for k in range(start, start + 3):
            x[k] *= largest / size


def point_columns(S, parent, body, x, normal, sign, row):
    """Add ``sign`` times the speed along ``normal`` of the point of a body at offset ``x`` to ``row`` (nv,)."""
    mx = x[1] * normal[2] - x[2] * normal[1]
    my = x[2] * normal[0] - x[0] * normal[2]
    mz = x[0] * normal[1] - x[1] * normal[0]
    k = body
    while k > 0:
        c = 5 + k
        along = S[c, 0] * normal[0] + S[c, 1] * normal[1] + S[c, 2] * normal[2]
        row[c] += sign * (along + S[c, 3] * mx + S[c, 4] * my + S[c, 5] * mz)
        k = parent[k]
    for c in range(6):
        along = S[c, 0] * normal[0] + S[c, 1] * normal[1] + S[c, 2] * normal[2]
        row[c] += sign * (along + S[c, 3] * mx + S[c, 4] * my + S[c, 5] * mz)


def point_speed(V, x, normal):
    """Speed along ``normal`` of the point at offset ``x`` of a body with twist ``V`` (6,)."""
    vx, vy, vz = V[0] + V[4] * x[2] - V[5] * x[1], V[1] + V[5] * x[0] - V[3] * x[2], V[2] + V[3] * x[1] - V[4] * x[0]
    return vx * normal[0] + vy * normal[1] + vz * normal[2]


def point_drift(V, A, x, normal):
    """Classical acceleration along ``normal`` of that point when ``dv = 0``; ``A`` (6,) is the body's drift."""
    a, b, c = V[3], V[4], V[5]
    vx, vy, vz = V[0] + b * x[2] - c * x[1], V[1] + c * x[0] - a * x[2], V[2] + a * x[1] - b * x[0]
    ax = A[0] + A[4] * x[2] - A[5] * x[1] + b * vz - c * vy
    ay = A[1] + A[5] * x[0] - A[3] * x[2] + c * vx - a * vz
    az = A[2] + A[3] * x[1] - A[4] * x[0] + a * vy - b * vx
    return ax * normal[0] + ay * normal[1] + az * normal[2]
