"""Each episode of a dataset stands alone: a broken one is named and left out of a conversion, the others are in it.

Strategy: sets of three episodes written with pyarrow alone, one of them broken in a way each; what numbers are instead
of what they are called is noted, refused, or undone as the user says.
"""

import json

import numpy as np
import pytest

from policy.dataset.conversion import DatasetSettings, convert_dataset
from policy.dataset.open import open_dataset
from policy.errors import DatasetError
from policy.suspicion.corrections import ReadAsError
from tests.support.commands import wholebody
from tests.support.other_forms import JOINT28, rows
from tests.support.written_datasets import write_dataset

NAMES = {"action": JOINT28, "observation.state": JOINT28}


def episodes(change=lambda action, state: None, which=1, count=3, frames=40):
    found = []
    for number in range(count):
        action = rows(JOINT28, frames)
        state = np.vstack([action[:1], action[:-1]]) + 1e-3 * np.sin(np.arange(frames))[:, None]
        if number == which:
            change(action, state)
        found.append({"action": action, "observation.state": state})
    return found


def put(values, where, number):
    values[where] = number


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda action, state: put(action, (7, 3), np.nan), r"episode 1, frame 7: 'action' column 3 .* is nan"),
        (lambda action, state: put(state, (slice(None), 3), 2.9), "episode 1.*outside the limits"),
        (lambda action, state: put(action, slice(None), np.rad2deg(action)), "episode 1.*look like degrees"),
    ],
)
def test_a_broken_episode_is_named_and_the_others_are_converted(tmp_path, change, said):
    write_dataset(tmp_path / "set", episodes(change), NAMES)
    with pytest.raises(DatasetError, match=said):
        convert_dataset(tmp_path / "set", tmp_path / "alone", DatasetSettings(episodes=(1,)))
    result = convert_dataset(tmp_path / "set", tmp_path / "out", DatasetSettings(check=False))
    assert list(result.left_out) == [1]
    assert [episode.index for episode in result.source.episodes] == [0, 2]
    written = open_dataset(tmp_path / "out")
    assert [episode.index for episode in written.episodes] == [0, 1]
    kept = convert_dataset(tmp_path / "set", tmp_path / "kept", DatasetSettings(check=False, episodes=(0, 2)))
    for a, b in zip(written.numbers("action"), open_dataset(kept.folder).numbers("action"), strict=True):
        np.testing.assert_array_equal(a, b)
    about = json.loads((tmp_path / "out/meta/conversion.json").read_text())
    assert list(about["episodes_left_out"]) == ["1"]
    assert about["source"]["episodes"] == [0, 2]


def test_the_command_names_it_and_ends_with_2(tmp_path):
    write_dataset(tmp_path / "set", episodes(lambda action, state: put(action, (7, 3), np.nan)), NAMES)
    done = wholebody("convert", str(tmp_path / "set"), str(tmp_path / "out"), "--no-check")
    assert done.returncode == 2
    assert "left out episode 1:" in done.stdout
    assert len(open_dataset(tmp_path / "out").episodes) == 2


def test_another_order_is_told_and_undone_as_the_user_says(tmp_path):
    swapped = {"left": "right", "right": "left"}
    parts = [name.partition("_") for name in JOINT28]
    other = [JOINT28.index(f"{swapped[side]}_{rest}") for side, _, rest in parts]
    shoulders = [JOINT28.index(f"{side}_shoulder_roll_joint") for side in ("left", "right")]
    right, wrong = episodes(which=None), []
    for one in right:
        for values in one.values():
            values[:, shoulders] += [0.6, -0.6]  # arms lifted aside, which tells left from right
        wrong.append({key: values[:, other] for key, values in one.items()})
    write_dataset(tmp_path / "right", right, NAMES)
    write_dataset(tmp_path / "wrong", wrong, NAMES)
    with pytest.raises(DatasetError, match=r"outside the limits .*; --read-as left_right reads them so"):
        convert_dataset(tmp_path / "wrong", tmp_path / "refused", DatasetSettings(check=False))
    as_named = DatasetSettings(check=False, read_as=("as_named",))
    noted = convert_dataset(tmp_path / "wrong", tmp_path / "noted", as_named)
    assert any("--read-as left_right reads them so (in 3 of 3 episodes)" in note for note in noted.notes)
    said = DatasetSettings(check=False, read_as=("left_right",))
    convert_dataset(tmp_path / "wrong", tmp_path / "out", said)
    convert_dataset(tmp_path / "right", tmp_path / "expected", DatasetSettings(check=False))
    assert json.loads((tmp_path / "out/meta/conversion.json").read_text())["read_as"] == ["left_right"]
    found, expected = (next(iter(open_dataset(tmp_path / name).numbers("action"))) for name in ("out", "expected"))
    np.testing.assert_array_equal(found, expected)


def test_rows_are_not_made_others_beside_pictures(tmp_path):
    write_dataset(tmp_path / "set", episodes(), NAMES)
    with pytest.raises(ReadAsError, match="makes other rows"):
        convert_dataset(tmp_path / "set", tmp_path / "out", DatasetSettings(read_as=("doubled_rows",)))
    with pytest.raises(ReadAsError, match="unknown; did you mean 'isaac_order'"):
        convert_dataset(tmp_path / "set", tmp_path / "out", DatasetSettings(read_as=("isac_order",)))
