"""The robot's URDF made light: hulls instead of meshes, absolute paths, no visuals unless wanted.

The physics (inertias, joints, limits) is copied untouched; the palm points are added as links without mass.
Pinocchio's collision model, placo and MuJoCo read the same file.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
import xml.etree.ElementTree as ET
from copy import deepcopy
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from itertools import combinations
from pathlib import Path

from models.cache import cache_dir, write_whole
from models.hulls import hull_file
from models.spec import RobotSpec, RobotSpecError

_LAYOUT = 2  # raise when the files written here change, so that old ones are left behind
NEIGHBOUR_JOINTS = 2
"""Links with at most this many joints between them touch by design and are not tested for collision."""

_PACKAGE = re.compile("package://+example-robot-data/")
SOLE_RADIUS = 0.005
"""Radius of the spheres on which a foot stands whose URDF has another shape there [m]: that of the G1's."""


def light_urdf(spec: RobotSpec, *, visuals: bool = False) -> Path:
    """Path of the light URDF ``robot.urdf``, from the cache or written now, with ``collisions.json`` beside it.

    Collision shapes are named ``<link>_<n>``, which is Pinocchio's name for them. Palms without a collision shape get
    the hull of what they look like. ``collisions.json`` lists the pairs of `collision_pairs`, as placo reads them.

    Raises:
        RobotSpecError: If a mesh is missing or the cache cannot be written.
    """
    asked = spec, visuals, cache_dir(), spec.urdf.stat().st_mtime_ns
    if not _light_urdf(*asked).is_file():  # somebody has emptied the cache since
        _light_urdf.cache_clear()
    return _light_urdf(*asked)


@lru_cache(maxsize=8)
def _light_urdf(spec: RobotSpec, visuals: bool, cached: Path, _changed: int) -> Path:
    source, root = spec.urdf.read_bytes(), read_urdf(spec)
    changed = _leave_out(spec, root) | _round_soles(spec, root)
    hulls = {mesh: hull_file(_mesh_path(spec, mesh)) for mesh in _collision_meshes(spec, root)}
    digest = hashlib.sha256(source)
    tools = [dataclasses.astuple(tool) for tool in spec.tools]
    described = [_LAYOUT, visuals, str(spec.urdf), tools, {mesh: str(hull) for mesh, hull in hulls.items()}]
    described += [spec.locked] if spec.locked else []
    described += [spec.without_collision, [foot.contact_points for foot in spec.feet]] if changed else []
    digest.update(json.dumps(described).encode())
    folder = cached / "urdf" / f"{spec.name}{'_visual' if visuals else ''}-{digest.hexdigest()[:16]}"
    path = folder / "robot.urdf"
    if path.is_file():
        return path
    _add_palm_collisions(spec, root)
    _add_palm_points(spec, root)
    _rewrite(spec, root, hulls, visuals)
    write_whole(folder / "collisions.json", json.dumps(collision_pairs(spec, root), indent=0).encode())
    return write_whole(path, ET.tostring(root))


@cache
def package() -> Path:
    """Folder of the robot descriptions that are installed.

    Raises:
        RobotSpecError: If there is none.
    """
    try:
        found = distribution("example-robot-data")
    except PackageNotFoundError:
        raise RobotSpecError("package 'example-robot-data' is missing; pip install 'example-robot-data>=6.0'") from None
    return Path(str(found.locate_file("cmeel.prefix/share/example-robot-data"))).resolve()


def read_urdf(spec: RobotSpec) -> ET.Element:
    """Root element of a robot's URDF, its locked joints fixed.

    Raises:
        RobotSpecError: If it lacks one of those.
    """
    root = parse(spec.urdf)
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    for name in spec.locked:
        if name not in joints:
            raise RobotSpecError(f"{spec.urdf.name} has no joint '{name}' that spec '{spec.name}' locks")
        joints[name].set("type", "fixed")
    return root


def parse(path: Path) -> ET.Element:
    """Root element of a URDF."""
    return ET.parse(path).getroot()


def collision_pairs(spec: RobotSpec, root: ET.Element) -> list[tuple[str, str]]:
    """Links whose distance matters: not within two joints, not within one hand.

    Args:
        spec: The robot.
        root: Its light URDF, parsed.
    """
    tree = JointTree(root)
    solid = [link.get("name", "") for link in root.iter("link") if link.find("collision") is not None]
    hands = [{tool.wrist_frame, *tree.below(tool.palm_body)} for tool in spec.tools]
    return [
        (first, second)
        for first, second in combinations(solid, 2)
        if tree.joints_between(first, second) > NEIGHBOUR_JOINTS and not any({first, second} <= hand for hand in hands)
    ]


class JointTree:
    """Which moving joints lie between two links of a URDF."""

    def __init__(self, root: ET.Element) -> None:
        self._parent: dict[str, tuple[str, bool]] = {}
        for joint in root.iter("joint"):
            child, parent = joint.find("child"), joint.find("parent")
            if child is not None and parent is not None:
                moves = joint.get("type") != "fixed"
                self._parent[child.get("link", "")] = (parent.get("link", ""), moves)

    def path(self, link: str) -> list[str]:
        """Links that begin a moving part, from the link's own up to the root."""
        found = []
        while link in self._parent:
            parent, moves = self._parent[link]
            if moves:
                found.append(link)
            link = parent
        return [*found, link]

    def joints_between(self, link_a: str, link_b: str) -> int:
        """Number of moving joints on the way from one link to the other."""
        path_a, path_b = self.path(link_a), self.path(link_b)
        common = len(set(path_a) & set(path_b))
        return len(path_a) + len(path_b) - 2 * common

    def below(self, link: str) -> set[str]:
        """The link and everything that hangs on it."""
        found = {link}
        for child, (parent, _) in self._parent.items():
            if parent == link:
                found |= self.below(child)
        return found


def _mesh_path(spec: RobotSpec, name: str) -> Path:
    found = _PACKAGE.match(name)
    if found is None:
        raise RobotSpecError(f"mesh '{name}' of {spec.urdf.name} is outside example-robot-data, the one known package")
    return package() / name[found.end() :]


def _leave_out(spec: RobotSpec, root: ET.Element) -> bool:
    """Take the collision shapes of `RobotSpec.without_collision` out; whether there are any."""
    for link in root.iter("link"):
        if link.get("name") in spec.without_collision:
            for collision in link.findall("collision"):
                link.remove(collision)
    return bool(spec.without_collision)


def _round_soles(spec: RobotSpec, root: ET.Element) -> bool:
    """Put feet whose shapes are no spheres on spheres at their contact points; whether there are any."""
    changed = False
    for link in root.iter("link"):
        foot = next((foot for foot in spec.feet if foot.frame == link.get("name")), None)
        shapes = link.findall("collision")
        if foot is None or all(shape.find("geometry/sphere") is not None for shape in shapes):
            continue
        for shape in shapes:
            link.remove(shape)
        for x, y, z in foot.contact_points:
            collision = ET.SubElement(link, "collision")
            ET.SubElement(collision, "origin", xyz=f"{x!r} {y!r} {z + SOLE_RADIUS!r}", rpy="0 0 0")
            ET.SubElement(ET.SubElement(collision, "geometry"), "sphere", radius=repr(SOLE_RADIUS))
        changed = True
    return changed


def _collision_meshes(spec: RobotSpec, root: ET.Element) -> list[str]:
    palms = {tool.palm_body for tool in spec.tools}
    names = set()
    for link in root.iter("link"):
        shapes = list(link.iter("collision")) or (list(link.iter("visual")) if link.get("name") in palms else [])
        names |= {mesh.get("filename", "") for shape in shapes for mesh in shape.iter("mesh")}
    return sorted(names)


def _add_palm_collisions(spec: RobotSpec, root: ET.Element) -> None:
    palms = {tool.palm_body for tool in spec.tools}
    for link in root.iter("link"):
        if link.get("name") in palms and link.find("collision") is None:
            for visual in link.findall("visual"):
                collision = ET.SubElement(link, "collision")
                collision.extend(deepcopy(part) for tag in ("origin", "geometry") for part in visual.findall(tag))


def _add_palm_points(spec: RobotSpec, root: ET.Element) -> None:
    for tool in spec.tools:
        ET.SubElement(root, "link", name=tool.palm_frame)
        joint = ET.SubElement(root, "joint", name=f"{tool.palm_frame}_joint", type="fixed")
        ET.SubElement(joint, "origin", xyz=" ".join(repr(value) for value in tool.palm_offset), rpy="0 0 0")
        ET.SubElement(joint, "parent", link=tool.wrist_frame)
        ET.SubElement(joint, "child", link=tool.palm_frame)


def _rewrite(spec: RobotSpec, root: ET.Element, hulls: dict[str, Path], visuals: bool) -> None:
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            if not visuals:
                link.remove(visual)
            for mesh in visual.iter("mesh"):
                mesh.set("filename", str(_mesh_path(spec, mesh.get("filename", ""))))
        convex = ET.Element("collision_checking")
        for number, collision in enumerate(link.findall("collision")):
            collision.set("name", f"{link.get('name')}_{number}")
            for mesh in collision.iter("mesh"):
                mesh.set("filename", str(hulls[mesh.get("filename", "")]))
                # Pinocchio reads this and makes a convex shape of the mesh instead of a triangle tree.
                ET.SubElement(convex, "convex", name=collision.get("name", ""))
        if len(convex):
            link.append(convex)
