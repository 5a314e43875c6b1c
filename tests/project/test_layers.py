"""The import map: data flows models -> policy -> wholebody, and inside wholebody from the first layer to the last.

Strategy: every import statement of the three packages is read with `ast`, at any depth and in any function, and held
against the map below; the checker itself is shown to find each kind of violation in sources made for it. What importing
a package loads is measured in a fresh process.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("models", "policy", "wholebody")

# Which of our packages each one may import, besides itself.
MAY_IMPORT = {"models": set(), "policy": {"models"}, "wholebody": {"models", "policy"}}

# Inside wholebody a module imports from earlier layers, and in a tuple only from names to its left.
# The names of a set are siblings: none imports another.
LAYERS = (
    ("resources", "lean_jit", "native", "errors", "types", "config", "config_file"),
    ("support", "bodies", "robot", "gjk_core", "shapes", "proximity", "underside"),
    {"reference", "tasks", "limits", "contacts", "sim"},
    {"qp", "posture"},
    (
        "body_reference",
        "body_tasks",
        "controller",
        "kinematic",
        "placo_tasks",
        "placo_program",
        "placo_backend",
        "backends",
        "posture_plan",
        "posture_track",
        "plan_balance",
        "temper",
        "planner",
        "denoise",
        "floor",
        "follow_core",
        "follower",
        "supervisor",
    ),
    (
        "score",
        "stitching",
        "runtime",
        "solver_study",
        "timing",
        "verdict",
        "checker",
        "warm_up",
        "reach_script",
        "slow_ticks",
        "tick_bench",
        "loop_bench",
    ),
    ("report", "doctor", "bench", "sources", "console", "cli"),
)
COMPOSITION = LAYERS[5:]

# Loaded only inside their adapter, policy/lerobot*.py.
ADAPTER_ONLY = {"torch", "torchvision", "lerobot", "transformers", "safetensors", "datasets"}

# Too slow or too big to come with `import wholebody`.
HEAVY = ("pinocchio", "mujoco", "placo", "torch", "lerobot", "numba", "scipy", "qpsolvers", "matplotlib", "imageio")


def module_name(path, root):
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(path, root):
    """Dotted names that a file imports; `from a import b` gives `a.b` where that is a module, else `a`."""
    found = set()
    package = path.relative_to(root).parent.parts
    for node in ast.walk(ast.parse(path.read_text(), filename=str(path))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            source = ".".join(part for part in (base, node.module) if part)
            for alias in node.names:
                target = root.joinpath(*source.split("."), alias.name)
                is_module = target.is_dir() or target.with_suffix(".py").exists()
                found.add(f"{source}.{alias.name}" if is_module else source)
    return found


def rank(module):
    """(layer, place in it) of a wholebody module; the place of siblings is their name."""
    unit = module.split(".")[1]
    for layer, names in enumerate(LAYERS):
        if unit in names:
            return layer, unit if isinstance(names, set) else names.index(unit)
    raise LookupError(f"{module} is not in the import map: add it to LAYERS in tests/project/test_layers.py")


def may_import_inside_wholebody(module, target):
    if module == "wholebody":
        return True  # its __init__ only names what the package offers
    if target == "wholebody":
        return False
    if module.split(".")[1] == target.split(".")[1]:
        return True
    (layer, place), (target_layer, target_place) = rank(module), rank(target)
    if layer == target_layer:
        return not isinstance(place, str) and target_place < place
    return target_layer < layer


def violations(root):
    """One sentence for every import that the map does not allow."""
    found = []
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            module = module_name(path, root)
            for target in sorted(imports_of(path, root)):
                top = target.split(".")[0]
                if top in ("tests", "examples", "benchmarks"):
                    found.append(f"{module} imports {target}: the library does not know its users")
                elif top in ADAPTER_ONLY and not (package == "policy" and path.name.startswith("lerobot")):
                    found.append(f"{module} imports {target}: only policy/lerobot*.py may")
                elif top in PACKAGES and top != package and top not in MAY_IMPORT[package]:
                    found.append(f"{module} imports {target}: {package} may not")
                elif top == package == "wholebody" and not may_import_inside_wholebody(module, target):
                    found.append(f"{module} imports {target}: it is a sibling or a later layer")
    return found


def knows_everything(root):
    """Modules below the composition layer that import policy, controller and plant."""
    composition = {name for names in COMPOSITION for name in names}
    found = []
    for path in sorted((root / "wholebody").rglob("*.py")):
        module = module_name(path, root)
        if module == "wholebody" or module.split(".")[1] in composition:
            continue
        targets = [f"{target}." for target in imports_of(path, root)]
        if all(
            any(t.startswith(p) for t in targets)
            for p in ("policy.", "wholebody.control.controller.", "wholebody.sim.")
        ):
            found.append(module)
    return found


def test_every_import_follows_the_map():
    assert violations(ROOT) == []


def test_every_module_of_wholebody_has_a_layer():
    for path in sorted((ROOT / "wholebody").rglob("*.py")):
        module = module_name(path, ROOT)
        assert module == "wholebody" or rank(module)


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
        ("models/g1.py", "import policy", "models may not"),
        ("models/g1.py", "def f():\n    from wholebody.robot.state import Robot", "models may not"),
        ("policy/base.py", "from wholebody import errors", "policy may not"),
        ("policy/base.py", "import torch.nn as nn", "only policy/lerobot"),
        ("wholebody/cli/main.py", "def f():\n    import lerobot", "only policy/lerobot"),
        ("wholebody/episode/run.py", "from tests.support.stored import StoredValues", "does not know its users"),
        ("wholebody/tasks/com.py", "from wholebody.limits import base", "sibling"),
        ("wholebody/tasks/com.py", "from ..limits.base import Rows", "sibling"),
        ("wholebody/sim/plant.py", "if TYPE_CHECKING:\n    from wholebody.qp.problem import QP", "later layer"),
        ("wholebody/errors.py", "from wholebody.types import RobotState", "later layer"),
        ("wholebody/robot/state.py", "from wholebody import Controller", "later layer"),
        ("wholebody/control/controller.py", "from wholebody.execution.supervisor import Supervisor", "later layer"),
    ],
)
def test_the_checker_finds(tmp_path, file, source, complaint):
    for name in ("limits/base", "qp/problem", "errors", "types", "supervisor", "robot"):
        path = tmp_path / "wholebody" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    path = tmp_path / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(source)
    (sentence,) = violations(tmp_path)
    assert sentence.startswith(file.removesuffix(".py").replace("/", "."))
    assert complaint in sentence


@pytest.mark.parametrize(
    ("file", "source"),
    [
        ("policy/base.py", "import numpy as np\nfrom models import g1\nfrom policy.chunk import ActionChunk"),
        ("policy/lerobot/steps.py", "import torch\nfrom lerobot.processor import ProcessorStep"),
        (
            "wholebody/tasks/com.py",
            "from wholebody.robot.state import Robot\nfrom wholebody.tasks.base import Objective",
        ),
        ("wholebody/types.py", "from wholebody.errors import InputError"),
        ("wholebody/execution/supervisor.py", "from wholebody.control.controller import Controller"),
        (
            "wholebody/cli/main.py",
            "from wholebody import report, runtime\nfrom policy.scripted.policy import lissajous",
        ),
        ("wholebody/__init__.py", "from wholebody.episode.run import run"),
    ],
)
def test_the_checker_lets_pass(tmp_path, file, source):
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    path.write_text(source)
    for name in ("report", "runtime"):
        (tmp_path / "wholebody").mkdir(exist_ok=True)
        (tmp_path / "wholebody" / f"{name}.py").touch()
    assert violations(tmp_path) == []


def test_the_checker_finds_a_controller_that_knows_everything(tmp_path):
    source = "import policy.base\nimport wholebody.control.controller\nfrom wholebody.sim.plant import Plant"
    (tmp_path / "wholebody").mkdir()
    (tmp_path / "wholebody" / "supervisor.py").write_text(source)
    (tmp_path / "wholebody" / "runtime.py").write_text(source)
    assert knows_everything(tmp_path) == ["wholebody.execution.supervisor"]


def test_a_module_that_nobody_placed_is_named(tmp_path):
    with pytest.raises(LookupError, match=r"wholebody\.helpers is not in the import map"):
        rank("wholebody.helpers")
