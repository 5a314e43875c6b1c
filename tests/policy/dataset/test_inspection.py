"""Inputs after public bug reports: what each was, and the sentence that says so.

Strategy: good chunks, motions and datasets are made here, opened without a note, and changed by one thing as the source
in the comment of each case had it. Numbers are made here; the kinds are the sources'.
"""

import re

import numpy as np
import pytest

from models import g1
from policy import Anchor, builtin, write_chunk_file
from policy.errors import PolicyError
from policy.geometry.rotations import matrix_to_rot6d, rotvec_to_matrix
from policy.recorded.chunk_file import ChunkFile
from policy.recorded.dataset_replay import open_episode
from policy.recorded.example import example_file
from policy.recorded.motion_csv import Motion, read_motion_csv, write_motion_csv
from policy.recorded.replay import open_recording
from policy.suspicion.orders import ISAAC
from tests.support.written_datasets import write_dataset

ANCHOR, ROBOT = Anchor.nominal(), g1()
ARMS = [name for part in ("left_arm", "right_arm") for name in (ROBOT.body_joints[i] for i in ROBOT.limbs[part])]
FINGERS = [name for side in ("left", "right") for name in ROBOT.tool(side).finger_joints]
NAMES = [*ARMS, *FINGERS]
STANCE = dict(zip(ROBOT.body_joints, ANCHOR.q_body, strict=True))


def said(name, tmp_path, change, **more):
    """Notes, or the refusal, of an example chunk in a layout that was changed."""
    file = example_file(builtin(name))
    actions = file.actions.copy()
    found = change(actions)
    write_chunk_file(tmp_path / "x.npz", ChunkFile(file.spec, actions if found is None else found, file.fps, **more))
    try:
        return " | ".join(open_recording(tmp_path / "x.npz").episode.notes)
    except PolicyError as error:
        return f"refused: {error}"


def put(where, value):
    def change(actions):
        actions[where] = value

    return change


def six(layout, angle):
    R = rotvec_to_matrix(np.array([0.0, 0.0, angle]))
    return matrix_to_rot6d(R, layout)


def placeholder(actions):
    actions[:5, :18] = [0, 0, 0, 1, 0, 0, 0, 1, 0] * 2


def quaternions(actions):
    actions[:, 3:7] = [0.0, 0.0, 0.0, 1.0]


ROWS = np.arange(50)
CASES = {
    "arms past their limits (genie_sim#51)": (
        "joint28",
        put((ROWS, 10), 2.9),
        r"refused.*right_elbow_joint.*out of its range",
    ),
    "an elbow held past its limit": ("joint28", put((ROWS, 3), 2.6), r"refused.*left_elbow.*2\.09"),
    "a joint a little past its limit": (
        "joint28",
        put((ROWS[:9], 3), 2.2),
        r"^left_elbow_joint is asked up to 0\.1\d* rad beyond its limit",
    ),
    "a finger stuck at 60 rad (xr_teleoperate#213)": ("joint28", put((ROWS, 20), 60.0), r"refused.*index_1"),
    "columns rolled (unitree_lerobot#10)": (
        "joint28",
        lambda a: np.roll(a, -1, axis=1),
        r"refused.*rolled|refused.*range",
    ),
    "degrees (so101-nexus PR 102)": ("joint28", np.rad2deg, r"refused.*look like degrees.*--read-as degrees"),
    "a waist that is only a hint": ("unifolm23", put((slice(None), 21), 1.2), r"waist_roll_joint.*not followed.*range"),
    "rot6d interleaved (X-VLA#71)": (
        "wbc32",
        put((ROWS, slice(3, 9)), six("interleaved", 0.35)),
        r"refused.*rot6d.*interleaved",
    ),
    "rot6d interleaved by 45 deg (SONIC)": (
        "wbc32",
        put((ROWS, slice(3, 9)), six("interleaved", 0.79)),
        r"refused.*interleaved",
    ),
    "rot6d that is none": (
        "wbc32",
        put((ROWS, slice(3, 9)), [1, 0, 0, 0.9, 0.4, 0]),
        r"refused.*24 deg apart.*no layout fits",
    ),
    "no command yet (GR00T-WBC)": ("wbc32", placeholder, r"refused.*5 rows, from row 0 on: no command yet"),
    "quaternions as joints (Isaac-GR00T#678)": ("joint16", quaternions, r"columns 3 to 6 have norm 1"),
    "a share where an angle is meant (positronic#456)": (
        "unifolm23",
        put((slice(None), slice(18, 20)), np.linspace(0, 1, 25)[:, None]),
        r"right_grasp is 0 to 1, 19% of its range",
    ),
    "-1 to 1 where 0 to 1 is (LIBERO)": (
        "wbc27",
        put((ROWS[:25], 18), -1.0),
        r"refused.*left_grasp is -1 to .*closing",
    ),
    "a finger that jumps and is back (lerobot PR 4223)": (
        "joint28",
        put((21, 17), -1.5),
        r"left_hand: fingers jump by 1\.2 rad at row 21 and back, which at .* is not followed",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_what_was_reported_is_said(case, tmp_path):
    name, change, sentence = CASES[case]
    assert said(name, tmp_path, lambda actions: None) == ""
    answer = said(name, tmp_path, change)
    assert re.search(sentence, answer, re.S), answer


def test_a_first_step_that_is_not_where_the_robot_was_measured_is_said(tmp_path):
    """Differences sent as positions (Isaac-GR00T#467)."""
    measured = {name: STANCE[name] + 0.5 for name in ARMS}
    answer = said("joint28", tmp_path, lambda actions: None, q0_joints=measured)
    assert "row 0 is up to 0.50 rad from the measured pose in q0_joints" in answer


def motion(tmp_path, change):
    """What is said of a motion of 4 s whose root and joints were changed."""
    steps = np.linspace(0.0, 4.0, 240)[:, None]
    q = ANCHOR.q_body + 0.15 * np.sin(steps + np.arange(29))
    T = np.tile(ANCHOR.T_world_base, (240, 1, 1))
    write_motion_csv(tmp_path / "m.csv", Motion(60.0, T, q))
    table = np.loadtxt(tmp_path / "m.csv", delimiter=",")
    change(table)
    np.savetxt(tmp_path / "m.csv", table, fmt="%.6f", delimiter=",")
    try:
        return " | ".join(open_recording(tmp_path / "m.csv", fps=60.0).episode.notes)
    except PolicyError as error:
        return f"refused: {error}"


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda t: None, ""),
        (
            lambda t: t.__setitem__((slice(None), slice(7, 36)), t[:, 7:][:, list(ISAAC)]),
            "breadth-first order, Isaac's",
        ),
        (lambda t: t.__setitem__((slice(None), slice(3, 7)), [1, 0, 0, 0]), "upside down.*with w first"),
        (lambda t: t.__imul__(np.where(np.arange(36) < 3, 1000.0, 1.0)), "in millimetres it would be 0.779 m"),
        (lambda t: t.__setitem__((slice(None), 10), -2.0), "refused.*left_knee"),
        (lambda t: t.__setitem__((slice(None), 20), 1.5), "refused.*waist_roll.*0.52"),
        (lambda t: t.__setitem__((slice(120, None), slice(3, 7)), -t[120:, 3:7]), ""),
    ],
)
def test_roots_legs_and_waists_of_motions_are_looked_at(tmp_path, change, sentence):
    answer = motion(tmp_path, change)
    assert bool(answer) == bool(sentence)
    assert re.search(sentence, answer, re.S), answer


def test_a_motion_is_read_as_a_user_says(tmp_path):
    def spoil(table):
        table[:, 3:7] = table[:, [6, 3, 4, 5]]
        table[:, :3] *= 1000.0
        table[:, 7:] = table[:, 7:][:, list(ISAAC)]

    motion(tmp_path, lambda table: None)
    right = read_motion_csv(tmp_path / "m.csv")
    motion(tmp_path, spoil)
    said = ["w_first", "millimetres", "isaac_order"]
    again = read_motion_csv(tmp_path / "m.csv", read_as=said)
    np.testing.assert_allclose(again.q_body, right.q_body)
    np.testing.assert_allclose(again.T_world_base, right.T_world_base, atol=1e-5)
    assert open_recording(tmp_path / "m.csv", fps=60.0, read_as=said).episode.notes == ()


def dataset(tmp_path, change):
    """Notes of an episode whose states lag and shake, changed."""
    steps = np.linspace(0.0, 3.0, 90)[:, None]
    action = np.array([STANCE[name] for name in ARMS]) + 0.2 * np.sin(steps + np.arange(14))
    action = np.hstack([action, np.tile(ROBOT.hand_neutral, (90, 1)) * (1.0 + 0.3 * np.sin(steps))])
    state = np.vstack([action[:1], action[:-1]]) + np.random.default_rng(0).normal(0.0, 2e-3, action.shape)
    action, state = change(action, state)
    episode = {"action": action, "observation.state": state}
    folder = write_dataset(tmp_path / "set", [episode], dict.fromkeys(episode, NAMES))
    return " | ".join(open_episode(folder, 0).episode.notes)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda a, s: (a, s), ""),
        (lambda a, s: (a, a), "the state is the action, to the last digit, in every row"),
        (lambda a, s: (a, np.vstack([a[:1], a[:-1]])), "the state is the action of the row before"),
        (lambda a, s: (a, np.vstack([a[:1]] * 3 + [a[:-3]])), "the state is the action of 3 rows before"),
        (lambda a, s: (a, np.tile(s[:1], (len(s), 1))), "the state is the same in every row, and the action moves"),
        (lambda a, s: (np.repeat(a[::2], 2, axis=0), np.repeat(s[::2], 2, axis=0)), "every second row is the same"),
        (lambda a, s: (a, s + np.where(np.arange(28) == 3, 0.3, 0.0)), "most of all left_elbow_joint by 0."),
    ],
)
def test_states_and_rows_of_datasets_are_looked_at(tmp_path, change, sentence):
    answer = dataset(tmp_path, change)
    assert bool(answer) == bool(sentence)
    assert sentence in answer
