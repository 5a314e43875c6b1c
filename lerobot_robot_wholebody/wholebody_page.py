"""Handles at the palms that a person drags in the browser."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from lerobot_robot_wholebody.config_teleoperators import WholebodyPageConfig
from lerobot_robot_wholebody.hands_teleoperator import Hands, HandsTeleoperator

if TYPE_CHECKING:
    import numpy as np

    from lerobot_robot_wholebody.wholebody_g1 import WholebodyG1
    from wholebody.live.page_process import PageProcess
    from wholebody.types import RobotState

logger = logging.getLogger(__name__)

HOST = "127.0.0.1"
"""Where the page is served: this computer alone."""
TIME_CONSTANT = 0.15
"""Time in which a hand goes two thirds of the way to its handle [s]; chosen: a handle that jumps moves no hand at once,
and one that is dragged leads by a few centimetres."""
SPEED_MAX = 0.5
"""Fastest that a hand goes to its handle [m/s]; chosen: as fast as a person drags with care."""


class WholebodyPage(HandsTeleoperator):
    """Hands follow the handles of a page, whose address is logged; fingers follow its sliders.

    Args:
        config: Settings.

    Attributes:
        address: Of the page, once it is there.
    """

    config_class = WholebodyPageConfig
    name = "wholebody_page"

    def connect(self, calibrate: bool = True) -> None:
        """Come; the page is there from the first action on, since it shows the robot's scene."""
        self._page: PageProcess | None = None
        self.address = ""
        super().connect(calibrate)

    def disconnect(self) -> None:
        """End the page."""
        if self._page is not None:
            self._page.close()
            self._page = None
        super().disconnect()

    def _meet(self, robot: WholebodyG1) -> None:
        """Open the page for this robot.

        Raises:
            InputError: If it cannot be served, or its packages are missing.
        """
        from models.pinocchio_model import load_pinocchio
        from wholebody.live.page_process import PageProcess
        from wholebody.live.robot_process import World
        from wholebody.live.snapshot import HANDS

        super()._meet(robot)
        if self._page is not None:
            self._page.close()
        spec = robot.numbers.spec.robot
        self._pin = load_pinocchio(spec)
        self._order = [spec.joint_names.index(name) for name in list(self._pin.names)[2:]]
        self._page = PageProcess(World(spec, robot.scene), [HANDS], HOST, self.config.port, ["hands"])
        self.address = self._page.address
        logger.warning("drag the hands at %s", self.address)
        self._state: RobotState | None = None

    def _begin(self, robot: WholebodyG1) -> None:
        self._asked, self._time = self.last, 0.0

    def _at(self, time: float) -> Hands:
        self._look()
        self._listen()
        dt, self._time = time - self._time, time
        return _towards(self.last, self._asked, dt)

    def _look(self) -> None:
        """Show the robot as it was seen last."""
        import numpy as np
        import pinocchio as pin

        from policy.geometry.rotations import matrix_to_quaternion
        from wholebody.live import wire
        from wholebody.live.snapshot import Snapshot
        from wholebody.sim.recorder import Followed
        from wholebody.types import Reason, RobotState, Status, StatusReport

        seen = self._robot.seen
        o, T = seen.observation, seen.observation.T_world_base
        joints = np.concatenate([o.q_body, o.q_lhand, o.q_rhand])[self._order]
        q = np.concatenate([T[:3, 3], matrix_to_quaternion(T[:3, :3], "xyzw"), joints])
        before, v = self._state, np.zeros(self._pin.nv)
        if before is not None and o.time > before.time:
            v = pin.difference(self._pin, before.q, q) / (o.time - before.time)
        if before is None or o.time != before.time:
            self._state = RobotState(o.time, q, v)
        status = StatusReport(Status(seen.status[0]), Reason(seen.status[1]) if seen.status[1] else None)
        asked = self._palm_poses(self._asked)
        followed = Followed(asked, self._palm_poses(self.last), status)
        wire.send(self._page.robot_end, 0.0, np.zeros(2), seen.objects)
        self._page.show(Snapshot(self._state, followed, np.full(self._pin.nq, np.nan), 0.0, 0, 0, 0))

    def _listen(self) -> None:
        """What the person did since."""
        from dataclasses import replace

        import numpy as np

        from policy.action_spec.hands import SIDES, grasp_posture
        from policy.chunk import ROTATION_TOLERANCE
        from policy.geometry.rotations import rotation_residual
        from wholebody.live.person import BOUNDS
        from wholebody.live.snapshot import UserCommand

        for wish, told in self._page.wishes():
            if not np.isfinite(told).all() or wish not in BOUNDS:
                continue
            numbers = np.clip(told, *BOUNDS[wish])
            if wish is UserCommand.CLOSING:
                spec = self._robot.numbers.spec.robot
                left, right = (grasp_posture(side, n, spec) for side, n in zip(SIDES, numbers, strict=True))
                self._asked = replace(self._asked, fingers=(left, right))
            elif wish is UserCommand.TARGETS:
                T = numbers.reshape(2, 4, 4)
                if rotation_residual(T[:, :3, :3]).max() <= ROTATION_TOLERANCE:
                    T = self._stance_from_world() @ T
                    self._asked = replace(self._asked, palms=T[:, :3, 3], R=T[:, :3, :3])

    def _stance_from_world(self) -> np.ndarray:
        from policy.geometry.se3 import inverse

        numbers = self._robot.numbers
        return inverse(numbers.anchor(self._robot.seen.observation).T_world_stance)

    def _palm_poses(self, hands: Hands) -> np.ndarray:
        """Palm poses in world, shape (2, 4, 4)."""
        import numpy as np

        from policy.geometry.se3 import inverse, make_transform

        return inverse(self._stance_from_world()) @ np.stack(list(map(make_transform, hands.R, hands.palms)))


def _towards(last: Hands, asked: Hands, dt: float) -> Hands:
    """Hands after a time [s] on their way from where they were told to be to where they are asked to be."""
    import numpy as np

    from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix

    share = 1.0 - np.exp(-dt / TIME_CONSTANT)
    way = share * (asked.palms - last.palms)
    far = np.linalg.norm(way, axis=1, keepdims=True)
    way *= np.minimum(1.0, SPEED_MAX * dt / np.maximum(far, 1e-9))
    turn = share * matrix_to_rotvec(asked.R @ np.swapaxes(last.R, 1, 2))
    left, right = (a + share * (b - a) for a, b in zip(last.fingers, asked.fingers, strict=True))
    return Hands(last.palms + way, rotvec_to_matrix(turn) @ last.R, (left, right))
