"""Where the files are that come with the package."""

from pathlib import Path

_PACKAGE = Path(__file__).parent


def configs_folder() -> Path:
    """The folder of the YAML configurations: inside the installed package, or `configs/` of a checkout."""
    installed = _PACKAGE / "_configs"
    return installed if installed.is_dir() else _PACKAGE.parent / "configs"


def verdict_schema() -> Path:
    """The JSON Schema of what `--json` writes."""
    return _PACKAGE / "verdict" / "verdict.schema.json"
