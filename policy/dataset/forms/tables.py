"""Parquet files as tables and rows, within bounds of memory that hold before anything is unpacked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from policy.errors import DatasetError, printable
from policy.reading import ReadingError, require_file

if TYPE_CHECKING:
    import pyarrow
    import pyarrow.parquet

TABLE_MAX = 2**30
"""Largest table that is read at once, and its largest file [bytes]; LeRobot begins a new file at 100 MB."""
ROWS_MAX = 5_000_000
"""Most rows of a data file: 46 hours at 30 Hz."""
NO_PYARROW = "datasets are read with pyarrow, which is not installed: pip install 'g1-wholebody[audit]'"
OBJECT = 64
"""What a value takes as an object of Python, beside the letters of a text [bytes]; measured: a short text and its place
in a list take 58, a number 32."""


def read_parquet(file: Path, columns: list[str] | None = None) -> pyarrow.Table:
    """A parquet file as a table.

    Raises:
        DatasetError: If it is missing or damaged, has two columns of one name, would unpack to more than `TABLE_MAX`,
            or pyarrow is not installed.
    """
    with _as_dataset_faults(file):
        stored = _opened(file)
        _require_small(stored, columns, file, TABLE_MAX)
        return stored.read(columns)


def read_rows(
    files: Iterable[Path], wanted: Callable[[str], bool] = lambda _: True, most: int = TABLE_MAX
) -> list[dict[str, Any]]:
    """Rows of parquet files, one file after the other, as objects of Python.

    Args:
        files: The files.
        wanted: Whether a column of a name is read.
        most: What all of them may take, counted before anything is unpacked [bytes].

    Raises:
        DatasetError: As `read_parquet`.
    """
    rows: list[dict[str, Any]] = []
    for file in files:
        with _as_dataset_faults(file):
            stored = _opened(file)
            columns = list(filter(wanted, stored.schema_arrow.names))
            most -= _require_small(stored, columns, file, most, OBJECT)
            rows += stored.read(columns).to_pylist()
    return rows


@contextmanager
def _as_dataset_faults(file: Path) -> Iterator[None]:
    """Raise faults of a file as faults of its dataset."""
    try:
        import pyarrow
    except ImportError as error:
        raise DatasetError(NO_PYARROW) from error
    try:
        yield
    except (FileNotFoundError, NotADirectoryError) as error:
        raise DatasetError(f"{file} does not exist; download all of the dataset, data and meta") from error
    except (OSError, ReadingError, pyarrow.ArrowException) as error:
        raise DatasetError(
            f"{file} cannot be read ({error}); a recording that was not ended with finalize() has no readable files, "
            "a git clone without 'git lfs pull' has only pointers"
        ) from error


def _opened(file: Path) -> pyarrow.parquet.ParquetFile:
    import pyarrow.parquet

    require_file(file, TABLE_MAX)
    stored = pyarrow.parquet.ParquetFile(file, memory_map=True)
    names = stored.schema_arrow.names
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DatasetError(f"{file} has two columns '{printable(twice, 80)}'; write it again with one of them")
    return stored


def _require_small(
    stored: pyarrow.parquet.ParquetFile, columns: list[str] | None, file: Path, most: int, each: int = 8
) -> int:
    """Bytes to which columns unpack, by the file's description, at so many bytes a value.

    Raises:
        DatasetError: If they are more than ``most``.
    """
    about, size, texts = stored.metadata, 0, set[str]()
    if about.num_rows > ROWS_MAX:
        raise DatasetError(f"{file} has {about.num_rows} rows; at most {ROWS_MAX} are read")
    for group in range(about.num_row_groups):
        for i in range(about.num_columns):
            column = about.row_group(group).column(i)
            path = column.path_in_schema
            if columns is not None and not any(path == name or path.startswith(f"{name}.") for name in columns):
                continue
            # A dictionary of values repeated for ever is small in the file; numbers have 8 bytes at most.
            size += max(column.total_uncompressed_size, each * column.num_values)
            repeats = any("DICTIONARY" in encoding for encoding in column.encodings)
            if column.physical_type == "BYTE_ARRAY" and repeats:
                texts.add(path)
    size += sum(_letters(file, path) for path in sorted(texts) if size <= most)
    if size > most:
        raise DatasetError(f"{file} would unpack to {size} bytes; at most {most} are read at once")
    return size


def _letters(file: Path, path: str) -> int:
    """Bytes of all texts of a column that repeats some by number, found without repeating them."""
    import pyarrow.parquet

    stored = pyarrow.parquet.ParquetFile(file, memory_map=True, read_dictionary=[path])
    groups = (stored.read_row_group(group, columns=[path]) for group in range(stored.num_row_groups))
    return sum(_size(chunk) for table in groups for chunk in table.column(0).chunks)


def _size(array: pyarrow.Array) -> int:
    """Bytes of the texts in an array that are told by number."""
    import pyarrow
    import pyarrow.compute as pc

    kind = array.type
    if pyarrow.types.is_dictionary(kind):
        lengths = pc.binary_length(array.dictionary)
        return pc.sum(lengths.take(array.indices.drop_null())).as_py() or 0
    if pyarrow.types.is_struct(kind):
        return sum(_size(array.field(i)) for i in range(kind.num_fields))
    return _size(array.flatten()) if hasattr(kind, "value_type") else 0
