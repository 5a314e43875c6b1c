"""The panel beside the robot on the page: words, time lines, and what a person can do apart from dragging hands."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from html import escape

import numpy as np
import viser
from viser import uplot

from wholebody.live.door import Check, Door, between, one_of
from wholebody.live.snapshot import Snapshot, UserCommand
from wholebody.sim.pictures.scene import STATUS_COLOUR, Scene

HISTORY = 20.0
"""Length of the time lines [s]; chosen."""
LINES_PER_S = 10.0
"""Points of the time lines a second [Hz]; chosen: the curves are sent whole each time."""
PUSH_DURATION = 0.1
"""How long a push lasts [s]; definition of the pushes in `docs/measured.md`."""
SIDES = ("left", "right")
CONTROLS = "run", "walk", "disturb", "hands"
"""What a panel can have: source and time, where the robot is sent, what disturbs it, how far its hands are closed."""
LINES = {"balance margin": "mm", "palm error": "mm", "tick": "ms", "planning": "ms"}
"""Time lines and their units; those of a loop's own time are left out where there is no loop beside the page."""


class SidePanel:
    """Words, buttons, sliders and time lines.

    Args:
        gui: Of the page.
        door: Lets in what the controls send.
        sources: Names that can be chosen.
        wish: Takes what a person wants: a command and its numbers.
        controls: What people can do there, some of `CONTROLS`.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        door: Door,
        sources: Sequence[str],
        wish: Callable[[tuple[UserCommand | float, ...]], None],
        controls: Sequence[str],
    ) -> None:
        self._door, self._sources, self._send, self._loops = door, sources, wish, "run" in controls
        self._names = list(LINES) if self._loops else ["palm error"]
        self._lines = {name: deque(maxlen=int(HISTORY * LINES_PER_S)) for name in ("time", *self._names)}
        gui.configure_theme(dark_mode=True, show_share_button=False, show_logo=False, control_layout="collapsible")
        self._words = gui.add_html('<div style="padding:0 1em 0.5em;font-size:0.85em">the robot is being loaded</div>')
        adding = self._add_run, self._add_walk, self._add_disturbances, self._add_hands
        for name, add in zip(CONTROLS, adding, strict=True):
            if name in controls:
                add(gui)
        with gui.add_folder("time lines"):
            self._plots = {name: _plot(gui, name, LINES[name]) for name in self._names}

    def _add_run(self, gui: viser.GuiApi) -> None:
        """What runs, and time."""
        source = gui.add_dropdown("source", self._sources, hint="where the chunks come from")
        source.on_update(lambda _: self._wish(UserCommand.SOURCE, self._sources.index(source.value)))
        times = ("pause", "go on", "reset")
        row = gui.add_button_group("time", times)
        row.on_click(lambda _: self._on_time(row.value))
        self._opens(source, one_of(*self._sources))
        self._opens(row, one_of(*times))

    def _add_disturbances(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("disturb", expand_by_default=False):
            size = gui.add_slider("push [N s]", 0.0, 20.0, 0.5, 5.0, hint="momentum, given at the torso in 0.1 s")
            angle = gui.add_slider("direction [deg]", -180, 180, 15, 0, hint="0: from behind, 90: to the left")
            push = gui.add_button("push")
            push.on_click(lambda _: self._push(size.value, angle.value))
            self._opens(push, one_of(True))
            load = [gui.add_slider(f"{side} hand [kg]", 0.0, 3.0, 0.1, 0.0) for side in SIDES]
            for slider in load:
                slider.on_update(lambda _: self._wish(UserCommand.PAYLOAD, *(s.value for s in load)))
            friction = gui.add_slider("floor friction", 0.2, 1.2, 0.05, 0.8)
            friction.on_update(lambda _: self._wish(UserCommand.FRICTION, friction.value))
            latency = gui.add_slider("policy latency [ms]", 0, 500, 10, 0)
            latency.on_update(lambda _: self._wish(UserCommand.LATENCY, 1e-3 * latency.value))
            for slider in (size, angle, *load, friction, latency):
                self._opens(slider, between(slider.min, slider.max))

    def _add_walk(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("walk"):
            hint = "from where the robot stands"
            ahead = gui.add_slider("ahead [m]", -1.0, 1.0, 0.05, 0.3, hint=hint)
            way = ahead, gui.add_slider("to the left [m]", -1.0, 1.0, 0.05, 0.0, hint=hint)
            turn = gui.add_slider("turn to the left [deg]", -90, 90, 5, 0, hint=hint)
            words = ("go there", "stay")
            row = gui.add_button_group("walk", words)

            @row.on_click
            def _(_: object) -> None:
                goes = float(row.value == words[0])
                self._wish(UserCommand.WALK, *(goes * s.value for s in way), goes * np.radians(turn.value))

            for slider in (*way, turn):
                self._opens(slider, between(slider.min, slider.max))
            self._opens(row, one_of(*words))

    def _add_hands(self, gui: viser.GuiApi) -> None:
        closing = [gui.add_slider(f"{side} hand", 0.0, 1.0, 0.05, 0.0, hint="0 open, 1 closed") for side in SIDES]
        for slider in closing:
            slider.on_update(lambda _: self._wish(UserCommand.CLOSING, *(s.value for s in closing)))
            self._opens(slider, between(slider.min, slider.max))

    def _opens(self, control: object, check: Check) -> None:
        """Let what a control sends in."""
        self._door.values[control._impl.uuid] = check

    def _wish(self, what: UserCommand, *numbers: float) -> None:
        self._send((what, *numbers))

    def _on_time(self, pressed: str) -> None:
        if pressed == "reset":
            self._wish(UserCommand.RESET)
        else:
            self._wish(UserCommand.PAUSE, float(pressed == "pause"))

    def _push(self, momentum: float, angle: float) -> None:
        direction = np.radians(angle)
        force = momentum / PUSH_DURATION * np.array([np.cos(direction), np.sin(direction), 0.0])
        self._wish(UserCommand.PUSH, *force, PUSH_DURATION)

    def tell(self, glance: Snapshot, scene: Scene) -> None:
        """Words and time lines of an instant."""
        status, numbers = scene.words()
        colour = "#" + "".join(f"{round(255 * part):02x}" for part in STATUS_COLOUR[scene.status][:3])
        errors, margin = scene.errors, scene.balance_margin
        tick, plan = 1e3 * glance.tick, 1e3 * glance.followed.planning_time
        if self._loops:
            loop = f"{scene.time:.1f} s, tick {tick:.2f} ms, {glance.missed} missed, plan {plan:.0f} ms"
            numbers = f"{numbers}<br>{loop}, {glance.late} late"
        else:
            off = (
                []
                if errors is None
                else [f"{side} palm {1e3 * error:.0f} mm" for side, error in zip(SIDES, errors, strict=True)]
            )
            numbers = f"{', '.join(off)} from its handle<br>{scene.time:.1f} s" if off else f"{scene.time:.1f} s"
        self._words.content = (
            f'<div style="padding:0 1em 0.5em;font-size:0.85em;line-height:1.5">'
            f'<b style="color:{colour}">{escape(status)}</b><br>'
            f"{numbers}</div>"
        )
        values = {
            "time": scene.time,
            "balance margin": np.nan if margin is None else 1e3 * margin,
            "palm error": np.nan if errors is None else 1e3 * errors.max(),
            "tick": tick,
            "planning": plan,
        }
        for name, line in self._lines.items():
            line.append(values[name])
        time = np.array(self._lines["time"])
        for name, plot in self._plots.items():
            plot.data = (time, np.array(self._lines[name]))


def _plot(gui: viser.GuiApi, name: str, unit: str) -> object:
    series = (uplot.Series(label="s"), uplot.Series(label=unit, stroke="#0072b2", width=1.5))
    empty = (np.array([0.0, 1.0]), np.array([0.0, 0.0]))
    return gui.add_uplot(
        empty,
        series,
        title=f"{name} [{unit}]",
        height=110,
        scales={"x": uplot.Scale(time=False)},
        legend=uplot.Legend(show=False),
    )
