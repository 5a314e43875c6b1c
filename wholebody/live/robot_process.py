"""MuJoCo in a process of its own, at real speed: what a robot is to the control loop."""

from __future__ import annotations

import signal
import socket
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from time import monotonic
from typing import TYPE_CHECKING

import numpy as np

from models.spec import FLOOR_FRICTION, RobotSpec
from wholebody.config.description import describe
from wholebody.config.robot import RobotConfig
from wholebody.errors import SimulationError
from wholebody.live import pacing, wire
from wholebody.live.robot_link import Order
from wholebody.sim.fall import Fall, detect_fall
from wholebody.types import JointCommand, RobotState, Status

if TYPE_CHECKING:
    from wholebody.sim.plant import MujocoPlant

CATCH_UP = 0.05
"""Lag behind the wall clock that is made up for by stepping faster [s]; what is beyond is left out of the
motion; chosen: 25 periods."""
VIEWS_PER_S = 30.0
"""How often the page is shown the world [Hz]; chosen, as `wholebody.live.page.FPS`."""
MASS_MIN = 1e-4
"""Mass in a hand that is nothing to speak of [kg]; chosen: a tenth of a gram."""
START_TIMEOUT = 120.0
"""Longest time that loading the robot takes [s]; chosen, no trial is on record."""


@dataclass(frozen=True)
class World:
    """Robot and surroundings. Masses in its hands [kg] and the floor's friction as in `wholebody.sim.plant`."""

    robot: RobotSpec = field(default_factory=lambda: describe(RobotConfig()))
    scene: str = "floor"
    payload_kg: tuple[float, float] = (0.0, 0.0)
    friction: float = FLOOR_FRICTION


@dataclass(frozen=True)
class WorldView:
    """View of the world apart from the robot's configuration.

    Attributes:
        pressure: Centre of pressure of the soles (2,) [m]; None in the air.
        objects: Position and quaternion wxyz of the scene's bodies that move, shape (k, 7).
    """

    pressure: np.ndarray | None
    objects: np.ndarray

    @classmethod
    def of(cls, message: np.ndarray) -> WorldView:
        """The view in a message: load [N], centre of pressure, objects."""
        return cls(message[1:3] if message[0] > 0.0 else None, message[3:].reshape(-1, 7))


@dataclass
class RobotProcess:
    """The control loop's side of the robot, a `SessionRobot`.

    Args:
        world: Where it stands.
        control_dt: Time between two states [s].

    Attributes:
        origin: Instant of `time.monotonic` at which the robot's clock is 0 [s].
    """

    world: World
    control_dt: float
    origin: float = field(default=0.0, init=False)

    def start(self, page: socket.socket | None = None) -> RobotState:
        """Load the robot; it stands still until `go`. Answers its first state.

        Args:
            page: Where views of the world are shown.

        Raises:
            SimulationError: If its process does not come up.
        """
        context = get_context("spawn")
        self._end, other = wire.wire()
        self._orders, orders = context.Pipe()
        arguments = (other, page, orders, self.world, self.control_dt)
        self._process: BaseProcess = context.Process(target=_main, args=arguments, name="robot", daemon=True)
        self._process.start()
        other.close()
        orders.close()
        try:
            if not self._orders.poll(START_TIMEOUT):
                raise SimulationError(f"the robot's process did not come up in {START_TIMEOUT:g} s")
            answer = self._orders.recv()
        except EOFError:
            raise SimulationError("the robot's process ended while it was loading") from None
        if isinstance(answer, Exception):
            raise answer
        self._sizes = len(answer.q), len(answer.v)
        return answer

    def go(self, origin: float) -> None:
        """Let time run: the robot's clock is 0 at this instant of `time.monotonic` [s]."""
        self.origin = origin
        self._orders.send(origin)

    def receive(self, timeout: float) -> RobotState | None:
        """The newest state, waited for up to ``timeout`` [s]; None if none came.

        Raises:
            SimulationError: If the robot's process has ended.
        """
        try:
            message = wire.newest(self._end, timeout)
        except EOFError:
            raise SimulationError("the robot's process ended") from None
        return None if message is None else wire.state_of(message, *self._sizes)

    def send(self, command: JointCommand) -> None:
        """Command the motors."""
        wire.send(self._end, *wire.command_message(command))

    def order(self, order: Order) -> None:
        """Do something to the robot's world."""
        self._orders.send(order)

    def close(self) -> dict[str, float | str]:
        """End the process; how it kept time and why it fell, or nothing if it does not answer."""
        answer: dict[str, float | str] = {}
        try:
            self._orders.send(Order("end"))
            if self._orders.poll(2.0):
                answer = self._orders.recv()
        except (EOFError, OSError):
            pass
        self._process.join(2.0)
        if self._process.is_alive():
            self._process.kill()
        return answer


def _main(end: socket.socket, page: socket.socket | None, orders: Connection, world: World, control_dt: float) -> None:
    """The robot's process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    from wholebody.sim.plant import MujocoPlant

    try:
        # A mass in each hand that is next to nothing can be changed to another one later.
        left, right = (max(mass, MASS_MIN) if page else mass for mass in world.payload_kg)
        plant = MujocoPlant(
            world.robot, scene=world.scene, control_dt=control_dt, payload_kg=(left, right), friction=world.friction
        )
    except Exception as error:  # noqa: BLE001 - told to the other side, which ends with it
        orders.send(error)
        return
    orders.send(plant.state())
    origin = orders.recv()
    if isinstance(origin, float):
        pacing.keep_time()
        _Simulation(plant, end, page, orders, origin).run()


class _Simulation:
    """Steps a plant on the wall clock with the newest command; the first one makes it begin."""

    def __init__(
        self, plant: MujocoPlant, end: socket.socket, page: socket.socket | None, orders: Connection, origin: float
    ) -> None:
        self._plant, self._end, self._page, self._orders, self._origin = plant, end, page, orders, origin
        self._shown = 0.0
        self._command: JointCommand | None = None
        self._time = 0.0
        self._slipped = self._behind = 0.0
        self._busy: deque[float] = deque(maxlen=100_000)
        self._paused = False
        self._fall: Fall | None = None

    def run(self) -> None:
        """Step the robot until told to end, or until the other side is gone."""
        dt = self._plant.control_dt
        try:
            while not self._obeyed():
                pacing.wait_until(self._origin + self._time)
                begin = monotonic()
                lag = begin - self._origin - self._time
                self._behind = max(self._behind, lag)
                if lag > CATCH_UP:
                    lost = dt * round(lag / dt)
                    self._slipped, self._time = self._slipped + lost, self._time + lost
                self._tick()
                self._time += dt
                self._busy.append(monotonic() - begin)
        except EOFError:
            return
        busy = 1e3 * np.array(self._busy or [0.0])
        self._orders.send(
            {
                "behind_max_ms": 1e3 * self._behind,
                "slipped_ms": 1e3 * self._slipped,
                "step_p50_ms": float(np.median(busy)),
                "fall": "" if self._fall is None else self._fall.cause,
            }
        )

    def _tick(self) -> None:
        message = wire.newest(self._end)
        if message is not None:
            self._command = wire.command_of(message)
        if self._command is not None:
            self._plant.step(self._command)
        state = self._plant.state()
        self._fall = self._fall or detect_fall(self._plant, state, Status.TRACKING)
        wire.send(self._end, *wire.state_message(RobotState(self._time, state.q, state.v, state.tau)))
        if self._page is not None and self._time >= self._shown:
            self._shown = self._time + 1.0 / VIEWS_PER_S
            load, pressure = self._plant.foot_load()
            wire.send(self._page, load, pressure, self._plant.objects())

    def _obeyed(self) -> bool:
        """Obey an order; True if it is to end."""
        while self._paused or self._orders.poll(0.0):
            order = self._orders.recv()
            if order.what == "end":
                return True
            if order.what == "pause":
                self._paused = True
            elif order.what == "resume":
                self._paused, self._origin = False, self._origin + order.numbers[0]
            else:
                _DO[order.what](self._plant, order)
                if order.what == "reset":
                    self._command = self._fall = None
        return False


def _push(plant: MujocoPlant, order: Order) -> None:
    *force, duration = order.numbers
    plant.push(order.body, np.array(force), start=plant.data.time, duration=duration)


_DO: dict[str, Callable[[MujocoPlant, Order], object]] = {
    "push": _push,
    "payload": lambda plant, order: plant.hold(order.numbers),
    "friction": lambda plant, order: plant.set_friction(order.numbers[0]),
    "reset": lambda plant, _: plant.reset(),
}
