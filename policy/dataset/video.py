"""Whether an MP4 file is whole and long enough, without decoding a frame.

An MP4 file is a row of boxes, each with its size and a name of four letters; ``moov`` has the duration in ``mvhd``.

Source:
    ISO/IEC 14496-12, sections 4.2 (boxes) and 8.2.2 (movie header).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from policy.errors import DatasetError
from policy.reading import ReadingError, require_file

VIDEO_SIZE_MAX = 64 * 2**30
"""Largest video file [bytes]; it is copied, never read as a whole."""
BOXES_MAX = 100_000
"""Most boxes on one level."""
END_SLACK = 0.05
"""What the end of an episode may be beyond the end of its video [s]: a frame at 20 Hz."""


def check_video(file: Path, until: float, feature: str) -> None:
    """Refuse a video that is cut off, or ends before its episodes do.

    Args:
        file: The file.
        until: End of the last episode in it [s].
        feature: Camera, for messages.

    Raises:
        DatasetError: If it is missing, no MP4, cut off, or too short.
    """
    try:
        size = require_file(file, VIDEO_SIZE_MAX)
        with file.open("rb") as stream:
            boxes = dict(_boxes(stream, 0, size))
            if b"ftyp" not in boxes or b"mdat" not in boxes or b"moov" not in boxes:
                raise ReadingError("is no whole MP4 file: it lacks its beginning, its frames or its index")
            seconds = _duration(stream, *boxes[b"moov"])
    except (FileNotFoundError, NotADirectoryError) as error:
        raise DatasetError(f"{file} does not exist; download all of the dataset's videos", feature=feature) from error
    except (OSError, ReadingError) as error:
        raise DatasetError(f"{file} {error}; download it again", feature=feature) from error
    except (struct.error, IndexError) as error:
        raise DatasetError(f"{file} is cut off within a box; download it again", feature=feature) from error
    if not until <= seconds + END_SLACK:
        text = f"{file} lasts {seconds:.3f} s, its episodes go on until {until:.3f} s"
        raise DatasetError(f"{text}: it is cut off, or of another recording; download it again", feature=feature)


def _boxes(stream: BinaryIO, start: int, end: int) -> Iterator[tuple[bytes, tuple[int, int]]]:
    """Names of the boxes from one byte to another, each with where its content begins and ends."""
    for _ in range(BOXES_MAX):
        if start == end:
            return
        stream.seek(start)
        size, name = struct.unpack(">L4s", stream.read(8))
        head = 8
        if size == 1:
            size, head = struct.unpack(">Q", stream.read(8))[0], 16
        size = size or end - start
        if size < head or start + size > end:
            raise ReadingError(f"is cut off: {end - start} bytes are left where {max(size, head)} are due")
        yield name, (start + head, start + size)
        start += size
    raise ReadingError(f"has more than {BOXES_MAX} boxes")


def _duration(stream: BinaryIO, start: int, end: int) -> float:
    """Duration of a movie [s]."""
    boxes = dict(_boxes(stream, start, end))
    if b"mvhd" not in boxes:
        raise ReadingError("is no whole MP4 file: its index has no header")
    stream.seek(boxes[b"mvhd"][0])
    version = stream.read(4)[0]
    layout, skipped = (">LQ", 16) if version == 1 else (">LL", 8)
    stream.seek(skipped, 1)
    scale, duration = struct.unpack(layout, stream.read(struct.calcsize(layout)))
    return duration / max(scale, 1)
