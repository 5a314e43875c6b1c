"""Time lines of a recording in one picture: margins, errors, torques, speed and planning, each with its bounds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wholebody.errors import require_extra
from wholebody.robot.support_polygon import convex_polygon
from wholebody.sim.pictures.scene import STATUS_COLOUR, Colour, Show
from wholebody.sim.record import PERIODS, SIDES, Record
from wholebody.types import Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PLOT_COLUMNS = (
    *("time", "status", "reason", "torque_asked", "effort_max", "motor_names"),
    *(name for name in PERIODS if name.startswith("T_world_palms_")),
    *("pressure", "capture_point", "com", "soles", "carries"),
    *("pressure_margin", "capture_margin", "rate", "planning_time"),
    *("palm_bounds", "turn_bounds", "balance_margin", "lead", "orientation_free"),
)
"""Columns of a recording that a plot is made of."""

SIDE_COLOUR = {"left": (0.80, 0.27, 0.10), "right": (0.00, 0.40, 0.70)}
BOUND: Colour = (0.70, 0.00, 0.10, 1.0)
POINTS_MAX = 2000
"""Stretches of a line of which the least and the largest value are drawn: more cannot be seen."""
ERROR_MIN, ERROR_MAX = 0.01, 100.0
"""The palm errors are on a logarithmic scale, at least from here to there [mm]."""
PLANNING_MIN, PLANNING_MAX = 1.0, 300.0
"""So are the times of planning [ms]."""
WORST, SELDOM = 3, 0.02
"""How many motors are named, and the part of the time that one must be the worst to be one of them."""
HEIGHTS, FROM_ABOVE = (0.35, 2.0, 1.3, 1.6, 1.6, 1.6), 3.0
"""Heights of the panels over time, and of the one that is seen from above [no unit]; chosen."""


def plot(record: Record, output: str | Path, title: str = "") -> None:
    """Draw a picture of the time lines; of a robot that makes steps, from above, too.

    Args:
        record: With `PLOT_COLUMNS` at least.
        output: Where to; a format of matplotlib by its ending, such as ``.png`` or ``.svg``.
        title: What it is about.

    Raises:
        InputError: If the extra is not installed.
    """
    require_extra("plot", "matplotlib", "a plot")
    from matplotlib.figure import Figure

    steps = len(record.footprints()) > len(SIDES)
    heights = (*HEIGHTS, FROM_ABOVE) if steps else HEIGHTS
    figure = Figure(figsize=(11.0, 12.0 * sum(heights) / sum(HEIGHTS)), layout="constrained")
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    panels = [figure.add_subplot(grid[0])]
    panels += [figure.add_subplot(cell, sharex=panels[0]) for cell in list(grid)[1 : len(HEIGHTS)]]
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    if steps:
        _from_above(figure.add_subplot(grid[-1]), record)
    time = record["time"]
    for panel, draw in zip(panels, (_status, _errors, _turns, _margins, _torques, _speed), strict=True):
        draw(panel, record, time)
    panels[0].set_title(title, loc="left", parse_math=False)
    panels[-1].set_xlabel("time [s]")
    panels[-1].set_xlim(time[0], max(time[-1], time[0] + 1e-3))
    figure.savefig(output, dpi=90)


def _status(axes: Axes, record: Record, time: np.ndarray) -> None:
    """A band in the colour of the status."""
    status, reason = record["status"], record["reason"]
    begins = [0, *(np.flatnonzero((status[1:] != status[:-1]) | (reason[1:] != reason[:-1])) + 1)]
    for begin, end in zip(begins, [*begins[1:], len(time) - 1], strict=True):
        axes.axvspan(time[begin], time[end], color=STATUS_COLOUR[Status(str(status[begin]))], alpha=0.75, lw=0.0)
        if time[end] - time[begin] > 0.09 * (time[-1] - time[0]):
            text = f"{status[begin]}\n{reason[begin]}".strip()
            centre = 0.5 * (time[begin] + time[end])
            axes.text(centre, 0.5, text, ha="center", va="center", fontsize=7.5, color="white", parse_math=False)
    axes.set_yticks([])
    axes.set_ylim(0.0, 1.0)
    axes.set_ylabel("status", rotation=0, ha="right", va="center")


def _errors(axes: Axes, record: Record, time: np.ndarray) -> None:
    errors, moved = 1e3 * record.palm_errors(), 1e3 * record.palm_errors("asked", "commanded")
    worst = np.nan_to_num(np.concatenate([errors, moved])).max()
    for hand, side in enumerate(SIDES):
        _line(axes, time, errors[:, hand], SIDE_COLOUR[side], f"{side} palm, measured")
        _line(axes, time, moved[:, hand], SIDE_COLOUR[side], f"{side} palm, commanded", "--")
    feasible, repair = 1e3 * record["palm_bounds"]
    _bound(axes, feasible, "as given up to here", left=True)
    _bound(axes, repair, "repaired up to here")
    _finish(axes, "from asked [mm]")
    _logarithmic(axes)
    axes.set_ylim(ERROR_MIN, max(ERROR_MAX, 1.3 * worst))


def _turns(axes: Axes, record: Record, time: np.ndarray) -> None:
    turns, free = np.degrees(record.palm_turns()), record["orientation_free"].astype(bool)
    for hand, side in enumerate(SIDES):
        text = f"{side} palm" + (", free" if free[hand] else "")
        _line(axes, time, turns[:, hand], SIDE_COLOUR[side], text, ":" if free[hand] else "-")
    if not free.all():
        feasible, repair = np.degrees(record["turn_bounds"])
        _bound(axes, feasible, "as given", left=True)
        _bound(axes, repair, "repaired")
    _finish(axes, "from asked [°]")


def _margins(axes: Axes, record: Record, time: np.ndarray) -> None:
    _line(axes, time, 1e3 * record["pressure_margin"], Show.PRESSURE.colour, Show.PRESSURE.legend)
    _line(axes, time, 1e3 * record["capture_margin"], Show.CAPTURE.colour, Show.CAPTURE.legend)
    _bound(axes, 0.0, "edge of the soles")
    _bound(axes, 1e3 * float(record["balance_margin"]), "of the capture point: safety.balance_margin")
    _finish(axes, "inside the soles [mm]")
    lowest = np.nanmin(np.concatenate([record["pressure_margin"], record["capture_margin"], [0.0]]))
    axes.set_ylim(bottom=max(1e3 * lowest - 5.0, -60.0))


def _torques(axes: Axes, record: Record, time: np.ndarray) -> None:
    """The motor nearest to its limit, and how near; fingers press with all they have and are left out."""
    body = np.array(["_hand_" not in name for name in record["motor_names"].tolist()])
    names, share = record["motor_names"][body], record["torque_asked"][:, body] / record["effort_max"][body]
    worst = share.argmax(axis=1)
    _line(axes, time, share.max(axis=1), (0.25, 0.25, 0.30), "worst motor")
    often = np.bincount(worst, minlength=len(names)) / len(worst)
    for motor in [motor for motor in np.argsort(-often)[:WORST] if often[motor] > SELDOM]:
        name = str(names[motor]).removesuffix("_joint").replace("_", " ")
        _line(axes, time, np.where(worst == motor, share[:, motor], np.nan), None, f"{name} is the worst", lw=2.5)
    _bound(axes, 1.0, "limit")
    _finish(axes, "torque asked / limit")
    axes.set_ylim(0.0, min(max(1.15, 1.1 * float(share.max())), 3.0))


def _speed(axes: Axes, record: Record, time: np.ndarray) -> None:
    _line(axes, time, record["rate"], (0.00, 0.55, 0.36), "speed along the chunk, 1 as given")
    axes.set_ylim(0.0, max(1.1, 1.05 * float(record["rate"].max())))
    axes.set_ylabel("speed")
    axes.grid(alpha=0.3)
    beside, planning, lead = axes.twinx(), record["planning_time"], 1e3 * float(record["lead"])
    came = np.flatnonzero(np.diff(planning, prepend=0.0) != 0.0)
    beside.plot(time[came], 1e3 * planning[came], "o", ms=4.0, color=(0.45, 0.25, 0.60), label="a plan's CPU time")
    beside.axhline(lead, color=BOUND, lw=1.0, ls="--", label=f"lead, {lead:.0f} ms")
    _logarithmic(beside)
    beside.set_ylim(PLANNING_MIN, 1.5 * max([PLANNING_MAX, lead, *(1e3 * planning[came])]))
    beside.set_ylabel("planning [ms]")
    handles = [*axes.get_legend_handles_labels()[0], *beside.get_legend_handles_labels()[0]]
    beside.legend(handles=handles, fontsize=7.5, loc="center left", bbox_to_anchor=(1.09, 0.5), frameon=False)


def _from_above(axes: Axes, record: Record) -> None:
    """Footprints with their numbers, and the ways of pressure, capture point and centre of mass over them."""
    for number, one in enumerate(record.footprints()):
        corners = convex_polygon(one.corners).vertices
        axes.fill(*corners.T, color=SIDE_COLOUR[one.side], alpha=0.25, lw=0.0)
        begin = record["time"][one.begin]
        text = str(number - 1) if number >= len(SIDES) else "0"
        axes.annotate(f"{text}\n{begin:.1f} s", corners.mean(axis=0), ha="center", va="center", fontsize=6.5)
    for name, show in (("com", Show.MASS), ("capture_point", Show.CAPTURE), ("pressure", Show.PRESSURE)):
        axes.plot(*record[name][:, :2].T, color=show.colour, lw=0.9, label=show.legend)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    _finish(axes, "y [m]")
    axes.autoscale(axis="y")


def _line(
    axes: Axes,
    time: np.ndarray,
    values: np.ndarray,
    colour: tuple | None,
    label: str,
    style: str = "-",
    lw: float = 1.2,
) -> None:
    """A line; of a long one, the least and the largest value of each of `POINTS_MAX` stretches."""
    step = -(-len(time) // POINTS_MAX)
    if step > 2:
        starts = np.arange(0, len(time) - step + 1, step)
        groups = values[: len(starts) * step].reshape(-1, step)
        least, most = (
            np.nan_to_num(groups, nan=np.inf).argmin(axis=1),
            np.nan_to_num(groups, nan=-np.inf).argmax(axis=1),
        )
        rows = np.unique(np.concatenate([starts + least, starts + most]))
        time, values = time[rows], values[rows]
    axes.plot(time, values, style, color=colour, lw=lw, label=label)


def _logarithmic(axes: Axes) -> None:
    from matplotlib.ticker import FormatStrFormatter

    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))


def _bound(axes: Axes, value: float, name: str, *, left: bool = False) -> None:
    axes.axhline(value, color=BOUND, lw=1.0, ls="--", zorder=1)
    place, side = (0.005, "left") if left else (0.995, "right")
    paper = {"facecolor": "white", "alpha": 0.7, "linewidth": 0.0, "pad": 0.5}
    place = {"xy": (place, value), "xycoords": ("axes fraction", "data"), "ha": side, "va": "bottom"}
    axes.annotate(name, **place, fontsize=7, color=BOUND, bbox=paper)


def _finish(axes: Axes, label: str) -> None:
    axes.set_ylabel(label)
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7.5, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
