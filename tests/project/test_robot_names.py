"""Strategy: the strings of the library are held against the names of the G1's joints and links. Code that finds a limb
by such a name works for that robot alone; it asks the robot's description instead. The few files that are about the
G1, or about how others name it, are listed with the reason; a listed file that no longer needs it fails too.
"""

import ast
from pathlib import Path

import pytest

from models import g1
from models.urdf import read_urdf

ROOT = Path(__file__).parents[2]
ABOUT_THE_G1 = {
    "policy/action_spec/builtin.py": "order of the waist in a layout of a public model",
    "policy/action_spec/hands.py": "which of a Dex3's fingers closes for which of another hand",
    "policy/dataset/joint_layout.py": "fingers of other hands in public data",
    "policy/dataset/naming/meaning.py": "the same",
    "policy/suspicion/corrections.py": "thumbs of public data",
    "policy/suspicion/joint_table.py": "joints of public tables",
    "policy/suspicion/orders.py": "what joints of public data look like",
    "policy/dataset/inspection.py": "joints of public files",
    "policy/lerobot/steps.py": "the steps of its converters",
    "wholebody/bench/reach_script.py": "the script that all peers run",
    "wholebody/bench/tick.py": "the same",
    "wholebody/collision/proximity.py": "pairs that placo watches of a G1",
    "wholebody/sim/cameras.py": "where a G1 has its cameras",
    "wholebody/sim/pictures/plot.py": "fingers of a recording, which has names only",
    "wholebody/verdict/report.py": "words for a body",
}
"""Files that may have names of the G1, and why."""


def names():
    spec = g1()
    return {*spec.joint_names, *(link.get("name") for link in read_urdf(spec).iter("link"))}


def strings(path):
    """String constants of a file that are no docstrings and no text: one word each."""
    tree = ast.parse(path.read_text())
    texts = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        is_code = isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in texts
        if is_code and node.value and " " not in node.value:
            yield node.value


def of_the_g1(path, known):
    """Strings of a file that are a name of the G1, or a part of one that begins or ends at an underscore."""
    found = set()
    for text in strings(path):
        part = text.startswith("_") or text.endswith(("_", "_joint", "_link"))
        if text in known or (
            part and len(text) > 5 and text not in ("_joint", "_link") and any(text in n for n in known)
        ):
            found.add(text)
    return found - {"pelvis", "left_arm_"}


@pytest.fixture(scope="module")
def found():
    known = names()
    files = [path for package in ("policy", "wholebody") for path in (ROOT / package).rglob("*.py")]
    return {str(path.relative_to(ROOT)): texts for path in files if (texts := of_the_g1(path, known))}


def test_no_limb_is_found_by_a_name_of_the_g1(found):
    assert {file: sorted(texts) for file, texts in found.items() if file not in ABOUT_THE_G1} == {}


def test_what_is_listed_still_has_such_a_name(found):
    assert sorted(set(ABOUT_THE_G1) - set(found)) == []


def test_the_check_finds_a_name_and_a_part_of_one(tmp_path):
    file = tmp_path / "x.py"
    file.write_text('"""Of left_knee_joint."""\nA = [n for n in N if n.startswith("waist_")]\nB = "left_knee_joint"\n')
    assert of_the_g1(file, names()) == {"waist_", "left_knee_joint"}
    file.write_text('A = robot.limbs["waist"]\nB = "the left_knee_joint is straight"\n')
    assert of_the_g1(file, names()) == set()
