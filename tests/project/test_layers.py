"""The map of the folders: data flows models -> policy -> wholebody, and inside wholebody from floor to floor.

Strategy: every import statement of the packages is read with `ast`, at any depth and in any function, and held against
the map below; what was measured (rooms, floors, circles, arrows back) is printed by ``pytest -s``. The checker itself
is shown to find each kind of violation in sources made for it. What importing a package loads is measured in a fresh
process. Sizes of modules, functions and folders have bounds of their own: a room that outgrows them is two rooms.
"""

import ast
import re
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("models", "policy", "wholebody")
PLUGIN = "lerobot_robot_wholebody"  # a distribution of its own, which uses these

# Rooms from the ground up. A room imports from earlier floors only; on one floor none imports another.
FLOORS = (
    {"models", "wholebody.errors", "wholebody.resources"},
    {"wholebody.jit"},
    {"policy", "wholebody.types", "wholebody.collision", "wholebody.lending"},
    {"wholebody.config", "wholebody.robot"},
    {
        "wholebody.estimation",
        "wholebody.reference",
        "wholebody.tasks",
        "wholebody.limits",
        "wholebody.contacts",
    },
    {"wholebody.trajopt", "wholebody.qp", "wholebody.sim"},
    {"wholebody.planning", "wholebody.control", "wholebody.walking"},
    {"wholebody.backends"},
    {"wholebody.execution"},
    {"wholebody.episode"},
    {"wholebody.verdict", "wholebody.bench", "wholebody.live", "wholebody.guide"},
    {"wholebody.cli", "benchmarks"},
)
# The same inside policy, where most rooms are folders and the rest single files.
POLICY_FLOORS = (
    {"errors"},
    {"joints", "findings", "geometry", "clock", "reading", "sparing_log", "writing"},
    {"observation", "archive"},
    {"chunk", "kinematics", "placeholder_cameras"},
    {"action_spec"},
    {"base", "suspicion"},
    {"prefix", "scripted", "dataset", "learned"},
    {"recorded", "targets"},
    {"executor"},
    {"remote", "lerobot"},
)
# Only these know policy, controller and plant at once.
COMPOSITION = {"episode", "verdict", "bench", "live", "cli"}

# Loaded only inside their adapter, policy/lerobot, and where gradients are asked for.
ADAPTERS = ("policy.lerobot", "wholebody.guide")
ADAPTER_ONLY = {"torch", "torchvision", "lerobot", "transformers", "safetensors", "datasets"}

# Too slow or too big to come with `import wholebody`.
HEAVY = ("pinocchio", "mujoco", "placo", "torch", "lerobot", "llvmlite", "scipy", "qpsolvers", "matplotlib", "imageio")

MODULE_LINES, FUNCTION_LINES, FOLDER_FILES, ROOMS, PLANNING_FLOORS = 320, 60, 16, 30, 7


def module_name(path, root):
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def import_statements(source):
    """The import statements of a source, read once however many questions are asked about it."""
    found, waiting = [], [ast.parse(source)]
    while waiting:
        for node in ast.iter_child_nodes(waiting.pop()):
            if isinstance(node, ast.Import | ast.ImportFrom):
                found.append(node)
            elif not isinstance(node, ast.expr):  # which has no statements in it
                waiting.append(node)
    return found


def imports_of(path, root):
    """Dotted names that a file imports; `from a import b` gives `a.b` where that is a module, else `a`."""
    found = set()
    package = path.relative_to(root).parent.parts
    for node in import_statements(path.read_text()):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        else:
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            source = ".".join(part for part in (base, node.module) if part)
            for alias in node.names:
                target = root.joinpath(*source.split("."), alias.name)
                is_module = target.is_dir() or target.with_suffix(".py").exists()
                found.add(f"{source}.{alias.name}" if is_module else source)
    return found


def room(module):
    """The room of a module: its package, or inside wholebody what lies directly in it; `python -m` is the command."""
    parts = module.replace("wholebody.__main__", "wholebody.cli").split(".")
    return ".".join(parts[:2]) if parts[0] == "wholebody" else parts[0]


def floor(name, floors):
    for number, rooms in enumerate(floors):
        if name in rooms:
            return number
    raise LookupError(f"{name} is not in the map: give it a floor in tests/project/test_layers.py")


def sources(root, *packages):
    for package in packages:
        for path in sorted((root / package).rglob("*.py")):
            yield module_name(path, root), path


def arrows(root):
    """Imports between rooms, as pairs (module, target)."""
    for module, path in sources(root, *PACKAGES, "benchmarks"):
        for target in sorted(imports_of(path, root)):
            ours = target.split(".")[0] in PACKAGES
            if ours and module != "wholebody" and room(module) != room(target):
                yield module, target


def violations(root):
    """One sentence for every import that the map does not allow."""
    found = []
    for module, target in arrows(root):
        if target == "wholebody":
            if module.split(".")[0] == "wholebody":
                found.append(f"{module} imports {target}: that only names what the package offers its users")
        elif floor(room(target), FLOORS) >= floor(room(module), FLOORS):
            found.append(f"{module} imports {target}: it is on the same floor or above")
    for module, path in sources(root, *PACKAGES):
        for target in sorted(imports_of(path, root)):
            if target.split(".")[0] in ("tests", "examples", "benchmarks", PLUGIN):
                found.append(f"{module} imports {target}: the library does not know its users")
            elif target.split(".")[0] in ADAPTER_ONLY and not module.startswith(ADAPTERS):
                found.append(f"{module} imports {target}: only policy/lerobot and wholebody/guide may")
            elif module.startswith("policy.") and target.startswith("policy."):
                mine, other = module.split(".")[1], target.split(".")[1]
                if mine != other and floor(other, POLICY_FLOORS) >= floor(mine, POLICY_FLOORS):
                    found.append(f"{module} imports {target}: it is on the same floor or above")
    return found


def circles(root, *packages):
    """A circle of files that import each other, by name; none is the answer wanted."""
    graph = {}
    for module, path in sources(root, *packages):
        targets = {target for target in imports_of(path, root) if target.split(".")[0] in packages}
        graph[module] = targets - {module} if module not in PACKAGES else set()
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def knows_everything(root):
    """Modules below the composition layer that import policy, controller and plant."""
    found = []
    for module, path in sources(root, "wholebody"):
        if module == "wholebody" or module.split(".")[1] in COMPOSITION:
            continue
        targets = [f"{target}." for target in imports_of(path, root)]
        if all(any(t.startswith(p) for t in targets) for p in ("policy.", "wholebody.control.", "wholebody.sim.")):
            found.append(module)
    return found


def measured(root):
    """Rooms, floors in use, and arrows between rooms."""
    pairs = {(room(module), room(target)) for module, target in arrows(root)}
    rooms = {room(module) for module, _ in sources(root, *PACKAGES, "benchmarks")} - {"wholebody"}
    return len(rooms), floors_in_use(rooms, pairs), len(pairs)


def measured_inside(root, package):
    """The same of the files and folders that lie directly in a package."""
    prefix = f"{package}."
    names, pairs = set(), set()
    for module, path in sources(root, *package.split(".")[:1]):
        if module.startswith(prefix):
            name = module.removeprefix(prefix).split(".")[0]
            names.add(name)
            targets = {t.removeprefix(prefix).split(".")[0] for t in imports_of(path, root) if t.startswith(prefix)}
            pairs |= {(name, target) for target in targets - {name}}
    return len(names), floors_in_use(names, pairs), len(pairs)


def floors_in_use(rooms, pairs):
    """How high rooms stand on each other; a `CycleError` where some stand on themselves."""
    below = {name: {target for source, target in pairs if source == name} for name in rooms}
    level = {}
    for name in TopologicalSorter(below).static_order():
        level[name] = 1 + max((level.get(target, 0) for target in below.get(name, ())), default=0)
    return max(level.values())


def test_every_import_follows_the_map():
    assert violations(ROOT) == []


def test_every_room_has_a_floor_and_there_are_few_of_both():
    for module, _ in sources(ROOT, *PACKAGES):
        assert module in PACKAGES or floor(room(module), FLOORS) >= 0
        assert not module.startswith("policy.") or floor(module.split(".")[1], POLICY_FLOORS) >= 0
    rooms, floors, pairs = measured(ROOT)
    print(f"{rooms} rooms on {floors} floors, {pairs} arrows, 0 circles, {len(violations(ROOT))} arrows back")
    assert rooms <= ROOMS
    assert floors <= len(FLOORS)


def test_inside_the_planner_there_are_few_floors_and_none_leads_back():
    rooms, floors, pairs = measured_inside(ROOT, "wholebody.planning")
    print(f"wholebody.planning: {rooms} rooms on {floors} floors, {pairs} arrows, 0 circles")
    assert floors <= PLANNING_FLOORS


@pytest.mark.parametrize(("floors", "table"), [(FLOORS, 0), (POLICY_FLOORS, 1)])
def test_the_document_lists_the_floors_of_this_map(floors, table):
    section = (ROOT / "docs" / "architecture.md").read_text().split("| Floor | Rooms |")[1 + table]
    rows = re.findall(r"^\| (\d+) \| (.+) \|$", section, re.MULTILINE)
    assert [int(number) for number, _ in rows] == [*range(1, len(floors) + 1)]
    wanted = [", ".join(f"`{name}`" for name in sorted(rooms)) for rooms in floors]
    assert [rooms for _, rooms in rows] == wanted


def test_no_file_imports_itself_in_a_circle():
    assert circles(ROOT, *PACKAGES) == []


def test_no_test_imports_a_test():
    found = []
    for module, path in sources(ROOT, "tests"):
        found += [f"{module} imports {t}" for t in imports_of(path, ROOT) if t.split(".")[-1].startswith("test_")]
    assert found == []


def test_no_module_no_function_and_no_folder_is_too_large():
    found = []
    for _, path in sources(ROOT, *PACKAGES, PLUGIN):
        name, lines = path.relative_to(ROOT), path.read_text().count("\n")
        if lines > MODULE_LINES:
            found.append(f"{name} has {lines} lines; at most {MODULE_LINES}")
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                length = node.end_lineno - node.lineno + 1
                if length > FUNCTION_LINES:
                    found.append(f"{name}: {node.name} has {length} lines; at most {FUNCTION_LINES}")
    for folder in {path.parent for _, path in sources(ROOT, *PACKAGES)}:
        files = len([path for path in folder.glob("*.py") if path.name != "__init__.py"])
        if files > FOLDER_FILES:
            found.append(f"{folder.relative_to(ROOT)} has {files} files beside each other; at most {FOLDER_FILES}")
    assert found == []


def test_only_the_composition_layer_knows_policy_controller_and_plant():
    assert knows_everything(ROOT) == []


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_loads_nothing_heavy(package):
    code = f"import sys, {package}; print(sorted(set(sys.modules) & set({HEAVY!r})))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("file", "source", "complaint"),
    [
        ("models/unitree_g1.py", "import policy", "same floor or above"),
        ("models/unitree_g1.py", "def f():\n    from wholebody.robot import state", "same floor or above"),
        ("policy/base.py", "from wholebody.types import RobotState", "same floor or above"),
        ("policy/base.py", "import torch.nn as nn", "only policy/lerobot"),
        ("policy/base.py", "from policy.lerobot import spec", "same floor or above"),
        ("policy/base.py", "from lerobot_robot_wholebody import WholebodyG1", "does not know its users"),
        ("wholebody/cli/main.py", "def f():\n    import lerobot", "only policy/lerobot"),
        ("wholebody/episode/run.py", "from tests.support.stored import StoredValues", "does not know its users"),
        ("wholebody/tasks/com.py", "from wholebody.limits import base", "same floor or above"),
        ("wholebody/tasks/com.py", "from ..limits.base import Rows", "same floor or above"),
        ("wholebody/sim/plant.py", "if TYPE_CHECKING:\n    from wholebody.qp.problem import QP", "same floor or above"),
        ("wholebody/errors.py", "from wholebody.types import RobotState", "same floor or above"),
        ("wholebody/robot/state.py", "from wholebody import Controller", "only names what the package offers"),
        ("wholebody/control/controller.py", "from wholebody.execution.supervisor import Supervisor", "or above"),
    ],
)
def test_the_checker_finds(tmp_path, file, source, complaint):
    for name in ("limits/base", "qp/problem", "errors", "types", "execution/supervisor", "robot/state"):
        path = tmp_path / "wholebody" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (tmp_path / "policy/lerobot").mkdir(parents=True)
    (tmp_path / "policy/lerobot/spec.py").touch()
    path = tmp_path / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(source)
    found = violations(tmp_path)
    assert found
    assert all(sentence.startswith(file.removesuffix(".py").replace("/", ".")) for sentence in found)
    assert complaint in found[0]


@pytest.mark.parametrize(
    ("file", "source"),
    [
        ("policy/base.py", "import numpy as np\nfrom models import g1\nfrom policy.geometry import se3"),
        ("policy/lerobot/steps.py", "import torch\nfrom lerobot.processor import ProcessorStep"),
        (
            "wholebody/tasks/com.py",
            "from wholebody.robot.state import Robot\nfrom wholebody.tasks.base import Objective",
        ),
        ("wholebody/types.py", "from wholebody.errors import InputError"),
        ("wholebody/execution/supervisor.py", "from wholebody.control.controller import WholeBodyController"),
        (
            "wholebody/cli/main.py",
            "from wholebody.episode import run\nfrom policy.scripted.library import scripted_policy",
        ),
        ("wholebody/__init__.py", "from wholebody.episode.run import run_episode"),
    ],
)
def test_the_checker_lets_pass(tmp_path, file, source):
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    path.write_text(source)
    assert violations(tmp_path) == []


def test_the_checker_finds_a_circle(tmp_path):
    (tmp_path / "policy").mkdir()
    (tmp_path / "policy/a.py").write_text("def f():\n    from policy import b")
    (tmp_path / "policy/b.py").write_text("import policy.a")
    assert sorted(set(circles(tmp_path, "policy"))) == ["policy.a", "policy.b"]


def test_the_checker_finds_a_controller_that_knows_everything(tmp_path):
    source = "import policy.base\nimport wholebody.control.controller\nfrom wholebody.sim.plant import Plant"
    for name in ("execution", "episode"):
        (tmp_path / "wholebody" / name).mkdir(parents=True)
        (tmp_path / "wholebody" / name / "loop.py").write_text(source)
    assert knows_everything(tmp_path) == ["wholebody.execution.loop"]


def test_a_room_that_nobody_placed_is_named():
    with pytest.raises(LookupError, match=r"wholebody\.helpers is not in the map"):
        floor("wholebody.helpers", FLOORS)
