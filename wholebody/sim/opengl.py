"""What drawing needs: OpenGL libraries, and light to see by."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco

LIBRARIES = {"egl": "libegl1 libegl-mesa0 libgl1-mesa-dri libgl1", "osmesa": "libosmesa6"}
"""OpenGL back ends in the order they are tried, with the Debian packages they need."""


def lit(mj: mujoco.MjSpec) -> mujoco.MjSpec:
    """A bright sky and light from the camera, for looking at; physics does not change."""
    import mujoco

    mj.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.62, 0.72, 0.82),
        rgb2=(0.90, 0.93, 0.96),
        width=256,
        height=256,
    )
    floor = mj.texture("checker")
    floor.rgb1, floor.rgb2 = (0.62, 0.65, 0.68), (0.52, 0.55, 0.58)
    mj.visual.headlight.ambient, mj.visual.headlight.diffuse = (0.35, 0.35, 0.35), (0.45, 0.45, 0.45)
    mj.visual.headlight.specular = (0.1, 0.1, 0.1)
    return mj


def plain(renderer: mujoco.Renderer) -> mujoco.Renderer:
    """A renderer without shadows and reflections, which take five times as long on a processor."""
    import mujoco

    flags = renderer.scene.flags
    flags[mujoco.mjtRndFlag.mjRND_SHADOW] = flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
    return renderer
