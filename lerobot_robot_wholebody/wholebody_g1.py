"""The balanced G1 as a robot of LeRobot: targets of wrists and fingers in, what they and the pelvis do out."""

from __future__ import annotations

import difflib
import math
from collections import deque
from functools import cached_property
from time import monotonic
from typing import TYPE_CHECKING, Any

from lerobot.robots import Robot

from lerobot_robot_wholebody import stage
from lerobot_robot_wholebody.config_wholebody_g1 import WholebodyG1Config

if TYPE_CHECKING:
    import numpy as np

    from lerobot_robot_wholebody.lerobot_loop import Loops
    from lerobot_robot_wholebody.sight import Cameras
    from lerobot_robot_wholebody.target import Accepted, Disturbance, Numbers
    from lerobot_robot_wholebody.tasks import RobotTask
    from wholebody.live.served.client import ServedRobot
    from wholebody.live.served.messages import Seen

AGAIN = 0.03
"""Time after which a part that an action leaves out is said again [s]; chosen: about a step, since a hand that is told
no more would go on as it went and then rest."""
TAKEN = 64
"""Targets that are remembered, to say at which one a robot stays whose gate holds the newest; derived: two seconds, and
a plan is judged within one."""


class WholebodyG1(Robot):
    """The G1, whose controller and simulation are beside this process.

    Args:
        config: Settings.

    Attributes:
        phase: What LeRobot does: ``run``, or while recording ``episode`` or ``reset``.
        phases: How many phases there were before the present one.
        report: Summary of the run, after `disconnect`.
        seen: What was seen last.
    """

    config_class = WholebodyG1Config
    name = "wholebody_g1"

    def __init__(self, config: WholebodyG1Config) -> None:
        super().__init__(config)
        self.config = config
        self.phase, self.phases, self.report = "run", 0, {}
        self._robot: ServedRobot | None = None
        self._cameras: Cameras | None = None
        self._loops: Loops | None = None
        self.seen: Seen | None = None
        self._accepted: Accepted | None = None
        self._disturbance: Disturbance | None = None
        self._said: dict[str, Any] = {}
        self._told: dict[str, float] = {}
        self._taken: deque[tuple[float, dict[str, float]]] = deque(maxlen=TAKEN)
        self.observation: dict[str, Any] = {}

    @cached_property
    def numbers(self) -> Numbers:
        """What the numbers of actions and observations mean."""
        from lerobot_robot_wholebody.target import Numbers

        return Numbers(self.config.tells_forces)

    @cached_property
    def task(self) -> RobotTask | None:
        """What is to be done."""
        from lerobot_robot_wholebody.tasks import task_of

        return task_of(self.config.task, self.config.seed)

    @property
    def scene(self) -> str:
        """Around the robot: the task's, where it has one."""
        return (self.task.scene if self.task else "") or self.config.scene

    @property
    def cameras(self) -> dict[str, Any]:
        """Cameras by name; LeRobot counts them."""
        return self.config.cameras

    @property
    def observation_features(self) -> dict[str, Any]:
        """Numbers of the state, goals of the task, pictures."""
        shown = (*self.numbers.state_names, *(self.task.names if self.task else ()))
        pictures = {name: (camera.height, camera.width, 3) for name, camera in self.cameras.items()}
        return dict.fromkeys(shown, float) | pictures

    @property
    def action_features(self) -> dict[str, type]:
        """Numbers of wrists and fingers, and of forces where they are told."""
        return dict.fromkeys(self.numbers.action_names, float)

    @property
    def is_connected(self) -> bool:
        """Whether the robot stands."""
        return self._robot is not None and self._robot.running

    @property
    def is_calibrated(self) -> bool:
        """Nothing is calibrated."""
        return True

    def calibrate(self) -> None:
        """Nothing is."""

    def configure(self) -> None:
        """Nothing is."""

    def connect(self, calibrate: bool = True) -> None:
        """Let the robot stand, everything loaded and compiled: the first step takes as long as any. All or nothing.

        Raises:
            ConnectionError: If it is connected.
            WholebodyError: If a setting is wrong, or processes do not come up.
        """
        from lerobot_robot_wholebody.lerobot_loop import Loops
        from lerobot_robot_wholebody.sight import Cameras
        from lerobot_robot_wholebody.target import Accepted, Disturbance
        from wholebody.live.served.client import ServedRobot
        from wholebody.live.served.messages import Served

        if self.is_connected:
            raise ConnectionError(f"{self} is connected already")
        stage.enter(self)
        config = self.config
        named = {"report": config.report, "gate": config.gate}
        robot = ServedRobot(Served(self.scene, "", config.settings, config.clock, **named))
        try:
            self._cameras = Cameras(self.scene, config.cameras, self.task.marks if self.task else 0)
            self.seen = robot.start()
            self._robot, self._usual = robot, self.seen.objects
            self._set_up()
            self._accepted = Accepted(self.numbers, self.seen.observation)
            self._disturbance = Disturbance(config.disturb, config.seed) if config.disturb else None
            self._observed()
            self.phase, self.phases, self._said = "run", 0, {}
            self._told = {}
            self._taken.clear()
            self._loops = Loops(self)
        except BaseException:
            self._end(robot)
            raise

    def get_observation(self) -> dict[str, Any]:
        """The newest state, and pictures of that moment.

        Raises:
            ConnectionError: If the robot is not connected.
            SimulationError: If its processes ended.
        """
        self._connected()
        self.seen, now = self._robot.see(), self.now()
        if self.rejected:
            followed = now - self.seen.observation.time + self.seen.followed
            while len(self._taken) > 1 and self._taken[-1][0] > followed:
                self._taken.pop()
            self._accepted.last = dict(self._taken[-1][1])
        return dict(self._observed())

    @property
    def rejected(self) -> bool:
        """Whether the gate rejected the last target, when the robot was seen last: it stays at the target before."""
        return self.seen.status[1] == "not_cleared"

    def _observed(self) -> dict[str, Any]:
        seen, task, now = self.seen, self.task, self.seen.observation
        self.observation = self.numbers.state(now)
        if task:
            self.observation |= task.shown(seen, self.numbers.anchor(now), self.numbers.palms(now))
        marks = task.in_world(self.numbers.anchor(now)) if task else []
        self.observation |= self._cameras.look(seen, marks)
        return self.observation

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Set the targets of wrists and fingers; a number that is left out keeps its last target.

        Numbers that are only observed are left aside, since LeRobot's way back to the first position says them too.

        Args:
            action: Any of the action's numbers; ``left_grasp.pos``, ``right_grasp.pos`` stand for a hand's fingers.

        Returns:
            The same numbers as they were accepted: fingers within their limits, rotations orthonormal. While the gate
            rejects a target, those of the last one that it did not: there the robot stays.

        Raises:
            ValueError: If a name is unknown or a number not finite or no rotation; nothing is taken then.
            ConnectionError: If the robot is not connected.
        """
        self._connected()
        given = self.checked(action)
        parts, said, accepted = self._accepted.take(given, self.seen.observation)
        now = self.now()
        if self.rejected and self._taken:
            accepted = {name: self._taken[-1][1].get(name, value) for name, value in accepted.items()}
        else:
            self._taken.append((now, dict(self._accepted.last)))
        if self._disturbance is not None:
            parts = self._disturbance.led(parts, now)
        for part, value in parts.items():
            if part in said or now - self._told.get(part, -math.inf) > AGAIN:
                self._said[part], self._told[part] = value, now
        if self.config.clock == "wall":
            self._say()
        return accepted

    def checked(self, action: dict[str, Any]) -> dict[str, float]:
        """Numbers of an action, known and finite.

        Raises:
            ValueError: If one is not.
        """
        return {name: self._number(name, value) for name, value in action.items()}

    def _number(self, name: str, value: object) -> float:
        known = self.numbers.known + (self.task.names if self.task else ())
        if name not in known:
            like = difflib.get_close_matches(str(name), known, 1)
            raise ValueError(f"'{name}' is no number of this robot{f'; did you mean {like[0]}?' if like else ''}")
        number = float(value)
        if not math.isfinite(number):
            raise ValueError(f"'{name}' is {number}; a finite number is expected, and nothing of the action was taken")
        return number

    def _say(self) -> None:
        if self._said:
            self._robot.put(**self._said)
            self._said = {}

    def executed(self) -> dict[str, float]:
        """Numbers of the action that is done where the robot was seen last, by name."""
        return self.numbers.executed(self.seen.observation, self.seen.forces)

    def now(self) -> float:
        """Present time: in lockstep what was let pass, else the wall's [s]."""
        # Rounded: ninety times a thirtieth of a second are three, and no step more.
        return round(self._robot.time, 9) if self.config.clock == "lockstep" else monotonic()

    def let_pass(self, seconds: float) -> None:
        """Let time pass in lockstep; LeRobot's own loops do it by their waiting.

        Raises:
            ValueError: On the wall clock, whose time passes by itself.
        """
        if self.config.clock != "lockstep":
            raise ValueError("time passes by itself on the wall clock; --robot.clock=lockstep lets it pass by the step")
        self._connected()
        self._say()
        if seconds > 0.0:
            self._robot.advance(seconds)

    def begin(self, phase: str) -> None:
        """A phase of a recording begins; goals change with the reset, for whoever teleoperates to see."""
        self.phase, self.phases = phase, self.phases + 1
        if phase == "reset" and self.task:
            self.task.next()
        if phase == "episode":
            self._set_up()

    def _set_up(self) -> None:
        """Put the task's things where they belong at the beginning."""
        objects = self.task.objects(self._usual) if self.task else None
        if objects is not None:
            self._robot.place(objects)
            self.seen = self._robot.see()

    @property
    def palms(self) -> np.ndarray:
        """Palm points in the stance when the robot was seen last, shape (2, 3), [m]."""
        return self.numbers.palms(self.seen.observation)

    def disconnect(self) -> None:
        """Lower the robot into a crouch that needs no controller, and end everything.

        Raises:
            ConnectionError: If the robot is not connected.
        """
        self._connected()
        self._end(self._robot)

    def _end(self, robot: ServedRobot) -> None:
        """Whatever there is of it."""
        loops, cameras, self._loops, self._cameras = self._loops, self._cameras, None, None
        try:
            self.report = robot.close()
        finally:
            self._robot = None
            if loops is not None:
                loops.leave()
            if cameras is not None:
                cameras.close()

    def _connected(self) -> None:
        if not self.is_connected:
            raise ConnectionError(f"{self} is not connected; call connect first")
