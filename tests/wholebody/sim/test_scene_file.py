"""Strategy: scenes as a user and as an attacker would write them, read by the common readers and compiled by MuJoCo."""

import os
import struct

import numpy as np
import pytest

from models import g1
from models.spec import RobotSpecError
from tests.support.hostile_files import SCENE, write_scene
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.scene_file import scene_of


@pytest.fixture
def scene(tmp_path):
    write_scene(tmp_path)
    return tmp_path / "scene.xml"


def world_of(body):
    return f"<mujoco><worldbody>{body}</worldbody></mujoco>"


def test_c5_a_scene_from_a_file_stands_around_the_robot_where_the_file_has_it(scene):
    plant = MujocoPlant(g1(), scene=str(scene))
    model, data = plant.model, plant.data
    assert len(plant.objects()) == 3
    np.testing.assert_allclose(plant.objects()[0], [0.5, 0.3, 1.1, np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], atol=1e-9)
    assert data.joint("scene_hinge").qpos == pytest.approx(np.deg2rad(10.0))
    assert model.geom("scene_wall").pos == pytest.approx([0.6, 0.0, 0.5])
    assert [plant.is_robot(name) for name in ("scene_ball", "pelvis")] == [False, True]
    # One floor, that of the robot, and the robot as it is without a scene.
    alone = MujocoPlant(g1())
    assert sum(model.geom_type == 0) == 1
    np.testing.assert_array_equal(plant.state().q, alone.state().q)
    assert model.nu == alone.model.nu
    assert model.opt.timestep == alone.model.opt.timestep


def test_c5_the_robot_touches_what_is_in_the_file(tmp_path):
    (tmp_path / "s.xml").write_text(world_of('<geom name="post" type="box" size=".05 .05 .5" pos="0.3 0.2 0.5"/>'))
    plant = MujocoPlant(g1(), scene=str(tmp_path / "s.xml"))
    assert any("world" in pair and "left" in "".join(pair) for pair in plant.contacts())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (world_of('<include file="../g1.xml"/>'), "has <include>; bodies and geoms .* nothing is included"),
        ("<mujoco><extension><plugin plugin='mujoco.sdf.gear'/></extension></mujoco>", "has <extension>"),
        (world_of('<geom type="sdf" plugin="p"/>'), r"has <geom plugin=\.\.\.>, which is not taken"),
        ("<mujoco><option timestep='1'/></mujoco>", "has <option>"),
        (world_of('<replicate count="1000000000"><geom size="1"/></replicate>'), "has <replicate>"),
        ('<!DOCTYPE m [<!ENTITY a "b">]><mujoco/>', "declares a document type"),
        (world_of('<geom size="1e300"/>'), r"has <geom size=\.\.\.> with 1e300; finite numbers up to 1e\+06 are taken"),
        (world_of('<geom size="nan"/>'), "with nan; finite numbers"),
        ('<mujoco><asset><texture builtin="flat" width="100000" height="9"/></asset></mujoco>', "up to 4096 are taken"),
        ('<mujoco><asset><mesh builtin="sphere" params="30"/></asset></mujoco>', r"has <mesh builtin=\.\.\.>"),
        (
            '<mujoco><asset><mesh file="../../x.stl"/></asset></mujoco>',
            "names the file '../../x.stl', which is not in its",
        ),
        ('<mujoco><asset><mesh file="/etc/hostname"/></asset></mujoco>', "which is not in its folder"),
        (
            '<mujoco><compiler meshdir="/etc"/><asset><mesh file="x.stl"/></asset></mujoco>',
            "which is not in its folder",
        ),
        ('<mujoco><asset><mesh file="scene.xml"/></asset></mujoco>', ".obj, .stl, .png are read"),
        ('<mujoco><asset><mesh file="none.stl"/></asset></mujoco>', "cannot be read: No such file"),
        (world_of("<geom/>" * 3000), "has more than 2000 elements"),
        (world_of("<body>" * 100), "more than 32 in each other"),
        (
            world_of('<geom type="plane" size="0 0 1" pos="0 0 0.2"/>'),
            "has the plane ''; a level floor at z = 0 is there",
        ),
        (world_of('<geom type="plane" size="0 0 1" euler="0 9 0"/>'), "a level floor at z = 0 is there"),
        (world_of('<geom size="-1"/>'), "is refused by MuJoCo: "),
        ("<mujoco>", "is no XML: no element found"),
        (" " * (2**20 + 1), "at most 1048576 are read"),
    ],
)
def test_c5_what_a_scene_does_not_have_is_refused_in_one_sentence(scene, text, says):
    scene.write_text(text)
    with pytest.raises(RobotSpecError, match=says) as refusal:
        MujocoPlant(g1(hands=False), scene=str(scene))
    assert str(refusal.value).startswith(f"scene '{scene}' ")
    assert str(refusal.value).isprintable()


def test_c5_only_regular_files_within_the_folder_are_opened(scene, tmp_path):
    wedge, outside = tmp_path / "meshes" / "wedge.obj", tmp_path.parent / "outside.obj"
    wedge.rename(outside)
    for make, says in (
        (lambda: os.mkfifo(wedge), "which is a pipe"),
        (lambda: wedge.symlink_to(outside), "not in its folder"),
        (lambda: wedge.symlink_to(wedge), "leads nowhere"),
    ):
        wedge.unlink(missing_ok=True)
        make()
        with pytest.raises(RobotSpecError, match=says):
            scene_of(str(scene))


def test_c5_a_picture_that_unpacks_to_gigabytes_is_refused_by_its_header(tmp_path):
    (tmp_path / "big.png").write_bytes(
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">IIB", 40_000, 40_000, 8) + bytes(64)
    )
    (tmp_path / "s.xml").write_text('<mujoco><asset><texture name="t" type="2d" file="big.png"/></asset></mujoco>')
    with pytest.raises(RobotSpecError, match=r"picture 'big\.png' of 40000 x 40000 pixels; 1 to 4096 are read"):
        scene_of(str(tmp_path / "s.xml"))


def test_a_scene_of_this_package_is_a_name():
    assert scene_of("table") == "table"
    assert "wedge.obj" in SCENE
