"""Datasets that are damaged, incomplete or of something else: refused before anything is written, with the cure."""

import json
import re
import shutil

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from policy.action_spec.builtin import builtin
from policy.dataset.conversion import DatasetSettings, convert_dataset
from policy.dataset.format import inside
from policy.dataset.forms.tables import ROWS_MAX, read_parquet
from policy.dataset.open import open_dataset
from policy.dataset.writer import DatasetWriter
from policy.errors import DatasetError, SpecError
from policy.recorded.dataset_replay import open_episode
from tests.support.dataset_cases import IMAGE, VIDEO, write_v21, write_v30

DATA = "data/chunk-000/file-000.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"


@pytest.fixture(scope="module")
def v30(tmp_path_factory):
    return write_v30(tmp_path_factory.mktemp("v30") / "joints")


@pytest.fixture
def source(tmp_path, v30):
    return shutil.copytree(v30, tmp_path / "joints")


@pytest.fixture
def old(tmp_path, v30):
    return write_v21(tmp_path / "old", v30)


def refused(source, says, **settings):
    """Convert, see all of it refused and nothing left behind, or a broken episode left out and named."""
    target = source.with_name("wrists")
    before = sorted(source.parent.iterdir())
    result = None
    try:
        result = convert_dataset(source, target, DatasetSettings(check=False, **settings))
    except DatasetError as error:
        caught = error
    if result is None:
        assert sorted(source.parent.iterdir()) == before
        assert re.search(says, str(caught)), caught
        return caught
    assert result.left_out
    assert {index for index, error in result.left_out.items() if not re.search(says, str(error))} == set()
    assert not set(result.left_out) & {episode.index for episode in result.source.episodes}
    assert len(open_dataset(target).episodes) == len(result.source.episodes)
    shutil.rmtree(target)
    return next(iter(result.left_out.values()))


def edit_json(file, change):
    data = json.loads(file.read_text())
    change(data)
    file.write_text(json.dumps(data))


def edit_info(source, change):
    edit_json(source / "meta" / "info.json", change)


def edit_table(file, change):
    pyarrow.parquet.write_table(change(pyarrow.parquet.read_table(file)), file)


def edit_numbers(source, key, change):
    def changed(table):
        values = np.stack(table.column(key).to_numpy()).copy()
        change(values)
        flat = pyarrow.array(values.ravel())
        column = pyarrow.FixedSizeListArray.from_arrays(flat, values.shape[1])
        return table.set_column(table.column_names.index(key), key, column)

    edit_table(source / DATA, changed)


def put(row, column, value):
    def change(values):
        values[row, column] = value

    return change


def rename(source, change):
    """Other names of the columns, in the same order of numbers."""

    def changed(info):
        for key in ("action", "observation.state"):
            info["features"][key]["names"] = change(list(info["features"][key]["names"][0]))

    edit_info(source, changed)


def test_a_folder_that_is_no_dataset_is_named(tmp_path):
    with pytest.raises(DatasetError, match="the one with meta and data in it"):
        open_dataset(tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[1]", "{}"])
def test_info_that_says_nothing_is_refused(source, text):
    (source / "meta" / "info.json").write_text(text)
    refused(source, r"cannot be read|an object is expected|codebase_version None")


@pytest.mark.parametrize("version", ["v1.6", "v4.0", None, 3])
def test_other_formats_are_refused_with_those_that_are_read(source, version):
    edit_info(source, lambda info: info.update(codebase_version=version))
    refused(source, r"v3\.0, v2\.1, v2\.0 are read")


@pytest.mark.parametrize("fps", [0, -30, None, "30", float("nan")])
def test_a_rate_that_is_none_is_refused(source, fps):
    edit_info(source, lambda info: info.update(fps=fps))
    refused(source, "a positive rate in Hz")


@pytest.mark.parametrize("change", [{"chunks_size": 0}, {"features": {"action": {"dtype": "float32", "shape": 28}}}])
def test_info_with_impossible_numbers_is_refused(source, change):
    edit_info(source, lambda info: info.update(change))
    refused(source, r"has chunks_size 0|no list of whole numbers")


@pytest.mark.parametrize(
    "line",
    [
        {"episode_index": "0", "length": 12, "tasks": []},
        {"episode_index": 0, "length": 0, "tasks": []},
        {"episode_index": 5, "length": 12, "tasks": []},
    ],
)
def test_an_old_list_of_episodes_with_impossible_numbers_is_refused(old, line):
    (old / "meta" / "episodes.jsonl").write_text(json.dumps(line) + "\n")
    refused(old, r"whole numbers are expected|once each")


def test_a_missing_place_of_an_episode_is_refused(source):
    edit_table(source / EPISODES, lambda table: table.drop_columns(["data/file_index"]))
    refused(source, "cannot be filled in")


def test_a_missing_action_is_named_with_what_there_is(source):
    edit_info(source, lambda info: info["features"].update(acton=info["features"].pop("action")))
    error = refused(source, "has no feature 'action'; did you mean 'acton'")
    assert error.feature == "action"


def test_a_missing_column_of_the_data_is_named_with_what_there_is(source):
    edit_table(source / DATA, lambda table: table.drop_columns(["observation.state"]))
    refused(source, "has no column 'observation.state'; it has .*action")


def test_names_of_no_joints_are_refused(source):
    rename(source, lambda names: [[f"motor_{i}" for i in range(28)]])
    refused(source, "say --assume-spec joint28 or a JSON file of your own .layouts with 28 numbers: joint28")


def test_missing_names_need_a_user_who_vouches(source, tmp_path):
    rename(source, lambda names: None)
    refused(source, "say --assume-spec joint28")
    settings = DatasetSettings(assume=builtin("joint28"), check=False)
    result = convert_dataset(source, tmp_path / "vouched", settings)
    said = json.loads((result.folder / "meta" / "conversion.json").read_text())
    assert said["features"]["action"]["layout_assumed"] is True


def test_fingers_in_another_order_than_vouched_for_are_refused(source):
    def exchanged(names):
        names[24:26], names[26:28] = names[26:28], names[24:26]
        return [names]

    rename(source, exchanged)
    refused(source, "the order is another one", assume=builtin("joint28"))


def test_columns_under_each_others_names_are_recognised_by_their_limits(source):
    edit_numbers(source, "action", put(slice(None), 3, -1.5))
    refused(source, "another order than their names say")


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_named_by_episode_and_frame(source, tmp_path, bad):
    edit_numbers(source, "observation.state", put(14, 5, bad))
    error = refused(source, r"episode 1, frame 2: 'observation.state' column 5 \(kLeftWristPitch\) is (nan|inf)")
    assert error.frame == 2
    # The message says to leave the episode out: that works.
    convert_dataset(source, tmp_path / "rest", DatasetSettings(episodes=(0, 2), check=False))


def test_time_that_goes_back_is_named_by_episode_and_frame(source):
    def changed(table):
        times = table.column("timestamp").to_numpy().copy()
        times[15] = times[14]
        return table.set_column(table.column_names.index("timestamp"), "timestamp", pyarrow.array(times))

    edit_table(source / DATA, changed)
    refused(source, "episode 1: the timestamp .* of frame 3 does not come after")


def test_missing_statistics_of_a_camera_need_a_decision(source, tmp_path):
    edit_json(source / "meta" / "stats.json", lambda stats: stats.pop(VIDEO))
    refused(source, f"no statistics of {VIDEO}.*recompute_stats.*--without-camera-stats")
    settings = DatasetSettings(without_camera_stats=True, check=False)
    result = convert_dataset(source, tmp_path / "without", settings)
    assert any(note.startswith(f"no statistics of {VIDEO}") for note in result.notes)


def test_missing_statistics_of_numbers_are_computed(source, tmp_path):
    edit_json(source / "meta" / "stats.json", lambda stats: [stats.pop(key) for key in ("action", "observation.state")])
    result = convert_dataset(source, tmp_path / "wrists", DatasetSettings(check=False))
    assert len(json.loads((result.folder / "meta" / "stats.json").read_text())["action"]["q01"]) == 32


def test_old_datasets_without_statistics_need_a_decision_too(old):
    (old / "meta" / "episodes_stats.jsonl").unlink()
    refused(old, "--without-camera-stats")


def test_a_recording_that_was_not_finalised_is_recognised(source):
    (source / DATA).write_bytes((source / DATA).read_bytes()[:-40])
    refused(source, r"finalize\(\)")


def test_a_pointer_of_git_lfs_is_recognised(source):
    (source / DATA).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    refused(source, "git lfs pull")


@pytest.mark.parametrize("name", [DATA, EPISODES, "meta/tasks.parquet"])
def test_a_missing_file_is_named(source, name):
    (source / name).unlink()
    refused(source, "download all of the dataset")


@pytest.mark.parametrize("name", ["episodes", "tasks"])
def test_a_missing_file_of_an_old_dataset_is_named(old, name):
    (old / "meta" / f"{name}.jsonl").unlink()
    refused(old, f"{name}.jsonl does not exist")


def test_a_line_of_an_old_dataset_without_its_keys_is_named(old):
    (old / "meta" / "tasks.jsonl").write_text('{"task": "pour"}\n')
    refused(old, "a line without task_index")


def test_a_missing_video_is_named(source):
    (source / f"videos/{VIDEO}/chunk-000/file-001.mp4").unlink()
    refused(source, "file-001.mp4 does not exist; download all of the dataset's videos")


def test_b6_a_video_that_is_cut_off_is_refused(source):
    """It was copied in silence, and training failed days later."""
    file = source / f"videos/{VIDEO}/chunk-000/file-001.mp4"
    content = file.read_bytes()
    for cut in (0, 7, 20, len(content) // 2, len(content) - 1):
        file.write_bytes(content[:cut])
        refused(source, "file-001.mp4 is (cut off|no whole MP4)")
    file.write_bytes(bytes(2000))
    refused(source, "file-001.mp4 is (cut off|no whole MP4)")


def test_b6_a_video_that_ends_before_its_episode_is_refused(source):
    name = f"videos/{VIDEO}/to_timestamp"

    def longer(table):
        ends = pyarrow.array([end + 1.0 for end in table.column(name).to_pylist()])
        return table.set_column(table.column_names.index(name), name, ends)

    edit_table(source / EPISODES, longer)
    refused(source, r"mp4 lasts 0\.\d+ s, its episodes go on until 1\.\d+ s")


@pytest.mark.parametrize("fps", [15, 60, 29])
def test_b6_a_rate_that_is_not_that_of_the_timestamps_is_refused(source, fps):
    file = source / "meta" / "info.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"fps": fps}))
    refused(source, f"its timestamps pass at 30 Hz, meta/info.json says fps {fps}")
    with pytest.raises(DatasetError, match="its timestamps pass at 30 Hz"):
        open_episode(source, 0)


@pytest.mark.parametrize(
    "path",
    ["{chunk_index:9999999999d}", "{chunk_index.__class__}", "{chunk_index!r}", "{}", "{0}", "a" * 400, "\x00.parquet"],
)
def test_paths_that_would_fill_memory_or_reach_into_objects_are_refused(path, tmp_path):
    with pytest.raises(DatasetError, match="path"):
        inside(tmp_path, path, chunk_index=1, file_index=2)


def test_tables_are_refused_by_what_they_would_unpack_to(tmp_path):
    """Half a billion equal numbers take two kilobytes."""
    file = tmp_path / "data.parquet"
    schema = pyarrow.schema([("action", pyarrow.int64())])
    with pyarrow.parquet.ParquetWriter(file, schema) as writer:
        writer.write_table(pyarrow.table({"action": np.zeros(ROWS_MAX + 1, dtype=np.int64)}))
    assert file.stat().st_size < 100_000
    with pytest.raises(DatasetError, match=f"has {ROWS_MAX + 1} rows; at most {ROWS_MAX} are read"):
        read_parquet(file)


def test_rows_of_another_recording_are_recognised(source):
    edit_table(source / DATA, lambda table: table.slice(3))
    refused(source, "are of different recordings")


def test_rows_of_another_length_than_said_are_recognised(source):
    def changed(table):
        short = pyarrow.array([[0.0] * 27] * len(table), pyarrow.list_(pyarrow.float32()))
        return table.set_column(table.column_names.index("action"), "action", short)

    edit_table(source / DATA, changed)
    refused(source, "no table of 28 numbers a frame")


def test_images_outside_of_the_data_are_refused(source):
    def changed(table):
        empty = pyarrow.array([{"bytes": None, "path": "a.png"}] * len(table), table.schema.field(IMAGE).type)
        return table.set_column(table.column_names.index(IMAGE), table.schema.field(IMAGE), empty)

    edit_table(source / DATA, changed)
    refused(source, "embed them first")


@pytest.mark.parametrize(
    "template", ["../../{chunk_index}{file_index}", "/etc/{chunk_index}", "{nothing}", "{chunk_index"]
)
def test_paths_that_leave_the_dataset_are_refused(source, template):
    edit_info(source, lambda info: info.update(data_path=template))
    refused(source, r"leaves the dataset's folder|cannot be filled in")


def test_a_feature_that_is_a_path_is_refused(source):
    edit_info(source, lambda info: info["features"].update({"../../x": info["features"][VIDEO]}))
    refused(source, "is no name but a path")


def test_a_template_cannot_look_into_objects(tmp_path):
    with pytest.raises(DatasetError, match="cannot be filled in"):
        inside(tmp_path, "{chunk_index.__class__.__mro__[9]}", chunk_index=1)


@pytest.mark.parametrize(("episodes", "says"), [((3,), "no episode 3"), ((0, 0), "named once"), ((), "one at least")])
def test_episodes_that_are_not_there_are_refused(source, episodes, says):
    refused(source, says, episodes=episodes)


@pytest.mark.parametrize("least", [-1.0, np.nan, np.inf])
def test_a_least_range_that_is_none_is_refused(source, least):
    refused(source, "must be at least 0", least_range=least)


def test_an_existing_target_is_not_touched(source, tmp_path):
    (tmp_path / "wrists").mkdir()
    refused(source, "exists already")


def test_a_target_in_no_folder_is_refused(source, tmp_path):
    with pytest.raises(DatasetError, match="there is no folder"):
        convert_dataset(source, tmp_path / "a" / "b")


def test_an_unknown_layout_is_refused_with_the_nearest(source, tmp_path):
    with pytest.raises(SpecError, match="did you mean 'wbc32'"):
        convert_dataset(source, tmp_path / "wrists", DatasetSettings(to="wbc3"))


def test_what_was_begun_is_removed_after_an_error(tmp_path):
    with pytest.raises(KeyError), DatasetWriter(tmp_path / "out", {}, ()):
        raise KeyError("anything")
    assert list(tmp_path.iterdir()) == []


def twice(table, name):
    return pyarrow.Table.from_arrays([*table.columns, table.column(name)], [*table.column_names, name])


@pytest.mark.parametrize("file", [DATA, EPISODES])
def test_a_column_that_is_there_twice_is_refused(source, file):
    """The reader ended with a KeyError."""
    edit_table(source / file, lambda table: twice(table, "episode_index"))
    refused(source, "has two columns 'episode_index'")


def replaced(key, column):
    return lambda table: table.set_column(table.column_names.index(key), key, column(table))


@pytest.mark.parametrize("key", ["action", "episode_index", "timestamp", "frame_index", "observation.velocity"])
def test_a_column_of_objects_in_the_place_of_numbers_is_refused(source, key):
    edit_table(source / DATA, replaced(key, lambda table: pyarrow.array([{"x": 1.0}] * len(table))))
    refused(source, "frames of episode|numbers a frame|no numbers")


@pytest.mark.parametrize("odd", [1.5, "a.png", [1, 2], {"path": "a.png"}])
def test_an_image_column_of_something_else_is_refused(source, odd):
    edit_table(source / DATA, replaced(IMAGE, lambda table: pyarrow.array([odd] * len(table))))
    assert refused(source, "images are expected").feature == IMAGE


@pytest.mark.parametrize("noted", [b"[1]", b"{", b'{"info": 3}', b'{"info": {"features": []}}', b"\xff", b"null"])
def test_notes_of_the_schema_that_are_none_are_left_out(source, tmp_path, noted):
    edit_table(source / DATA, lambda table: table.replace_schema_metadata({b"huggingface": noted}))
    convert_dataset(source, tmp_path / "wrists", DatasetSettings(check=False))
    assert len(open_dataset(tmp_path / "wrists").episodes) == 3


def test_a_small_list_of_episodes_does_not_become_gigabytes(source):
    """0.9 MB took 4.8 GiB: the same text over and over, once in the file and an object each in memory."""

    def changed(table):
        texts = pyarrow.array(["pour"]).take(pyarrow.array(np.zeros(20_000_000, dtype=np.int32)))
        tasks = pyarrow.ListArray.from_arrays([0, len(texts) - 2, len(texts) - 1, len(texts)], texts)
        return table.set_column(table.column_names.index("tasks"), "tasks", tasks)

    edit_table(source / EPISODES, changed)
    assert (source / EPISODES).stat().st_size < 2_000_000
    refused(source, "would unpack to [0-9]+ bytes; at most 1073741824 are read")


@pytest.mark.parametrize("rows", [1, 300])
def test_a_task_of_megabytes_is_refused_whether_it_is_there_once_or_often(source, rows):
    """500 MB of text were read, and told by every command."""
    size = 100_000_000 // rows
    table = pyarrow.table({"task_index": list(range(rows)), "task": ["a" * size] * rows})
    pyarrow.parquet.write_table(table, source / "meta/tasks.parquet")
    assert (source / "meta/tasks.parquet").stat().st_size < 10_000_000
    refused(source, "at most 67108864 are read")


@pytest.mark.parametrize("name", ["tasks.parquet", "info.json", "stats.json", "episodes/chunk-000/file-000.parquet"])
def test_what_a_dataset_says_of_itself_is_no_link_to_elsewhere(source, tmp_path, name):
    elsewhere = tmp_path.parent / f"{tmp_path.name}_elsewhere"
    shutil.move(source / "meta" / name, elsewhere)
    (source / "meta" / name).symlink_to(elsewhere)
    refused(source, "is a link that leaves the dataset's folder")


def test_a_link_of_an_old_dataset_to_elsewhere_is_refused(old, tmp_path):
    shutil.move(old / "meta/tasks.jsonl", tmp_path / "elsewhere")
    (old / "meta/tasks.jsonl").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(DatasetError, match="is a link that leaves"):
        open_dataset(old)
