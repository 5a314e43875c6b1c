"""Recordings as they come, and what goes wrong with them: pieces of motions with fingers and states, and corruptions.

What cannot be told from the numbers, and is not here: the fingers of a Dex3 hand index for middle (their ranges and
motions are the same), the polarity of a gripper by itself, wrist yaw, roll, pitch for roll, pitch, yaw (names say it,
ranges do not), a recording at half or twice its rate without doubled rows, a tool 5 cm off without joints beside it, a
root w first that faces back, and anything about a robot that stands still.
"""

from dataclasses import dataclass, replace

import numpy as np

from models import g1
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.geometry.rotations import matrix_to_quaternion, matrix_to_rot6d, quaternion_to_matrix, rotvec_to_matrix
from policy.geometry.se3 import make_transform
from policy.kinematics.forward import kinematics
from policy.suspicion.joint_table import joint_findings
from policy.suspicion.orders import ISAAC
from policy.suspicion.poses import root_findings, wrist_findings
from policy.suspicion.rows import row_findings, state_findings
from policy.suspicion.tool import tool_findings

ROBOT = g1()
BODY = ROBOT.body_joints
FINGERS = (*ROBOT.tool("left").finger_joints, *ROBOT.tool("right").finger_joints)
NAMES = (*BODY, *FINGERS)
UPPER = tuple(range(len(BODY) - 14, len(NAMES)))
EEF = builtin("decoupled_wbc_eef14")


@dataclass(frozen=True)
class Recording:
    """A piece of a motion: names and numbers of joints, root, states beside actions, wrists in a layout."""

    names: tuple
    q: np.ndarray
    root: np.ndarray
    quaternion: np.ndarray
    state: np.ndarray
    spec: object
    wrists: np.ndarray
    every: tuple = ()


def clean(motions, rng):
    """A piece of 2 to 5 s at 30 Hz, with fingers that open and close, and states that lag and shake."""
    motion = motions[rng.integers(len(motions))]
    length = min(int(rng.uniform(2.0, 5.0) * 30.0), len(motion) // 2)
    start = int(rng.integers(len(motion) - 2 * length + 1))
    rows = slice(start, start + 2 * length, 2)
    closing = 0.5 - 0.5 * np.cos(np.linspace(0.0, rng.uniform(1.0, 6.0), length) + rng.uniform(0.0, 6.0))
    is_open, closed = np.array(ROBOT.hand_open), np.array(ROBOT.hand_closed)
    fingers = is_open + 0.9 * closing[:, None] * (closed - is_open)
    body, T = motion.q_body[rows], motion.T_world_base[rows]
    q = np.hstack([body, fingers])
    names, columns = NAMES, np.arange(len(NAMES))
    if rng.uniform() < 0.5:  # arms and hands alone, as most datasets have them
        columns = np.array(UPPER)
        names = tuple(NAMES[i] for i in columns)
    state = np.vstack([q[:1], q[:1], q])[: len(q)] + rng.normal(0.0, 2e-3, q.shape)
    poses = kinematics().poses(body)
    parts = [
        np.hstack([P[:, :3, 3], matrix_to_quaternion(P[:, :3, :3], "wxyz")]) for P in (poses["lhand"], poses["rhand"])
    ]
    quaternion = matrix_to_quaternion(T[:, :3, :3], "xyzw")
    return Recording(names, q[:, columns], T, quaternion, state[:, columns], EEF, np.hstack(parts), (q, state))


def findings(one):
    """All hypotheses about a recording."""
    found = joint_findings(one.names, one.q, ROBOT) + row_findings(one.q)
    found += state_findings(one.state, one.q, one.names)
    found += root_findings(one.root, one.quaternion)
    found += wrist_findings(one.spec, one.wrists, Anchor.nominal())
    if one.spec is EEF:
        poses = kinematics().poses(one.every[1][:, : len(BODY)])  # by the measured joints, which come later
        for side, hand, start in (("left", "lhand", 0), ("right", "rhand", 7)):
            found += tool_findings(side, poses[hand], one.wrists[:, start : start + 3])
    return found


def corrupted(corrupt, one, rng):
    """A recording with something wrong; states that it does not change follow what it makes of the actions."""
    wrong = corrupt(one, rng)
    if wrong.state is one.state and wrong.q is not one.q:
        q = wrong.q
        state = np.vstack([q[:1], q[:1], q])[: len(q)]
        wrong = replace(wrong, state=state + 1e-3 * np.ptp(q, axis=0) * rng.normal(0.0, 1.0, q.shape))
    return wrong


def isaac(one, rng):
    """All 43 columns, the body's in Isaac's order."""
    order = [*ISAAC, *range(len(BODY), len(NAMES))]
    q, state = (values[:, order] for values in one.every)
    return replace(one, names=NAMES, q=q, state=state)


def left_right(one, rng):
    other = [one.names.index(n.replace("left", "#").replace("right", "left").replace("#", "right")) for n in one.names]
    return replace(one, q=one.q[:, other])


def fingers_by_name(one, rng):
    """Each hand's fingers sorted by name, as Pinocchio has them."""
    q = one.q.copy()
    for side in ("left", "right"):
        hand = [name for name in one.names if name in ROBOT.tool(side).finger_joints]
        q[:, [one.names.index(n) for n in hand]] = one.q[:, [one.names.index(n) for n in sorted(hand)]]
    return replace(one, q=q)


def pinocchio(one, rng):
    order = [name for part in ("left_leg", "right_leg", "waist") for name in (BODY[i] for i in ROBOT.limbs[part])]
    for side in ("left", "right"):
        order += [BODY[i] for i in ROBOT.limbs[f"{side}_arm"]] + sorted(ROBOT.tool(side).finger_joints)
    order = [name for name in order if name in one.names]
    return replace(one, q=one.q[:, [one.names.index(name) for name in order]])


def mirrored_fingers(one, rng):
    bent = np.array([name in FINGERS and "_thumb_" not in name for name in one.names])
    return replace(one, q=np.where(bent, -one.q, one.q))


def degrees(one, rng):
    return replace(one, q=np.rad2deg(one.q))


def half_degrees(one, rng):
    arm = np.array(["arm" in name or "shoulder" in name or "elbow" in name or "wrist" in name for name in one.names])
    return replace(one, q=np.where(arm, np.rad2deg(one.q), one.q))


def millimetres(one, rng):
    return replace(one, root=make_transform(one.root[:, :3, :3], 1e3 * one.root[:, :3, 3]))


def w_first(one, rng):
    # Recordings begin facing ahead, or nearly: one that begins facing back is upright either way.
    turned = _turned(one.root, rng.uniform(-1.0, 1.0))
    wrong = matrix_to_quaternion(turned[:, :3, :3], "wxyz")
    R = quaternion_to_matrix(wrong, "xyzw")
    return replace(one, quaternion=wrong, root=make_transform(R, one.root[:, :3, 3]))


def _turned(T, heading):
    """Poses (n, 4, 4) turned about the vertical, so that the first one has a heading [rad]."""
    turn = rotvec_to_matrix(np.array([0.0, 0.0, heading - np.arctan2(T[0, 1, 0], T[0, 0, 0])]))
    return make_transform(turn, np.zeros(3)) @ T


def upside_down(one, rng):
    R = one.root[:, :3, :3] @ np.diag([1.0, -1.0, -1.0])
    return replace(one, root=make_transform(R, one.root[:, :3, 3]), quaternion=matrix_to_quaternion(R, "xyzw"))


def wrist_quaternion(one, rng):
    wrists = one.wrists.copy()
    for start in (3, 10):
        wrists[:, start : start + 4] = np.roll(one.wrists[:, start : start + 4], -1, axis=1)
    return replace(one, wrists=wrists)


def tool_off(one, rng):
    """Both hands' positions 5 cm off their wrists along an axis of the hand, as teleoperation has it."""
    wrists, away = one.wrists.copy(), 0.05 * np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
    for start in (0, 7):
        R = quaternion_to_matrix(one.wrists[:, start + 3 : start + 7], "wxyz")
        wrists[:, start : start + 3] += R @ away
    return replace(one, wrists=wrists)


def rot6d(layout):
    def corrupt(one, rng):
        parts = []
        for start in (0, 7):
            R = quaternion_to_matrix(one.wrists[:, start + 3 : start + 7], "wxyz")
            parts += [one.wrists[:, start : start + 3], matrix_to_rot6d(R, layout)]
        wrists = np.hstack([*parts, np.zeros((len(one.wrists), 14))])
        return replace(one, spec=builtin("wbc32"), wrists=wrists)

    return corrupt


def placeholder(one, rng):
    wrists = one.wrists.copy()
    wrists[: int(rng.integers(1, 10))] = [0, 0, 0, 1, 0, 0, 0] * 2
    return replace(one, wrists=wrists)


def columns_rolled(one, rng):
    return replace(one, q=np.roll(one.q, int(rng.choice([-1, 1])), axis=1))


def rows_rolled(one, rng):
    return replace(one, q=np.roll(one.q, int(rng.choice([-1, 1])), axis=0))


def doubled(one, rng):
    n = len(one.q) // 2
    return replace(
        one, q=np.repeat(one.q[::2], 2, axis=0)[: 2 * n], state=np.repeat(one.state[::2], 2, axis=0)[: 2 * n]
    )


def differences(one, rng):
    return replace(one, q=np.diff(one.q, axis=0, prepend=one.q[:1]))


def velocities(one, rng):
    return replace(one, q=30.0 * np.diff(one.q, axis=0, prepend=one.q[:1]))


def copied(one, rng):
    return replace(one, state=one.q.copy() if rng.uniform() < 0.5 else np.vstack([one.q[:1], one.q[:-1]]))


def state_offset(one, rng):
    state = one.state.copy()
    state[:, int(rng.integers(state.shape[1]))] += rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.5)
    return replace(one, state=state)


def constant(one, rng):
    i = int(rng.integers(len(one.names)))
    index, q = ROBOT.index(one.names[i]), one.q.copy()
    q[:, i] = ROBOT.position_max[index] + rng.uniform(0.1, 2.0)
    return replace(one, q=q)


CORRUPTIONS = {
    "Isaac's order (29 body joints)": (isaac, ("isaac_order",)),
    "left and right exchanged": (left_right, ("left_right",)),
    "fingers in Pinocchio's order": (fingers_by_name, ("finger_order", "mirrored_fingers")),
    "all in Pinocchio's order": (pinocchio, ("pinocchio_order",)),
    "mirrored finger signs": (mirrored_fingers, ("mirrored_fingers",)),
    "degrees": (degrees, ("degrees",)),
    "degrees in the arms alone": (half_degrees, ("degrees",)),
    "root in millimetres": (millimetres, ("millimetres",)),
    "root w first": (w_first, ("w_first",)),
    "root upside down": (upside_down, ("root_tilt", "w_first")),
    "wrist quaternion x first for w": (wrist_quaternion, ("quaternion_order",)),
    "rot6d interleaved": (rot6d("interleaved"), ("rot6d_layout",)),
    "a tool 5 cm off, with joints beside": (tool_off, ("tool_offset",)),
    "no command yet": (placeholder, ("placeholder",)),
    "columns rolled by one": (columns_rolled, ("columns_rolled", "columns_rolled_back")),
    "rows rolled by one": (rows_rolled, ("rows_rolled", "rows_rolled_back")),
    "doubled rows": (doubled, ("doubled_rows",)),
    "differences": (differences, ("differences",)),
    "velocities": (velocities, ("differences",)),
    "state is action, now or a row late": (copied, ("state_is_action",)),
    "a joint's state a constant off": (state_offset, ("state_offset",)),
    "a constant column out of range": (constant, ("constant_out_of_range",)),
}
"""What goes wrong: how, and the hypotheses that say so."""
