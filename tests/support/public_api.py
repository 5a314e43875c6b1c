"""Files that public names lie in, a line each, for ``make lint`` to check their types."""

from __future__ import annotations

import sys
from pathlib import Path

import models
import policy
import wholebody

ROOT = Path(__file__).parents[2]
PACKAGES = (models, policy, wholebody)


def files() -> list[str]:
    """Paths in the checkout of the modules that public classes and functions are defined in."""
    offered = [getattr(package, name) for package in PACKAGES for name in package.__all__]
    names = {getattr(one if callable(one) else type(one), "__module__", "") for one in offered}
    ours = [sys.modules[name] for name in names if name.startswith(tuple(f"{one.__name__}." for one in PACKAGES))]
    return sorted(str(Path(str(module.__file__)).relative_to(ROOT)) for module in ours)


if __name__ == "__main__":
    print("\n".join(files()))
