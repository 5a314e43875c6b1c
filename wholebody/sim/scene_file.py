"""MuJoCo files that a robot is to stand in, looked at before MuJoCo gets them (`docs/security.md`).

MuJoCo is given text and bytes, never a path: nothing is read but the file and the meshes and pictures in its folder.
"""

from __future__ import annotations

import struct
from pathlib import Path
from xml.parsers import expat

from models.scenes import SceneFile
from models.spec import RobotSpecError
from policy.errors import printable
from policy.reading import DEPTH_MAX, ReadingError, read_text, require_file

FILE_MAX, ASSETS_MAX = 2**20, 16 * 2**20
"""Largest file, and largest meshes and pictures together [bytes]."""
ELEMENTS_MAX = 2000
"""Most elements of a file."""
NUMBER_MAX = 1e6
"""Largest number in an attribute, in any [unit]; chosen, no trial is on record."""
PIXELS_MAX = 4096
"""Largest width or height of a texture."""
BODIES = {"worldbody", "body", "frame", "geom", "joint", "freejoint", "inertial", "site", "camera", "light"}
ELEMENTS = BODIES | {"mujoco", "compiler", "default", "asset", "mesh", "texture", "material", "statistic", "visual"}
"""What a scene is made of, and the `LOOK` of its own, which the robot's model has already."""
LOOK = {"global", "quality", "headlight", "map", "scale", "rgba"}
FOLDERS = {"meshdir", "texturedir", "assetdir"}
COMPILER = FOLDERS | {"angle", "autolimits", "eulerseq", "inertiafromgeom", "boundmass", "boundinertia"}
"""What a file may tell the compiler."""
_REFUSED = {"plugin", "content_type", "params", "user"}
_MESHES, _PICTURES = (".obj", ".stl"), (".png",)
_SMALL = {"width": PIXELS_MAX, "height": PIXELS_MAX, "nchannel": 4, "gridsize": 12}
_PNG = b"\x89PNG\r\n\x1a\n"


def scene_of(name: str) -> str | SceneFile:
    """A scene by its name: a file if that ends with ``.xml``, else one of `models.scenes.SCENES`.

    Raises:
        RobotSpecError: If the file cannot be read, or there is something in it that a scene does not have.
    """
    if not name.lower().endswith(".xml"):
        return name
    shown = printable(name, 200)
    try:
        text = read_text(name, FILE_MAX)
        found = _Contents(text)
        return SceneFile(shown, text, _assets(Path(name).parent, found))
    except (ReadingError, expat.ExpatError) as error:
        fault = error if isinstance(error, ReadingError) else f"is no XML: {error}"
        raise RobotSpecError(f"scene '{shown}' {fault}") from error
    except OSError as error:
        raise RobotSpecError(f"scene '{shown}' cannot be read: {error.strerror}") from error


class _Contents:
    """What a file has, found without building it; a `ReadingError` for what a scene does not have.

    Attributes:
        files: Folder, from the compiler's settings, and name of each mesh and picture.
    """

    def __init__(self, text: str) -> None:
        self._depth = self._count = 0
        self._named: list[tuple[str, str]] = []
        self._folders: dict[str, str] = {}
        parser = expat.ParserCreate()
        parser.StartElementHandler, parser.EndElementHandler = self._begin, self._end
        parser.StartDoctypeDeclHandler = self._declare
        parser.Parse(text, True)
        folder = self._folders.get("assetdir", "")
        by_kind = {"mesh": self._folders.get("meshdir", folder), "texture": self._folders.get("texturedir", folder)}
        self.files = [(by_kind[kind], name) for kind, name in self._named]

    def _begin(self, element: str, attributes: dict[str, str]) -> None:
        self._depth, self._count = self._depth + 1, self._count + 1
        if self._depth > DEPTH_MAX or self._count > ELEMENTS_MAX:
            raise ReadingError(f"has more than {ELEMENTS_MAX} elements, or more than {DEPTH_MAX} in each other")
        if element not in ELEMENTS | LOOK:
            raise ReadingError(
                f"has <{printable(element, 40)}>; bodies and geoms with their joints, materials and meshes are taken, "
                "physics are the robot's, and nothing is included"
            )
        for name, value in attributes.items():
            self._attribute(element, name, value)

    def _attribute(self, element: str, name: str, value: str) -> None:
        what = f"<{element} {printable(name, 40)}=...>"
        if (
            name in _REFUSED
            or (element == "mesh" and name == "builtin")
            or (element == "compiler" and name not in COMPILER)
        ):
            raise ReadingError(f"has {what}, which is not taken in a scene")
        if name.startswith("file"):
            if element not in ("mesh", "texture"):
                raise ReadingError(f"has {what}, which is not taken in a scene")
            self._named.append((element, value))
        elif name in FOLDERS:
            self._folders[name] = value
        else:
            for token in value.split():
                _require_number(what, token, _SMALL.get(name, NUMBER_MAX))

    def _end(self, element: str) -> None:
        self._depth -= 1

    def _declare(self, *declaration: object) -> None:
        raise ReadingError("declares a document type; a scene has none")


def _require_number(what: str, token: str, most: float) -> None:
    """Refuse a number that is too large, infinite or none; names are left alone."""
    try:
        number = float(token)
    except ValueError:
        return
    if not abs(number) <= most:
        raise ReadingError(f"has {what} with {printable(token, 40)}; finite numbers up to {most:g} are taken")


def _assets(folder: Path, contents: _Contents) -> dict[str, bytes]:
    """Contents of the files that a scene names, all within its folder, by the names that MuJoCo asks for."""
    assets: dict[str, bytes] = {}
    root, left = folder.resolve(), ASSETS_MAX
    for below, name in dict.fromkeys(contents.files):
        text = printable(name, 80)
        try:
            path = (folder / below / name).resolve()
        except (RuntimeError, ValueError) as error:
            raise ReadingError(f"names the file '{text}', which leads nowhere") from error
        if not path.is_relative_to(root) or Path(name).is_absolute() or Path(below).is_absolute():
            raise ReadingError(f"names the file '{text}', which is not in its folder")
        if path.suffix.lower() not in (*_MESHES, *_PICTURES):
            raise ReadingError(f"names the file '{text}'; {', '.join((*_MESHES, *_PICTURES))} are read")
        try:
            left -= require_file(path, left)
        except ReadingError as error:
            raise ReadingError(f"names the file '{text}', which {error} for all that it names") from error
        content = path.read_bytes()[: ASSETS_MAX + 1]
        _require_picture(text, path, content)
        assets[str(Path(below) / name)] = content
    return assets


def _require_picture(name: str, path: Path, content: bytes) -> None:
    """Refuse a picture that would unpack to more than `PIXELS_MAX` a side."""
    if path.suffix.lower() not in _PICTURES:
        return
    sizes = struct.unpack(">II", content[16:24]) if content[:8] == _PNG and len(content) > 24 else (0, 0)
    if not 1 <= max(sizes) <= PIXELS_MAX:
        raise ReadingError(f"names the picture '{name}' of {sizes[0]} x {sizes[1]} pixels; 1 to {PIXELS_MAX} are read")
