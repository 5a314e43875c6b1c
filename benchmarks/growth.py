"""How the time of a compiled solution grows with contacts, collision pairs and active limits.

    python benchmarks/growth.py [--plot docs/growth.png] [--repeats 1200]

Contacts: one foot, two feet, two feet and two hands (four points each, at rest in the stance, bounds of physics alone).
Pairs: the rows of the so many nearest pairs, on the reach script. Active limits: random states and references around
the stance, solved from scratch and from the working set of the solution itself. Thread CPU time [us]: lower deciles
for contacts and pairs, measured in turns, since what the machine does in between only adds to it; medians for active
limits.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from time import thread_time_ns

import numpy as np
import pinocchio as pin

from models import g1
from models.pinocchio_model import stance_q
from wholebody.bench.reach_script import ReachScript
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.qp.compiled_program import CompiledProgram
from wholebody.types import RobotState

PAIRS = (0, 5, 10, 20, 40, 60, 80, 100)
ROUNDS = 8
"""Turns in which they are measured."""
STATES = 400
"""Random states."""
WIDTH = 5
"""Active limits that are counted together."""


def main() -> None:
    """Print one line of JSON for each curve, and draw them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plot", help="file to draw the curves to")
    parser.add_argument("--repeats", type=int, default=1200, help="solutions for each number of contacts and of pairs")
    arguments = parser.parse_args()
    curves = {
        "contacts": contacts(arguments.repeats),
        "pairs": pairs(arguments.repeats),
        **active_limits(STATES),
    }
    for name, curve in curves.items():
        print(json.dumps({name: curve}))
    if arguments.plot:
        draw(curves, arguments.plot)


def contacts(repeats: int) -> dict[int, float]:
    """Time for each number of contacts [us]."""
    spec, calls = g1(), {}
    palms = tuple(
        replace(foot, frame=tool.wrist_frame, side=tool.side) for foot, tool in zip(spec.feet, spec.tools, strict=True)
    )
    for feet in (spec.feet[:1], spec.feet, spec.feet + palms):
        controller = WholeBodyController(replace(spec, feet=feet), ControllerConfig(bounds="physics"))
        q = standing_on(controller)
        calls[len(feet)] = lambda n, c=controller, q=q: timed(lambda: c.compiled.compute(q, np.zeros(c.robot.nv)), n)
    return in_turns(calls, repeats)


def in_turns(calls: dict[int, Callable[[int], float]], repeats: int) -> dict[int, float]:
    """Least result of each call over several rounds of all of them."""
    found = dict.fromkeys(calls, np.inf)
    for _ in range(ROUNDS):
        for name, call in calls.items():
            found[name] = min(found[name], call(repeats // ROUNDS))
    return found


def standing_on(controller: WholeBodyController) -> np.ndarray:
    """The stance, held: every reference is where it is."""
    script = ReachScript(g1(), 10, 0.002)
    q = script.q0
    controller.reset(RobotState(0.0, q, np.zeros(controller.robot.nv)))
    controller.set_reference(script.packed(0))
    return q


def pairs(repeats: int) -> dict[int, float]:
    """Time for each number of collision rows on the reach script [us]."""
    calls = {}
    for count in PAIRS:
        controller = WholeBodyController(g1(), ControllerConfig(solver="daqp"))
        controller.self_collision.least = controller.self_collision.most = count
        controller.compiled = CompiledProgram(controller.inputs())
        controller.bind_references()
        calls[count] = lambda n, c=controller: follow(c, n)
    return in_turns(calls, repeats)


def follow(controller: WholeBodyController, ticks: int) -> float:
    """Time of a solution along the reach script [us]."""
    script, compiled = ReachScript(g1(), ticks, 0.002), controller.compiled
    q, v, times = script.q0, np.zeros(controller.robot.nv), []
    controller.reset(RobotState(0.0, q, v))
    for k in range(ticks):
        controller.set_reference(script.packed(k))
        begin = thread_time_ns()
        compiled.compute(q, v)
        times.append(thread_time_ns() - begin)
        v = v + 0.002 * compiled.dv
        q = pin.integrate(controller.robot.model, q, 0.002 * v)
    return round(1e-3 * float(np.percentile(times[20:], 10)), 1)


def active_limits(states: int) -> dict[str, dict[int, float]]:
    """Times against the number of rows that bind, from scratch and from the right working set [us]."""
    controller = WholeBodyController(g1())
    compiled, script = controller.compiled, ReachScript(g1(), 10, 0.002)
    robot, rng, q0 = controller.robot, np.random.default_rng(0), stance_q(controller.spec, controller.robot.model)
    controller.reset(RobotState(0.0, q0, np.zeros(robot.nv)))
    rows: list[tuple[int, float, float]] = []
    for i in range(states):
        size = 2.0 * i / states
        body = np.where(np.arange(robot.nv) < 18, 0.1, 1.0)
        q = pin.integrate(robot.model, q0, 0.2 * size * body * rng.normal(size=robot.nv))
        v = 0.5 * size * body * rng.normal(size=robot.nv)
        controller.set_reference(script.packed(0))
        compiled.reset()
        cold = once(lambda q=q, v=v: compiled.compute(q, v))
        if compiled.code == 0:
            rows.append((compiled.active, cold, min(once(lambda q=q, v=v: compiled.compute(q, v)) for _ in range(3))))
    table = np.array(rows)
    bins = (table[:, 0] // WIDTH).astype(int)
    curves: dict[str, dict[int, float]] = {"active limits, from scratch": {}, "active limits, warm": {}}
    for column, curve in enumerate(curves.values(), start=1):
        for k in np.unique(bins):
            if (bins == k).sum() >= WIDTH:
                curve[int(WIDTH * k)] = round(float(np.median(table[bins == k, column])), 1)
    return curves


def once(call) -> float:
    """Time of one call [us]."""
    begin = thread_time_ns()
    call()
    return 1e-3 * (thread_time_ns() - begin)


def timed(call, repeats: int) -> float:
    """Time of a call [us]."""
    return round(float(np.percentile([once(call) for _ in range(repeats)], 10)), 1)


def draw(curves: dict[str, dict[int, float]], path: str) -> None:
    """One panel a kind of growth."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 3.2), layout="constrained")
    panels = figure.subplots(1, 3)
    for panel, title in zip(panels, ("contacts", "pairs", "active limits"), strict=True):
        for name, curve in curves.items():
            if name.startswith(title):
                panel.plot(list(curve), list(curve.values()), marker="o", label=name.removeprefix(f"{title}, "))
        panel.set_xlabel(title)
        panel.set_ylim(bottom=0.0)
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("thread CPU time of a solution [us]")
    panels[0].set_xticks(list(curves["contacts"]))
    panels[2].legend()
    figure.savefig(path, dpi=80)


if __name__ == "__main__":
    main()
