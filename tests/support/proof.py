"""The checker of certificates as it stands in ``docs/verdict.md``."""

import re
from functools import cache
from pathlib import Path


@cache
def checker():
    text = (Path(__file__).parents[2] / "docs" / "verdict.md").read_text().partition("## What is proven")[2]
    names = {}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], names)
    return names["proves"]


def proves(tick):
    """Whether the ``tick`` of a verdict as JSON is a proof."""
    return checker()(tick)
