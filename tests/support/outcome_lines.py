"""Outcomes of `tests.studies.outcomes` in files: a line of JSON each, or packed (.xz), without what no fit needs."""

import json
import lzma
from pathlib import Path

STORED = Path(__file__).parents[1] / "studies" / "stored" / "outcomes.jsonl.xz"
"""What the shipped calibration was fitted to."""
KEPT = "case", "draw", "revision", "family", "group", "start", "world", "begins", "steps", "fps"
FOLLOWS, TOLD = ("as_given", "planned"), ("fell", "early", "followed")
DIGITS = 4
"""Of each quantity in a packed file; chosen: no fit tells more apart."""


def read_lines(path):
    """Each outcome as a dict."""
    path = Path(path)
    if path.suffix != ".xz":
        return [json.loads(text) for text in path.read_text().splitlines()]
    head, *lines = lzma.decompress(path.read_bytes()).decode().splitlines()
    names = json.loads(head)["quantities"]
    return [line | {"quantities": dict(zip(names, line["quantities"], strict=True))} for line in map(json.loads, lines)]


def pack(lines, path):
    """Write outcomes of the same quantities packed."""
    names, texts = list(lines[0]["quantities"]), []
    for line in lines:
        kept = {name: line[name] for name in KEPT}
        kept |= {follow: {name: line[follow][name] for name in TOLD} for follow in FOLLOWS}
        texts.append(json.dumps(kept | {"quantities": [float(f"{line['quantities'][n]:.{DIGITS}g}") for n in names]}))
    text = "\n".join([json.dumps({"quantities": names}), *texts])
    Path(path).write_bytes(lzma.compress(text.encode(), preset=9))
