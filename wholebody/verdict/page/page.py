"""Writes a verdict as one HTML file: what it tells is data, what shows it are the files beside this one."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from models.conversion import Conversion
from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio
from models.spec import RobotSpec
from policy.writing import write_text
from wholebody.config import ControllerConfig
from wholebody.errors import InputError, require_extra
from wholebody.robot.support_polygon import convex_polygon
from wholebody.sim.pictures.scene import STATUS_COLOUR, Colour, Show
from wholebody.sim.record import SIDES, Record
from wholebody.sim.scene_file import scene_of
from wholebody.types import Status
from wholebody.verdict.page.drawing import CAMERA, REACH_COLOUR, snapshot, tree
from wholebody.verdict.page.frames import Frames, in_mujoco
from wholebody.verdict.page.ghost import Ghost
from wholebody.verdict.page.reach_layer import reach_fields
from wholebody.verdict.page.timelines import Panel, panels
from wholebody.verdict.report import lines, violation_line
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity
from wholebody.verdict.why.headline import headline
from wholebody.verdict.why.sentence import change_text

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Shown:
    """What a page is made of.

    Attributes:
        verdict: The answer.
        record: The run.
        spec: The robot. config: Of its controller.
        command: Arguments that make the run again.
        ghost: The repaired motion, if there is one.
        since: When the input began, from where a page counts its time [s].
    """

    verdict: Verdict
    record: Record
    spec: RobotSpec
    config: ControllerConfig
    command: str = ""
    ghost: Ghost | None = None
    since: float = 0.0


def require_packages() -> None:
    """Refuse to begin what could not be written.

    Raises:
        InputError: If the extra is not installed.
    """
    require_extra("report", "k3d", "a report")


def write_page(path: str | Path, shown: Shown) -> None:
    """Write a page.

    Raises:
        InputError: If the extra is not installed, or nothing was run.
        OSError: If the file cannot be written.
    """
    require_packages()
    if not len(shown.record.arrays.get("time", ())):
        raise InputError(f"there is no report of {shown.verdict.name}: nothing was run")
    write_text(path, page(shown))


def page(shown: Shown) -> str:
    """The page as text."""
    frames, record, scene = Frames.of(shown.record), shown.record, scene_of(str(shown.record["scene"]))
    model = load_mujoco(shown.spec, scene=scene, visuals=True)
    conversion = Conversion(shown.spec, load_pinocchio(shown.spec), model)
    palms = {name: frames.of_column(f"T_world_palms_{name}")[..., :3, 3] for name in ("asked", "commanded", "measured")}
    binary, objects = snapshot(shown.spec, scene, _stood_on(record), palms, reach_fields(shown.spec, shown.config))
    arrays = {
        "time": frames.times - shown.since,
        "qpos": in_mujoco(conversion, model, frames.of_column("q"), frames.of_column("objects")),
        **palms,
        **{name: frames.of_column(name) for name in ("pressure", "capture_point", "com")},
    }
    if shown.ghost is not None:
        ghost = in_mujoco(conversion, model, shown.ghost.q, None)
        arrays |= {"ghost_time": shown.ghost.times - shown.since, "ghost": ghost}
    drawn = panels(frames, shown.spec, shown.config)
    for i, panel in enumerate(drawn):
        for k, line in enumerate(panel.lines):
            arrays[f"line {i} {k}"] = line.values
            if line.whose is not None:
                arrays[f"whose {i} {k}"] = line.whose
    directory, blob = _packed(arrays)
    about = _data(shown, frames) | {
        "arrays": directory,
        "tree": tree(model),
        "objects": objects,
        "panels": [_panel(panel) for panel in drawn],
        "camera": CAMERA,
        "legend": _legend(shown.ghost is not None, "reach" in objects),
    }
    data = {"code": _code(), "scene": binary, "arrays": zlib.compress(blob, 9)}
    return _filled("page.html", shown.verdict.name, about, {name: _text(part) for name, part in data.items()})


def _stood_on(record: Record) -> list[np.ndarray]:
    """What the robot stood on, as polygons (c, 2) [m]: between both feet, or each footprint of one that makes steps."""
    prints = record.footprints()
    if len(prints) <= len(SIDES):
        return [convex_polygon(record["soles"][0]).vertices]
    return [convex_polygon(one.corners).vertices for one in prints]


def _filled(template: str, title: str, about: dict[str, Any], data: Mapping[str, str]) -> str:
    """A template with style, script and data; `about` is JSON that cannot end its element."""
    words = json.dumps(about, allow_nan=False).replace("<", "\\u003c")
    parts = {"title": escape(title), "style": _read("page.css"), "script": _read("page.js"), "about": words, **data}
    text = _read(template)
    for name, part in parts.items():
        before, _, after = text.partition(f"[[{name}]]")
        text = before + part + after
    return text


def _read(name: str) -> str:
    return (HERE / name).read_text(encoding="utf-8")


def _code() -> bytes:
    """K3D's own script with its licence, compressed: a page without an address in it."""
    import k3d

    folder = Path(k3d.__file__).parent / "static"
    script = (folder / "standalone.js").read_bytes()
    return zlib.compress((folder / "standalone.js.LICENSE.txt").read_bytes() + b"\n" + script, 9)


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _packed(arrays: Mapping[str, np.ndarray]) -> tuple[dict[str, list[int]], bytes]:
    """Arrays as float32 one after the other; where each begins, and its shape."""
    directory, parts, at = {}, [], 0
    for name, values in arrays.items():
        directory[name] = [at, *values.shape]
        parts.append(np.ascontiguousarray(values, dtype="<f4").tobytes())
        at += values.size
    return directory, b"".join(parts)


def _panel(panel: Panel) -> dict[str, Any]:
    curves = [
        {"name": line.name, "colour": _css(line.colour), "dashed": line.dashed, "names": line.names}
        for line in panel.lines
    ]
    return {
        "title": panel.title, "unit": panel.unit, "lines": curves, "bounds": panel.bounds, "most": panel.most,
        "knee": panel.knee, "above": panel.above,
    }  # fmt: skip


def _css(colour: tuple[float, ...]) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in colour[:3])


def _legend(ghost: bool, reach: bool) -> list[dict[str, str]]:
    """Layers that can be hidden: name, words and colour; ``off`` marks those hidden at first."""
    shows: list[tuple[str, str, Colour]] = [(show.name.lower(), show.legend, show.colour) for show in Show]
    shows = [(name, words, (0.90, 0.10, 0.45, 1.0) if name == "pressure" else colour) for name, words, colour in shows]
    shows.append(("measured", "reached", (0.50, 0.53, 0.56, 1.0)))
    if ghost:
        shows.append(("ghost", "repaired motion", (0.25, 0.45, 0.95, 1.0)))
    entries = [{"name": name, "words": words, "colour": _css(colour)} for name, words, colour in shows]
    if reach:
        entries.append(
            {"name": "reach", "words": "where palms can be held", "colour": _css(REACH_COLOUR), "off": "off"}
        )
    return entries


def _data(shown: Shown, frames: Frames) -> dict[str, Any]:
    """Words of a page."""
    verdict, record = shown.verdict, shown.record
    status = frames.of_column("status").tolist()
    defaults = asdict(ControllerConfig())
    return {
        "name": verdict.name,
        "verdict": verdict.verdict,
        "headline": headline(verdict),
        "causes": [{"sentence": one.sentence, "time": one.time} for one in verdict.causes],
        "would": [change_text(one) for one in verdict.would_do],
        "repaired": shown.ghost.words if shown.ghost else "",
        "violations": [
            {
                "text": violation_line(one, verdict.fps),
                "time": one.time,
                "severity": one.severity.value,
                "code": one.code.value,
                "came_of": one.came_of,
            }
            for one in verdict.violations
        ],
        "summary": [
            line.strip()
            for line in lines(verdict)
            if line.startswith(("  proven", "  limits", "  palms", "  time", "  balance"))
        ],
        "status": [{"name": one.value, "colour": _css(STATUS_COLOUR[one])} for one in Status],
        "statuses": [[one.value for one in Status].index(name) for name in status],
        "robot": verdict.robot,
        "scene": str(record["scene"]),
        "command": shown.command,
        "changed": _changed(verdict.config, defaults),
        "config": verdict.config,
        "versions": verdict.versions | {"k3d": version("k3d")},
        "counted": sum(one.severity is not Severity.NOTE for one in verdict.violations),
    }


def _changed(config: dict[str, Any], defaults: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Settings that are not the defaults, by their path."""
    found = {}
    for name, value in config.items():
        default = defaults.get(name)
        if isinstance(value, dict) and isinstance(default, dict):
            found |= _changed(value, default, f"{prefix}{name}.")
        elif value != default:
            found[prefix + name] = value
    return found
