"""The wheel: built from the source distribution that is built here, installed in an environment that has the
dependencies and nothing of this checkout, and used.

The dependencies are lent by a `.pth` file, so nothing is downloaded and the environment takes a second to make. The
locks are read as text: hashes everywhere, no host, the same versions in both.
"""

import re
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOCKS = ("core", "all")


def run(*command, cwd):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == 0, f"{command} ended with {done.returncode}:\n{done.stdout}\n{done.stderr}"
    return done.stdout


def shipped_files(folder):
    """Files of a source folder that belong in the wheel."""
    files = (path for path in (ROOT / folder).rglob("*") if path.is_file())
    return {str(path.relative_to(ROOT)) for path in files if "__pycache__" not in path.parts}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """What an index would hand out: the wheel of the source distribution, which has nothing else to be made of."""
    folder = tmp_path_factory.mktemp("wheel")
    build = (sys.executable, "-m", "hatchling", "build", "--directory", folder, "--target")
    run(*build, "sdist", cwd=ROOT)
    (archive,) = folder.glob("g1_wholebody-*.tar.gz")
    with tarfile.open(archive) as files:
        files.extractall(folder, filter="data")
    run(*build, "wheel", cwd=archive.with_name(archive.name.removesuffix(".tar.gz")))
    (path,) = folder.glob("g1_wholebody-*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """An environment with the wheel in it, and the path of its `bin`."""
    folder = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder)
    python = folder / "bin" / "python"
    install = (sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index")
    run(*install, "--disable-pip-version-check", wheel, cwd=folder)
    site = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder).strip())
    lent = sysconfig.get_path("purelib")
    # .pth files of a lent folder are not read: cmeel's, which adds Pinocchio's folder, is repeated here.
    (site / "lent.pth").write_text(f"{lent}\nimport cmeel_pth\n")
    return folder / "bin"


def test_the_wheel_holds_the_three_packages_and_nothing_else_at_its_top(wheel):
    tops = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    (metadata,) = [top for top in tops if top.endswith(".dist-info")]
    assert tops - {metadata} == {"wholebody", "policy", "models"}


def test_the_wheel_holds_every_file_of_the_packages_and_the_configs(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    expected = shipped_files("wholebody") | shipped_files("policy") | shipped_files("models")
    expected |= {f"wholebody/_{name}" for name in shipped_files("configs")}
    assert expected - names == set()
    assert any(name.startswith("models/scenes/") for name in names)
    assert any(name.startswith("wholebody/_configs/") for name in names)


def test_the_wheel_carries_the_licence_and_the_command(wheel):
    archive = zipfile.ZipFile(wheel)
    names = archive.namelist()
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)
    (entry_points,) = [name for name in names if name.endswith("entry_points.txt")]
    assert "wholebody = wholebody.cli.main:main" in archive.read(entry_points).decode()


def test_the_installed_packages_are_the_wheels_not_the_checkouts(installed, tmp_path):
    code = "import wholebody, policy, models; print(wholebody.__file__, policy.__file__, models.__file__)"
    for file in run(installed / "python", "-c", code, cwd=tmp_path).split():
        assert Path(file).is_relative_to(installed.parent)


def test_the_installed_package_finds_its_configs(installed, tmp_path):
    code = "from wholebody.resources import configs_folder as f; print(f()); print(*[p.name for p in f().iterdir()])"
    folder, names = run(installed / "python", "-c", code, cwd=tmp_path).splitlines()
    assert Path(folder).is_relative_to(installed.parent)
    assert set(names.split()) == {path.name for path in (ROOT / "configs").iterdir()}


def test_the_installed_command_runs(installed, tmp_path):
    assert "run" in run(installed / "wholebody", "--help", cwd=tmp_path)


def test_the_installed_packages_are_typed(installed, tmp_path):
    code = "import wholebody, policy, models; print(wholebody.__file__, policy.__file__, models.__file__)"
    files = run(installed / "python", "-c", code, cwd=tmp_path).split()
    assert all(Path(file).with_name("py.typed").exists() for file in files)


def test_the_version_is_in_the_changelog_and_its_page_is_one():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    page = (ROOT / "CHANGELOG.md").read_text().partition(f"## [{version}]")[2]
    assert 0 < len(page.partition("\n## ")[0].splitlines()) <= 60


def test_the_installed_robot_loads(installed, tmp_path):
    code = "from models import g1; from models.pinocchio_model import load_pinocchio; print(load_pinocchio(g1()).nv)"
    assert run(installed / "python", "-c", code, cwd=tmp_path).split()[-1] == "49"


def locked(name):
    """Package -> version of a lock."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text()
    return dict(re.findall(r"^([a-z0-9.-]+)==(\S+)", text, flags=re.MULTILINE))


@pytest.mark.parametrize("name", LOCKS)
def test_every_locked_file_has_a_hash_and_no_line_names_a_host(name):
    text = (ROOT / "requirements" / f"{name}.txt").read_text()
    assert "://" not in text
    entries = text.replace("\\\n", " ").splitlines()
    assert all(re.match(r"[a-z0-9.-]+==\S+ .*--hash=sha256:[0-9a-f]{64}", entry) for entry in entries)


def test_the_core_lock_is_a_part_of_the_other_and_has_no_torch():
    core, everything = locked("core"), locked("all")
    assert core.items() <= everything.items()
    assert not {"torch", "lerobot", "transformers"} & core.keys()
    assert {"torch", "lerobot", "pytest"} <= everything.keys()


def test_the_core_lock_has_only_what_the_main_job_uses():
    extras = {"imageio-ffmpeg", "matplotlib", "osqp", "piqp", "proxsuite", "jsonschema", "pyarrow", "k3d", "ray"}
    assert not extras & locked("core").keys()
    assert extras <= locked("all").keys()


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_can_install_the_project_without_build_isolation(name):
    assert {"hatchling", "uv"} <= locked(name).keys()


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_holds_every_dependency_and_keeps_the_pins(name):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = {re.match(r"[A-Za-z0-9-]+", line).group().lower() for line in project["dependencies"]}
    versions = locked(name)
    assert wanted <= versions.keys()
    pins = (ROOT / "requirements" / "pins.txt").read_text()
    for package, version in re.findall(r"^([a-z-]+)==(\S+)", pins, flags=re.MULTILINE):
        assert versions.get(package, version) == version
