import runpy
from pathlib import Path


def test_the_ten_line_program_of_the_readme_runs_and_the_robot_stands(capsys):
    root = Path(__file__).parent.parent
    code = (root / "examples" / "compose.py").read_text()
    body = code.split('"""', 2)[2].strip()
    assert body in (root / "README.md").read_text()
    runpy.run_path(str(root / "examples" / "compose.py"))
    assert "fell: False" in capsys.readouterr().out
