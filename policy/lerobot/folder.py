"""Where the files of a checkpoint are, below what a user names."""

from __future__ import annotations

import re
from pathlib import Path

CONFIG_FILE = "config.json"
BELOW = ("pretrained_model", "last/pretrained_model", "checkpoints/last/pretrained_model")
"""Folders in which LeRobot's training puts a checkpoint: below a step's folder, all the checkpoints', and the run's."""
HUB_ID = re.compile(r"[\w-][\w.-]*/[\w-][\w.-]*")


def checkpoint_folder(path: str | Path) -> Path:
    """Folder with ``config.json``: the one named, or the last checkpoint of the training run named.

    A folder in which there is none is given back as it is.
    """
    path = Path(path)
    places = [path, *(path / below for below in BELOW)]
    return next((place for place in places if (place / CONFIG_FILE).is_file()), path)


def whereabouts(path: str | Path) -> str:
    """What would help a person who named a checkpoint that is not there."""
    name = str(path)
    if not Path(path).exists() and HUB_ID.fullmatch(name):
        return (
            f"if '{name}' is a model of the Hugging Face hub: nothing is downloaded here; say "
            f"hf download {name} --local-dir FOLDER, and name that folder"
        )
    return "give the folder of a checkpoint or of its training run, in which checkpoints/last/pretrained_model is found"
