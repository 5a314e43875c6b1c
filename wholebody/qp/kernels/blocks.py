"""Where everything lies in the two flat arrays, of reals and of integers, that the compiled tick works on.

One array instead of eighty arguments: a call then costs no more than the arithmetic in it. A block is a row ``start
rows columns`` of the table; `wholebody.jit.packed` makes the table, compiled code takes blocks out of it.
"""

# Reals that belong to the robot and the configuration.
(TABLE, ARMATURE, GRAVITY, FRAME_R, LOCAL_POINTS, JOINTS, TAU_MAX, TAU_FULL, POSTURE_GAIN, HAND_GAIN, COM_GAIN,
 MOMENTUM_GAIN, PELVIS_GAIN, TORSO_GAIN, HEIGHT_GAIN, CONTACT, BALANCE, PELVIS_LIMIT, TORSO_LIMIT, HEIGHT_LIMIT,
 COLLISION_LIMIT, PRICES, OPTIONS, FOOT_REF, EDGES, MOVES) = range(26)  # fmt: skip
# Reals that are given every tick.
(Q_, V_, SHARE, HAND_REF, COM_REF, PELVIS_REF, TORSO_REF, HEIGHT_REF, POSTURE_REF, PAIRS) = range(26, 36)
# Kinematics and dynamics.
(R_, P_, S_, TWIST, DRIFT, INERTIA_, MOMENTA, FORCES, M_, F_, NLE, SUMS_, FR_, FP_, FV_, FA_, FJ_) = range(36, 53)
# The program.
(POINTS, ARMS, LOW, HIGH, TAU, JS_, SOFT_UPPER, LOWER, UPPER, VALUE, B_, BETA, Z_, DV_P, CONTACT_TARGET, GRAM, W_,
 TARGET, WEIGHT, BODY_TARGET, BODY_WEIGHT, POSTURE_TARGET, K_, K_RHS, REDUCED_F, W_P, KF_, H_, U_, G_, Y0, CENTRE,
 ROOT) = range(53, 86)  # fmt: skip
# The working set and the answer.
(QR_Q, QR_R, RHS, LAM, SIDES, Y_, WANTED, ROW_M, U_VEC, X_Y, A_V, A_F, A_S, WRENCH, SIX_A, SIX_B, SCRATCH,
 COEFFICIENTS, GRADIENT, GRADIENT_F, REDUCED_G, SIZE, FRAME_ROWS, DESIRED, STEP,
 DV, FORCE, SLACK, TAU_OUT, CENTRE_NOW, COMMAND, RESIDUALS, DUAL) = range(86, 119)  # fmt: skip
# Distances.
(TRIGGER, TURNED, REACH, SUFFIX, ROOM, KEEP, DISTANCE_, BOUND_, MEASURED, SIMPLEX, GJK, ROUNDS, VERTICES) = range(
    119, 132
)
# Heights over the floor.
FLOOR_LIMIT, FLOOR_REACH = 132, 133
FRAME_P = 134
BLOCKS = 135

# Integers.
(PARENT, FRAME_BODY, BOUND, FREE, OWNER, DRIVEN, PAIR_BODY, PAIR_NOW, PAIR_BEFORE, ROWS, COUNTS, MOTORS, FINGERS,
 CHAIN_START, CHAIN_JOINT, PAIR_SHAPES, PAIR_LEVEL, KNOWN, GJK_STATE, UNSURE_PAIRS, NEAREST, SHAPES, EDGE_START,
 EDGE_END, FLOOR_BODY, FLOOR_VERTEX) = range(26)  # fmt: skip
INT_BLOCKS = 26

# Entries of COUNTS.
(N_CONTACTS, N_EDGES, N_PAIRS, N_WORKING, N_PAIRS_BEFORE, HANDS, TRUNK, ITERATIONS, ITERATION_LIMIT, LEAST_PAIRS,
 N_UNSURE) = range(11)  # fmt: skip
COUNTS_SIZE = 11

# Entries of OPTIONS, and of PRICES.
HORIZON, POSTURE_PULL, TOLERANCE, PRIMAL_ACCEPTED, DUAL_ACCEPTED = range(5)
PRICE_ACCELERATION, PRICE_FORCE, PRICE_SLACK, PRICE_SLACK_SQUARED = range(4)

# Entries of RESIDUALS.
PRIMAL, STATIONARITY, COMPLEMENTARITY = range(3)

# What the compiled tick answers.
SOLVED, INFEASIBLE, TOO_MANY_ITERATIONS, NOT_CONVEX, NO_CONTACT = range(5)


def matrix(memory, k):
    """Block ``k`` of ``memory``, an array and the table of its blocks, as a matrix that shares its memory."""
    array, table = memory
    start, rows, columns = table[k, 0], table[k, 1], table[k, 2]
    return array[start : start + rows * columns].reshape((rows, columns))


def vector(memory, k):
    """Block ``k`` as a vector that shares its memory."""
    array, table = memory
    return array[table[k, 0] : table[k, 0] + table[k, 1] * table[k, 2]]


def cube(memory, k):
    """Block ``k``, shape (n, 9), as n matrices (3, 3) that share its memory."""
    array, table = memory
    return array[table[k, 0] : table[k, 0] + 9 * table[k, 1]].reshape((table[k, 1], 3, 3))
