"""Words around a picture: time, status with reason, the numbers of the instant, and what each colour stands for."""

from __future__ import annotations

from textwrap import shorten, wrap
from typing import TYPE_CHECKING

import numpy as np

from wholebody.sim.pictures.scene import STATUS_COLOUR, Colour, Scene, Show

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw

INK, PAPER = (20, 24, 30), (255, 255, 255)
LARGE, SMALL_LETTERS = 18, 13
"""Sizes of the letters [px]."""
BORDER, LINE = 10, 18
"""Distance from the edge, and from one line to the next [px]."""
CAPTION, STATUS_LINES = 96, 2
"""Height of the words above a picture [px], and most lines of its status."""
LETTER = 6.1
"""Width of a small letter on average [px]."""
SWATCH, LEGEND_GAP = 20, 18
"""Room for a colour in the legend, and between two entries [px]."""


def captioned(image: np.ndarray, scene: Scene, why: str = "") -> np.ndarray:
    """Picture with its caption above.

    Args:
        image: Shape (height, width, 3), uint8.
        scene: What it shows.
        why: Why it is shown, if it was chosen.

    Returns:
        Shape (`CAPTION` + height, width, 3).
    """
    width = image.shape[1]
    letters = int((width - 2 * BORDER) / LETTER)
    band, pen = _paper(width, CAPTION)
    status, numbers = scene.words()
    title = f"{scene.time:.2f} s" + (f"   {why}" if why else "")
    size = LARGE if pen.textlength(title, font_size=LARGE) <= width - 2 * BORDER else SMALL_LETTERS
    pen.text((BORDER, 6), shorten(title, letters, placeholder=" ..."), fill=INK, font_size=size)
    lines = wrap(shorten(status, STATUS_LINES * letters, placeholder=" ..."), letters)[:STATUS_LINES]
    colour = _bytes(STATUS_COLOUR[scene.status])
    for i, line in enumerate(lines):
        pen.text((BORDER, 34 + i * LINE), line, fill=colour, font_size=SMALL_LETTERS)
    pen.text((BORDER, 34 + len(lines) * LINE), numbers, fill=INK, font_size=SMALL_LETTERS)
    return np.vstack([np.asarray(band), image])


def legend(width: int) -> np.ndarray:
    """What each colour stands for, shape (height, width, 3), the height a multiple of 16."""
    _, pen = _paper(1, 1)
    places, x, y = [], BORDER, 0
    for show in Show:
        room = SWATCH + int(pen.textlength(show.legend, font_size=SMALL_LETTERS))
        if x + room > width - BORDER and x > BORDER:
            x, y = BORDER, y + LINE
        places.append((show, x, y))
        x += room + LEGEND_GAP
    paper, pen = _paper(width, -(-(y + LINE + BORDER) // 16) * 16)
    for show, x, y in places:
        pen.rectangle((x, y + 8, x + 12, y + 20), fill=_bytes(show.colour))
        pen.text((x + SWATCH, y + 6), show.legend, fill=INK, font_size=SMALL_LETTERS)
    return np.asarray(paper)


def _bytes(colour: Colour) -> tuple[int, ...]:
    return tuple(round(255 * part) for part in colour[:3])


def _paper(width: int, height: int) -> tuple[object, ImageDraw]:
    from PIL import Image, ImageDraw

    paper = Image.new("RGB", (width, height), PAPER)
    return paper, ImageDraw.Draw(paper)
