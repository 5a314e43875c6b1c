"""The page in a process of its own: shows what loop and robot tell it, and tells the loop what a person does."""

from __future__ import annotations

import os
import signal
import socket
import sys
from collections.abc import Iterator, Sequence
from multiprocessing import get_context

import numpy as np

from wholebody.errors import InputError
from wholebody.live import pacing, wire
from wholebody.live.robot_process import World
from wholebody.live.snapshot import Snapshot, UserCommand

START_TIMEOUT = 600.0
"""Longest time until the page can be asked for [s]; chosen: on two cores that seven others share it takes more than
60 s."""


class PageProcess:
    """The loop's side of the page.

    Args:
        world: Where the robot stands.
        sources: Names that can be chosen; the first one runs.
        host: Address that the page is served at.
        port: Its port; the next free one if it is taken.
        controls: What people can do beside dragging its hands, some of `wholebody.live.panel.CONTROLS`.

    Raises:
        InputError: If it cannot be served, or the packages that it needs are missing.

    Attributes:
        address: Where it can be opened.
        robot_end: For the robot's process, which tells the page about the world.
    """

    def __init__(self, world: World, sources: list[str], host: str, port: int, controls: Sequence[str]) -> None:
        context = get_context("spawn")
        self._end, loop = wire.wire()
        self.robot_end, robot = wire.wire()
        here, there = context.Pipe()
        arguments = (loop, robot, there, world, sources, host, port, controls)
        self._process = context.Process(target=_main, args=arguments, name="page", daemon=True)
        self._process.start()
        for end in (loop, robot, there):
            end.close()
        try:
            answer = here.recv() if here.poll(START_TIMEOUT) else f"the page did not come up in {START_TIMEOUT:g} s"
        except EOFError:
            answer = "the page's process ended while it was loading"
        if isinstance(answer, str):
            self.close()
            raise InputError(answer)
        (self.address,) = answer

    def show(self, glance: Snapshot) -> None:
        """Show an instant; never waits."""
        wire.send(self._end, *glance.message())

    def wishes(self) -> Iterator[tuple[UserCommand, np.ndarray]]:
        """What people wanted since the last call; nothing once the page is gone."""
        try:
            for message in wire.messages(self._end):
                yield UserCommand(int(message[0])), message[1:]
        except EOFError:
            return

    @property
    def alive(self) -> bool:
        """Whether the page is still there."""
        return self._process.is_alive()

    def close(self) -> None:
        """End the page."""
        self._process.kill()
        self._process.join()


def _main(
    loop: socket.socket,
    robot: socket.socket,
    there: object,
    world: World,
    sources: list[str],
    host: str,
    port: int,
    controls: Sequence[str],
) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pacing.give_way()
    # Standard output is the command's; viser prints its address there.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    try:
        from wholebody.live.page import Page

        page = Page(world, sources, host, port, controls)
    except ImportError as error:
        there.send(f"the page needs the package {error.name}: pip install 'g1-wholebody[live]', or say --headless")
        return
    except (OSError, RuntimeError) as error:
        there.send(f"the page cannot be served at {host}:{port}: {error}")
        return
    there.send((page.address,))
    page.run(loop, robot)
