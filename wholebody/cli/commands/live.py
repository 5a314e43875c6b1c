"""``wholebody live``: the loop on the wall clock."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from wholebody.cli.console import check_places, say, waiting, write_text
from wholebody.cli.options import SOURCES, Input, JsonTo, RobotModel, Sampling, completed_script

if TYPE_CHECKING:
    from wholebody.config import ControllerConfig

CONTROLS = dict.fromkeys(("never", "recover"), ("run", "disturb")) | {"reach": ("run", "walk", "disturb")}
"""What the page has, of `wholebody.live.panel.CONTROLS`, by the `steps` of the settings."""
LINE_EVERY = 1.0
"""Time between two lines on the terminal [s]; chosen, no trial is on record."""


@dataclass(frozen=True)
class StatusLine:
    """Where the page is."""

    headless: Annotated[bool, Option("--headless", help="No page; runs the first source.")] = False
    host: Annotated[str, Option(help="Address of the page; others than this computer see 0.0.0.0.")] = "127.0.0.1"
    port: Annotated[int, Option(help="Port of the page; the next free one if it is taken.")] = 8080


@dataclass(frozen=True)
class Around:
    """Scene, robot, settings and gate of a run on the wall clock."""

    scene: Annotated[str, Option(help="Around the robot: floor, table, ... or a MuJoCo file.")] = "floor"
    robot: RobotModel = ""
    config: Annotated[Path | None, Option("--config", help="YAML file with changed settings.")] = None
    hold: Annotated[float, Option(help="Seconds of standing after the last step.")] = 4.0
    replace_every: Annotated[int, Option(help="Steps of a chunk after which the next one is asked for.")] = 25
    gate: Annotated[
        bool,
        Option("--gate", help="Judge each chunk by its plan; reject what cannot be done nearly as given."),
    ] = False


def live(
    *,
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            help=f"{SOURCES} Several can be chosen from on the page; the first one runs. If none is given: hands that "
            "are dragged on the page.",
            autocompletion=completed_script,
        ),
    ] = None,
    shown: StatusLine,
    given: Input,
    around: Around,
    sampling: Sampling,
    json_to: JsonTo = "",
) -> None:
    """Run the loop on the wall clock, with a page to see it.

    MuJoCo, planner and policy are beside it; the page can disturb the robot. Exit code 1 after a fall.
    """
    from policy.executor.executor import ExecutorConfig
    from policy.joints import layout_robot
    from policy.scripted.library import scripts_of
    from policy.targets.dragged_hands import DraggedHands
    from wholebody.cli.simulated import check_times
    from wholebody.cli.sources import length, opened, require_blind
    from wholebody.config.description import describe
    from wholebody.live.page_process import PageProcess
    from wholebody.live.robot_process import RobotProcess, World
    from wholebody.live.session import Session, SessionConfig
    from wholebody.live.snapshot import HANDS
    from wholebody.verdict.chunk_gate import gate_of

    check_times(given.duration, around.hold)
    check_places(json_to)
    settings = _settings(around)
    named = sources or (["wave"] if shown.headless else [])
    policies = {name: opened(name, given, settings.robot, **sampling.choices()) for name in named}
    require_blind(policies, "live")
    seconds = length(policies[named[0]], given.duration) if shown.headless else given.duration or None
    asking, world = ExecutorConfig(replace_every=around.replace_every), World(describe(settings.robot), around.scene)
    quiet, page, drives = json_to == "-", None, layout_robot(world.robot)
    with waiting("loading the robot and the planner, compiling if it is the first time", quiet):
        if not shown.headless:
            others = {name: opened(name, given, settings.robot) for name in scripts_of(drives) if name not in policies}
            policies |= {HANDS: DraggedHands(robot=drives)} | others
            page = PageProcess(world, list(policies), shown.host, shown.port, CONTROLS[settings.steps])
        about = SessionConfig(duration=seconds, hold=around.hold, task=given.task)
        free = {policy.spec.id: policy.spec.orientation_free for policy in policies.values()}
        gate = partial(gate_of, settings, free, around.scene) if around.gate else None
        session = Session(settings, RobotProcess(world, settings.dt), about, page, gate)
    if page is not None:
        say(f"{page.address} shows the robot; Ctrl-C ends it", to_errors=True)
    try:
        session.run(policies, _nothing if quiet else _Lines(session), asking)
    finally:
        robot = session.close()
        if page is not None:
            page.close()
    _tell(session.summary(), robot, json_to, quiet=quiet)


def _settings(around: Around) -> ControllerConfig:
    """Settings of the file, for the robot asked for."""
    from wholebody.config import ControllerConfig
    from wholebody.config.file import load_config

    settings = load_config(around.config) if around.config else ControllerConfig()
    return replace(settings, robot=replace(settings.robot, model=around.robot or settings.robot.model))


def _tell(summary: dict, robot: dict, json_to: str, *, quiet: bool) -> None:
    """The end of a run, as JSON and in words.

    Raises:
        Exit: With code 1 after a fall.
    """
    # The loop knows of lost standing, the robot's world of what touches the floor.
    summary |= {"robot": robot, "fell": summary["fell"] or bool(robot.get("fall"))}
    if json_to:
        write_text(json_to, json.dumps(summary, indent=2))
    if not quiet:
        say(*_report(summary))
    raise typer.Exit(1 if summary["fell"] else 0)


def _nothing(now: float) -> None:
    """Standard output is for JSON alone."""


class _Lines:
    """A line a second: time, status, lateness."""

    def __init__(self, session: object) -> None:
        self._session, self._next = session, LINE_EVERY

    def __call__(self, now: float) -> None:
        if now < self._next:
            return
        self._next = now + LINE_EVERY
        loop, supervisor = self._session.loop, self._session.supervisor
        status = supervisor.status
        state = f"{status.status.value}{f', {status.reason}' if status.reason else ''}"
        text = f"{now:7.1f} s  {state:30s}  ticks missed {loop.lateness.missed}, plans late {supervisor.handover.late}"
        sys.stderr.write(f"\r{text}" if sys.stderr.isatty() else f"wholebody: {text}\n")
        sys.stderr.flush()


def _stood(summary: dict) -> str:
    """Whether it stood, and why not."""
    cause = summary["robot"].get("fall")
    return "stood" if not summary["fell"] else f"FELL ({cause})" if cause else "FELL"


def _report(summary: dict) -> list[str]:
    """The end of a run in words."""
    loop, planning, palms = summary["loop"], summary["planning"], summary["palm_error_mm"]
    tick, bins = loop["tick_ms"], loop["late_ms"]
    refused = ", ".join(f"{code} {count}" for code, count in summary["chunks"]["refused"].items())
    lines = [
        f"{_stood(summary)}: {loop['ticks']} ticks of {loop['period_ms']:g} ms, "
        f"{loop['missed_ticks']} missed, {loop['gaps']} gaps above 4 ms",
        f"palms: {palms['rms']:.2f} mm RMS, {palms['max']:.2f} mm at most; time factor {summary['time_factor']:.3f}",
        f"ticks: {tick['p50']:.2f} ms, 99 % within {tick['p99']:.2f}, longest {tick['max']:.2f}; late by: "
        + ", ".join(f"{name} ms {count}" for name, count in bins.items() if count),
        f"plans: {planning['plans']}, {planning['cpu_p50_ms']:.0f} ms of CPU, {planning['cpu_max_ms']:.0f} at most, "
        f"{planning['late']} late",
        f"chunks: {summary['chunks']['accepted']} taken{f', refused: {refused}' if refused else ''}",
    ]
    return lines + [f"not granted: {text}" for text in summary["not_granted"]]
