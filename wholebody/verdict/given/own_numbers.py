"""The front door: judge and repair a chunk, or numbers of one's own in a layout that is named."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import LAYOUTS, as_spec
from policy.action_spec.codec import decode, encode
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.dataset.inspection import action_findings, settled, with_notes
from policy.errors import ChunkError
from policy.joints import layout_robot
from wholebody.config import ControllerConfig
from wholebody.episode.observation import observation_of
from wholebody.errors import InputError
from wholebody.planning.judgement.chunk_judge import Begin
from wholebody.types import RobotState, check_state
from wholebody.verdict.fast import FastChecker, checkers
from wholebody.verdict.input_steps import far_from_stance
from wholebody.verdict.repair import Change
from wholebody.verdict.verdict import Verdict

Numbers = ActionChunk | np.ndarray
"""A chunk, or raw actions (H, A) of a layout."""
Free = tuple[bool, bool]
"""Whether the orientation of the left and of the right palm is free."""


@dataclass(frozen=True)
class Given:
    """A chunk, its begin, and the layout and anchor of the numbers that it came as."""

    chunk: ActionChunk
    begin: Begin | None
    free: Free
    spec: ActionSpec | None = None
    anchor: Anchor | None = None


def judge(
    chunk: Numbers,
    state: RobotState | None = None,
    config: ControllerConfig | None = None,
    *,
    layout: ActionSpec | str | None = None,
    fps: float | None = None,
    scene: str = "floor",
    orientation_free: Free | None = None,
    ask_why: bool = False,
) -> Verdict:
    """Judge one chunk without simulating it: a function of its arguments alone, in as many threads as there are.

    Args:
        chunk: What the hands are to do: a chunk, or raw actions (H, A).
        state: Where the robot is and its feet stand, and what raw actions refer to; at rest with its hands at the
            chunk's first step, and the nominal stance, if not given.
        config: Of the robot and its controller.
        layout: What raw actions are: a name (`wholebody layouts` lists them) or a spec.
        fps: Steps a second of raw actions [Hz]; the layout's if not given.
        scene: What stands around it: a name of `models.scenes`, or a MuJoCo file (.xml).
        orientation_free: Whether the orientation of the left and of the right palm is free; as the layout says, or
            else it is asked for, if not given.
        ask_why: Look for causes where it is not feasible, which takes seconds.

    Raises:
        ChunkError: If the chunk is malformed.
        FileFormatError: If raw actions cannot be what the layout calls them.
        InputError: If the state is malformed, or there is no chunk and no layout.
    """
    with checkers.lend(config or ControllerConfig(), scene) as checker:
        given = as_given_chunk(checker, chunk, stands_in(checker, state), layout, fps, orientation_free)
        begin = given.begin
        notes: tuple[str, ...] = ()
        if begin is None:
            begin = checker.judge.first_pose(given.chunk)
            notes = far_from_stance(given.chunk, checker.spec, given.free)
        name = f"chunk {given.chunk.seq}"
        return checker.of_chunk(given.chunk, begin, name, given.free, notes=notes, ask_why=ask_why)


def repair(
    chunk: Numbers,
    state: RobotState | None = None,
    config: ControllerConfig | None = None,
    *,
    layout: ActionSpec | str | None = None,
    fps: float | None = None,
    scene: str = "floor",
    orientation_free: Free | None = None,
) -> Change | None:
    """Find the nearest chunk that is feasible: slowed down first, then its path bent by as little as does.

    What comes back is feasible when it is judged, played from where it is begun; raw actions are in ``actions`` of the
    change, in their own layout.

    Args:
        chunk: As in `judge`.
        state: As in `judge`.
        config: As in `judge`.
        layout: As in `judge`.
        fps: As in `judge`.
        scene: As in `judge`.
        orientation_free: As in `judge`.

    Returns:
        The change, with the chunk as changed; None if it would be another motion.

    Raises:
        ChunkError, FileFormatError, InputError: As in `judge`.
    """
    with checkers.lend(config or ControllerConfig(), scene) as checker:
        given = as_given_chunk(checker, chunk, stands_in(checker, state), layout, fps, orientation_free)
        change = checker.repairer(given.chunk, given.begin, given.free).repaired()
        if change is None or given.spec is None or given.anchor is None:
            return change
        try:
            actions = encode(given.spec, change.chunk, given.anchor)
            again = decode(given.spec, actions, given.anchor, t_obs=given.chunk.t_obs, fps=given.chunk.fps)
        except ChunkError:
            return None  # the layout has no numbers for it
        holds = checker.repairer(again, given.begin, given.free).lasts(again)
        return replace(change, actions=actions) if holds else None


def stands_in(checker: FastChecker, state: RobotState | None) -> tuple[RobotState | None, Begin | None]:
    """A state, checked, with the checker's feet where it has them, and the begin of chunks there; None if not given."""
    state = None if state is None else check_state(state, checker.spec.n_joints)
    checker.stand(state)
    return state, None if state is None else checker.judge.present(state)


def as_given_chunk(
    checker: FastChecker,
    chunk: Numbers,
    begun: tuple[RobotState | None, Begin | None],
    layout: ActionSpec | str | None,
    fps: float | None,
    free: Free | None,
) -> Given:
    """What is to be judged from a state that the checker `stands_in`."""
    robot, (state, begin) = layout_robot(checker.spec), begun
    if isinstance(chunk, ActionChunk):
        if layout is not None or fps is not None:
            raise InputError("layout and fps say what raw actions are; an ActionChunk has both already")
        chunk.validate(robot=robot)
        return Given(chunk, begin, free or (False, False))
    spec = as_spec(layout, robot)
    if spec is None:
        raise InputError(
            f"a {type(chunk).__name__} is no ActionChunk: say what its numbers are with layout=NAME, one of "
            f"{', '.join(LAYOUTS)}; `policy.ReplayPolicy.from_npz(path).episode` is the chunk of a file"
        )
    actions = _numbers(chunk)
    anchor, time = Anchor.nominal(robot=robot), 0.0
    if state is not None:
        anchor, time = Anchor.measured(observation_of(checker.spec, checker.judge.robot, state), robot), state.time
    decoded = decode(spec, actions, anchor, t_obs=time, fps=fps)
    notes = settled(action_findings(spec, actions, anchor, decoded.fps), (), "actions")
    return Given(with_notes(decoded, notes), begin, free or spec.orientation_free, spec, anchor)


def _numbers(values: object) -> np.ndarray:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"a {type(values).__name__} is no array (H, A) of numbers: {error}") from error
