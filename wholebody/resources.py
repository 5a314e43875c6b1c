"""Where the files are that come with the package, and the processors and processes that it may use."""

import os
from multiprocessing import parent_process
from pathlib import Path
from threading import Thread

_PACKAGE = Path(__file__).parent


def configs_folder() -> Path:
    """The folder of the YAML configurations: inside the installed package, or `configs/` of a checkout."""
    installed = _PACKAGE / "_configs"
    return installed if installed.is_dir() else _PACKAGE.parent / "configs"


def verdict_schema() -> Path:
    """The JSON Schema of what `--json` writes."""
    return _PACKAGE / "verdict" / "verdict.schema.json"


def processors() -> list[int]:
    """Numbers of the processors that this process may use; of all where the system knows no choice, as on macOS."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def end_with_parent() -> None:
    """End a process of ours as soon as the one that began it is gone, killed too, whatever is being computed."""
    parent = parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    Thread(target=watch, name="ends with parent", daemon=True).start()
