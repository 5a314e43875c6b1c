"""States of the supervisor and of its next plan, and the one table of what moves them.

Supervisor, reflex, lowering and handover hold no state of their own: each tells a `Machine` what has happened and asks
it what is the case. docs/architecture.md draws the table, `tests/wholebody/execution/test_states.py` goes through it
row by row.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class State(Enum):
    """What the robot follows, up to `FALLEN`; what is becoming of its next plan, from `IDLE` on."""

    NEW = "new"
    HOLDING = "holding"
    FOLLOWING = "following"
    STANDING = "standing"
    RETURNING = "returning"
    LOWERING = "lowering"
    LOWERED = "lowered"
    RAISING = "raising"
    RISING = "rising"
    WALKING = "walking"
    RECOVERING = "recovering"
    DESCENDING = "descending"
    FALLEN = "fallen"
    IDLE = "idle"
    PLANNING = "planning"
    READY = "ready"


class Event(Enum):
    """What moves a state; the value says what has happened."""

    RESET = "`reset`: an episode begins"
    TAKEN_OVER = "a plan takes over"
    LOST = "the robot is off its plan"
    SPENT = "the robot is off its plan, and its waist cannot hold it there"
    NO_WAY = "no plan leads on from here"
    PLANNED_FROM = "a plan is asked for, and the waist can hold the robot here"
    LOWER = "`lower`"
    RAISE = "`raise_`"
    ARRIVED = "the robot has arrived, at rest"
    WALK_LOW = "`walk_to` or `walk` of a robot that leans, squats or reaches far"
    WALK = "`walk_to` or `walk` of a robot that is upright"
    PUSHED = "the capture point is beyond what soles that stand bring back, and a step does"
    SETTLED = "both feet stand where they are wanted"
    LOST_FOR_GOOD = "neither the soles nor a step can keep the robot from falling"
    FELL = "standing is lost"
    DOWN = "4 s of a descent are over"
    ASKED = "a chunk can be planned"
    CLEARED = "the plan comes, and is balanced"
    REFUSED = "no plan comes, or one that is not balanced, not quicker, or outrun by a newer chunk"
    LATE = "the plan comes after its time, or had too little of it to be safe or near the chunk"
    DUE = "the robot is where the plan begins"
    MISSED = "the robot has not come there 0.1 s after the plan's time"
    CANCELLED = "the robot leaves its plan, is lowered, has fallen or is not seen"


OFF_PLAN = (State.STANDING, State.RETURNING, State.LOWERING, State.LOWERED, State.RAISING, State.RISING)
"""States in which the reflex says what is followed: no plan is."""
ENDING = (State.LOWERING, State.LOWERED, State.RAISING)
"""States in which no chunk is accepted: the robot goes into its crouch, or out of it."""

STEPPING = (State.WALKING, State.RECOVERING)
"""States in which a walk says what is followed."""


@dataclass(frozen=True)
class Transition:
    """One row of the table.

    Attributes:
        states: In which of these it happens.
        event: What happens.
        next: State that follows.
        does: What the robot, or the supervisor, does then.
    """

    states: tuple[State, ...]
    event: Event
    next: State
    does: str


_ON_A_WAY = (State.HOLDING, State.STANDING, State.RETURNING)
_ON_BOTH_FEET = (*_ON_A_WAY, State.FOLLOWING, State.LOWERING, State.LOWERED, State.RAISING, State.RISING)
_UP = (*_ON_BOTH_FEET, State.WALKING, State.RECOVERING)

TABLE = (
    Transition(
        (State.NEW, *_UP, State.DESCENDING, State.FALLEN), Event.RESET, State.HOLDING, "holds the pose that it is in"
    ),
    Transition(
        (*_ON_A_WAY, State.FOLLOWING), Event.TAKEN_OVER, State.FOLLOWING, "follows the plan from where the robot is"
    ),
    Transition((State.FOLLOWING,), Event.LOST, State.STANDING, "comes to rest where it is, hands let go of"),
    Transition((State.FOLLOWING,), Event.SPENT, State.RETURNING, "goes towards its stance at once, hands let go of"),
    Transition(_ON_A_WAY, Event.NO_WAY, State.RETURNING, "goes slowly to its stance, if it is not in it"),
    Transition((State.RETURNING,), Event.PLANNED_FROM, State.STANDING, "comes to rest: the plan begins there"),
    Transition(_ON_BOTH_FEET, Event.LOWER, State.LOWERING, "goes into its crouch; chunks are refused"),
    Transition(_ON_BOTH_FEET, Event.RAISE, State.RAISING, "goes to its stance; chunks are refused"),
    Transition((State.LOWERING,), Event.ARRIVED, State.LOWERED, "stiffens its legs: the last command may be kept"),
    Transition((State.RAISING,), Event.ARRIVED, State.HOLDING, "holds its stance; chunks are taken"),
    Transition(
        (State.HOLDING, State.FOLLOWING), Event.WALK_LOW, State.RISING, "goes to its stance first, hands let go of"
    ),
    Transition((State.HOLDING, State.FOLLOWING, State.RISING), Event.WALK, State.WALKING, "steps, hands carried along"),
    Transition(
        (*_ON_A_WAY, State.FOLLOWING, State.WALKING), Event.PUSHED, State.RECOVERING, "steps at once, hands let go of"
    ),
    Transition(
        (State.WALKING, State.RECOVERING),
        Event.SETTLED,
        State.HOLDING,
        "stands there; the chunk, if it is not over, is planned anew",
    ),
    Transition(_UP, Event.LOST_FOR_GOOD, State.DESCENDING, "folds, braking, head and hands off the floor or slow"),
    Transition((State.DESCENDING,), Event.DOWN, State.FALLEN, "damps its joints until `reset`"),
    Transition(_UP, Event.FELL, State.FALLEN, "damps its joints until `reset`"),
    Transition(
        (State.IDLE,), Event.ASKED, State.PLANNING, "computes the plan beside the loop, to begin one lead ahead"
    ),
    Transition((State.PLANNING,), Event.CLEARED, State.READY, "keeps the plan until the robot is where it begins"),
    Transition(
        (State.PLANNING,), Event.REFUSED, State.IDLE, "says why, and goes on with the plan before, if there is one"
    ),
    Transition((State.PLANNING,), Event.LATE, State.IDLE, "drops the plan, doubles the lead, asks for the chunk again"),
    Transition((State.READY,), Event.DUE, State.IDLE, "hands the plan over"),
    Transition((State.READY,), Event.MISSED, State.IDLE, "drops the plan, asks for the chunk again"),
    Transition((State.PLANNING, State.READY), Event.CANCELLED, State.IDLE, "drops the plan"),
)
"""Every move there is; what happens in another state moves nothing."""

_NEXT = {(state, row.event): row.next for row in TABLE for state in row.states}


class Machine:
    """One state that moves by the table.

    Args:
        first: State to begin with.

    Attributes:
        now: Present state.
    """

    def __init__(self, first: State) -> None:
        self.now = first

    def on(self, event: Event) -> None:
        """Move as the table has it; an event that it does not have for the present state moves nothing."""
        self.now = _NEXT.get((self.now, event), self.now)
