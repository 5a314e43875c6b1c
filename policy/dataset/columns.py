"""Columns of a dataset that are copied, and those whose statistics are computed anew."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from policy.dataset.format import Dataset, Episode, vectors

if TYPE_CHECKING:
    import pyarrow

_NUMBERS = ("float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "bool")


def stored_columns(dataset: Dataset) -> list[str]:
    """Features that are columns of the data files: all but videos."""
    return [key for key, feature in dataset.features.items() if feature["dtype"] != "video"]


def numeric_columns(
    rows: pyarrow.Table, features: Mapping[str, Mapping[str, Any]], episode: Episode
) -> Iterator[tuple[str, np.ndarray]]:
    """Columns of numbers by name, shape (n,) or (n, D); those that are no feature are left out."""
    for key in rows.column_names:
        feature = features.get(key)
        if feature is None or feature["dtype"] not in _NUMBERS:
            continue
        column, shape = rows.column(key), tuple(feature["shape"])
        if shape == (1,) and (values := np.asarray(column)).dtype.kind in "fiub":
            yield key, values.astype(float)
        elif len(shape) == 1:
            yield key, vectors(column, shape[0], key, episode)
