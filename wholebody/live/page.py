"""The page in the browser: the robot, where its palms are to be, how it stands, and what a person can do to it.

It draws what `wholebody.sim.pictures.scene` says there is to see.
"""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Sequence
from select import select
from time import monotonic

import mujoco
import numpy as np
import pinocchio as pin
import viser

from models.conversion import Conversion
from models.moving_bodies import moving_joints, put
from models.mujoco_model import load_mujoco
from models.pinocchio_model import load_pinocchio, palm_frame_ids, stance_q
from models.spec import RobotSpec
from policy.geometry.rotations import matrix_to_quaternion, quaternion_to_matrix
from wholebody.live import wire
from wholebody.live.door import Door
from wholebody.live.marks import Marks
from wholebody.live.panel import LINES_PER_S, SIDES, SidePanel
from wholebody.live.robot_process import World, WorldView
from wholebody.live.snapshot import HANDS, Snapshot, UserCommand
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.robot.support_polygon import SupportPolygon, convex_polygon
from wholebody.sim.pictures.meshes import Part, parts
from wholebody.sim.pictures.scene import Scene
from wholebody.types import Reason

FPS = 30.0
"""Pictures a second [Hz]; chosen: what a browser shows smoothly."""
FPS_AT_REST = 4.0
"""Pictures a second of a robot that does not move [Hz]; chosen: a browser without a graphics card draws all the time
otherwise."""
MOVED_VISIBLY = 2e-4
"""Change of a coordinate from which the robot has moved since the last picture [rad, m]; chosen: a third of a pixel."""
GHOST_OPACITY = 0.25
"""Opacity of the robot where its plan ends, a share; chosen."""
LIFTED = 0.01
"""Height of a sole over the other one from which it carries nothing [m]; chosen: a fifth of a step's."""


class Page:
    """Serves the page.

    Args:
        world: Where the robot stands.
        sources: Names that can be chosen.
        host, port: Where it is served.
        controls: What people can do beside dragging its hands, some of `wholebody.live.panel.CONTROLS`.

    Attributes:
        address: Where it can be opened, with the token without which it cannot.
    """

    def __init__(self, world: World, sources: list[str], host: str, port: int, controls: Sequence[str]) -> None:
        spec = world.robot
        self._spec, self._pin = spec, load_pinocchio(spec)
        self._pin_data = self._pin.createData()
        self._model = load_mujoco(spec, scene=world.scene)
        self._moving = moving_joints(self._model)
        self._data = mujoco.MjData(self._model)
        mujoco.mj_resetDataKeyframe(self._model, self._data, 0)
        mujoco.mj_forward(self._model, self._data)
        self._conversion = Conversion(spec, self._pin, self._model)
        self._palms = palm_frame_ids(spec, self._pin)
        self._sources, self._wishes = sources, deque()
        self._door = Door(host)
        with self._door.guarding():
            self._server = viser.ViserServer(host=host, port=port, label="wholebody live", verbose=False)
        shown = f"[{host}]" if ":" in host else host
        self.address = f"http://{shown}:{self._server.get_port()}/{self._door.token}"
        self._draw_world(parts(spec, world.scene))
        # What is seen until the loop runs.
        stance = stance_q(spec, self._pin)
        self._place(self._frames, stance, np.zeros((0, 7)))
        self._make_handles()
        pin.framesForwardKinematics(self._pin, self._pin_data, stance)
        self._hold(np.array([self._pin_data.oMf[frame].homogeneous for frame in self._palms]))
        self._panel = SidePanel(self._server.gui, self._door, sources, self._wishes.append, controls)

    def _draw_world(self, bodies: list[Part]) -> None:
        """Meshes of robot and scene, each below a frame that follows its body; and the same as a ghost."""
        scene = self._server.scene
        scene.set_up_direction("+z")
        grey = {"cell_color": (70, 70, 70), "section_color": (95, 95, 95)}
        scene.add_grid("/floor", width=4.0, height=4.0, plane="xy", cell_size=0.25, shadow_opacity=0.2, **grey)
        self._server.initial_camera.position, self._server.initial_camera.look_at = (1.4, 0.95, 1.15), (0.1, 0.0, 0.65)
        self._frames, self._ghost, self._ghost_at = {}, {}, np.zeros(0)
        self._planned = scene.add_frame("/ghost", show_axes=False, visible=False)
        for part in bodies:
            for prefix, frames, opacity in (("/robot", self._frames, None), ("/ghost", self._ghost, GHOST_OPACITY)):
                if opacity and not part.robot:
                    continue
                if part.body not in frames:
                    frames[part.body] = scene.add_frame(f"{prefix}/{part.body}", show_axes=False)
                name = f"{prefix}/{part.body}/{part.name}"
                colour = part.colour if opacity is None else (80, 140, 230)
                scene.add_mesh_simple(
                    name,
                    part.vertices,
                    part.faces,
                    color=colour,
                    opacity=opacity,
                    side="double",
                    cast_shadow=not opacity,
                )
        self._marks = Marks(scene)

    def _make_handles(self) -> None:
        """A handle at each palm; dragging one makes the hands follow it."""
        self._handles, self._dragging = [], set()
        for side in SIDES:
            handle = self._server.scene.add_transform_controls(f"/handle/{side}", scale=0.16, line_width=3.0)
            self._handles.append(handle)
            self._door.handles.add(f"/handle/{side}")

            @handle.on_update
            async def _(event: object, side: str = side) -> None:
                (self._dragging.discard if event.phase == "end" else self._dragging.add)(side)
                self._wishes.append((UserCommand.TARGETS, *self._targets().ravel()))

    def _targets(self) -> np.ndarray:
        """Poses of the handles, shape (2, 4, 4)."""
        T = np.tile(np.eye(4), (2, 1, 1))
        for i, handle in enumerate(self._handles):
            T[i, :3, :3] = quaternion_to_matrix(np.array(handle.wxyz), "wxyz")
            T[i, :3, 3] = handle.position
        return T

    def run(self, loop: socket.socket, robot: socket.socket) -> None:
        """Show what comes until the loop is gone."""
        nq, nv = self._pin.nq, self._pin.nv
        view, shown, drawn, seen = None, -np.inf, -np.inf, np.full(nq, np.inf)
        while True:
            select([loop, robot], [], [], 0.02)
            try:
                while self._wishes:
                    wire.send(loop, *self._wishes.popleft())
                world = wire.newest(robot)
                view = WorldView.of(world) if world is not None else view
                message = wire.newest(loop)
            except EOFError:
                return
            now = monotonic()
            if message is None or view is None or now - shown < 0.8 / FPS or not self._door.visitors:
                continue
            glance = Snapshot.of(message, nq, nv)
            at_rest = np.abs(glance.state.q - seen).max() < MOVED_VISIBLY and not self._dragging
            if at_rest and now - shown < 1.0 / FPS_AT_REST:
                continue
            shown, seen = now, glance.state.q
            with self._server.atomic():
                scene = self._show(glance, view)
                if now - drawn >= 1.0 / LINES_PER_S:
                    drawn = now
                    self._panel.tell(glance, scene)
            self._server.flush()

    def _show(self, glance: Snapshot, view: WorldView) -> Scene:
        state = glance.state
        self._place(self._frames, state.q, view.objects)
        support = _support(self._spec, self._data)
        planned = bool(np.isfinite(glance.planned).all())
        # Every frame that is placed costs a message, and a plan stays for many pictures.
        if planned and not np.array_equal(glance.planned, self._ghost_at):
            self._place(self._ghost, glance.planned, view.objects)
            self._ghost_at = glance.planned
        self._planned.visible = planned
        pin.centerOfMass(self._pin, self._pin_data, state.q, state.v)
        pin.updateFramePlacements(self._pin, self._pin_data)
        com, velocity = self._pin_data.com[0].copy(), self._pin_data.vcom[0]
        capture = com[:2] + velocity[:2] / natural_frequency(com[2])
        followed, status = glance.followed, glance.followed.status
        scene = Scene(
            time=state.time,
            q=state.q,
            objects=view.objects,
            asked=followed.asked,
            commanded=followed.commanded,
            measured=np.array([self._pin_data.oMf[frame].homogeneous for frame in self._palms]),
            support=support,
            pressure=view.pressure,
            com=com,
            capture_point=capture,
            status=status.status,
            reason=status.reason,
            rate=followed.rate,
        )
        self._marks.show(scene.marks())
        led = self._sources[glance.source] != HANDS or status.reason is Reason.WALKING
        if led and not self._dragging:
            self._hold(followed.commanded)
        return scene

    def _hold(self, palms: np.ndarray) -> None:
        """Put the handles at palm poses (2, 4, 4)."""
        for handle, T in zip(self._handles, palms, strict=True):
            handle.position, handle.wxyz = T[:3, 3], matrix_to_quaternion(T[:3, :3], "wxyz")

    def _place(self, frames: dict[str, object], q: np.ndarray, objects: np.ndarray) -> None:
        """Put the frames of all bodies where they are in a configuration."""
        data = self._data
        self._conversion.to_mujoco(q, np.zeros(self._pin.nv), data.qpos, data.qvel)
        put(self._model, data.qpos, self._moving[: len(objects)], objects)
        mujoco.mj_kinematics(self._model, data)
        for name, frame in frames.items():
            body = data.body(name)
            frame.position, frame.wxyz = body.xpos.copy(), body.xquat.copy()


def _support(spec: RobotSpec, data: mujoco.MjData) -> SupportPolygon:
    """Where the robot stands: the outline of its soles, without one that is lifted."""
    bodies = [(foot, data.body(foot.frame)) for foot in spec.feet]
    soles = [body.xpos + foot.points @ body.xmat.reshape(3, 3).T for foot, body in bodies]
    floor = min(sole[:, 2].min() for sole in soles)
    return convex_polygon(np.vstack([sole for sole in soles if sole[:, 2].min() < floor + LIFTED])[:, :2])
