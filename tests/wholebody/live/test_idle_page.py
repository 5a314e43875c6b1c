"""Strategy: pictures of the page are counted while a robot moves, while it stands still, and while nobody looks."""

import threading
import time

import numpy as np
import pytest

from models.pinocchio_model import load_pinocchio, stance_q
from tests.support.page_watcher import PageWatcher
from wholebody.live import wire
from wholebody.live.page import FPS_AT_REST, Page
from wholebody.live.robot_process import World
from wholebody.live.snapshot import Snapshot
from wholebody.sim.recorder import Followed
from wholebody.types import RobotState, Status, StatusReport

MESSAGES = 60


@pytest.fixture
def shown():
    """Page, what tells it of the robot, and the times at which it drew."""
    page, drawn = Page(World(), ["wave"], "127.0.0.1", 0, ["hands"]), []
    show, (loop, ours), (robot, theirs) = page._show, wire.wire(), wire.wire()
    page._show = lambda *what: (drawn.append(time.monotonic()), show(*what))[1]
    thread = threading.Thread(target=page.run, args=(loop, robot), daemon=True)
    thread.start()
    wire.send(theirs, 300.0, 0.0, 0.0)

    def tell(swing):
        """Tell of a robot for a while; how many pictures were drawn of it, and in what time."""
        model, before, begin = load_pinocchio(World().robot), len(drawn), time.monotonic()
        q, palms = stance_q(World().robot, model), np.tile(np.eye(4), (2, 1, 1))
        followed = Followed(None, palms, StatusReport(Status.TRACKING), 1.0, 0.0)
        for i in range(MESSAGES):
            q[-1] = swing * np.sin(0.3 * i)
            state = RobotState(0.03 * i, q.copy(), np.zeros(model.nv), None)
            wire.send(ours, *Snapshot(state, followed, np.full(model.nq, np.nan), 0.0, 0, 0, 0).message())
            time.sleep(0.03)
        return len(drawn) - before, time.monotonic() - begin

    yield page, tell
    ours.close()
    theirs.close()
    thread.join()


def test_a_page_draws_what_moves_little_of_what_stands_and_nothing_for_nobody(shown):
    page, tell = shown
    assert tell(0.5)[0] == 0
    with PageWatcher(page.address):
        while not page._door.visitors:
            time.sleep(0.01)
        still, seconds = tell(0.0)
        assert 1 <= still <= FPS_AT_REST * seconds + 2
        moving, _ = tell(0.5)
        assert moving >= still
