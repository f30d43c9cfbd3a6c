"""Play, pause, speed, scrub; bars of position, velocity and torque against their limits."""

import time
from collections.abc import Sequence
from html import escape

import numpy as np

from runtime.library import Array, Library
from runtime.view.motion import Motion
from runtime.view.scene import Scene

TICK_S = 1 / 30
BARS_S = 0.1
SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4")
_GOOD, _FULL = "#0072B2", "#D55E00"
NEAR = 0.95
"""Of a limit: from here on the bar warns."""


class Player:
    """Controls in the browser, and the clock that moves the robot."""

    def __init__(self, lib: Library, scene: Scene, motion: Motion) -> None:
        self._lib, self._scene, self._motion = lib, scene, motion
        gui = scene.server.gui
        gui.add_markdown(f"**{lib.name}** · {motion.name} · {motion.duration:.1f} s")
        self.play = gui.add_checkbox("play", True)
        self.speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        self.time = gui.add_slider(
            "time [s]", 0.0, max(motion.duration, 0.01), 0.01, initial_value=0.0
        )
        self.bars = gui.add_html("")
        self._shown = -1.0
        self._barred = -np.inf
        self.show(0.0)

    def show(self, t: float) -> None:
        """The instant t: pose and, not too often, bars."""
        q, dq, tau = self._motion.at(t)
        self._scene.pose(q)
        self._shown = t
        if time.monotonic() - self._barred > BARS_S or not self.play.value:
            self.bars.content = bars(self._lib, q, dq, tau)
            self._barred = time.monotonic()

    def tick(self, elapsed: float) -> None:
        """Go on by `elapsed` s of the wall, or to where the slider was put."""
        if self.time.value != round(self._shown, 2):
            self._shown = float(self.time.value)
        t = self._shown
        if self.play.value:
            t = (t + float(self.speed.value) * elapsed) % max(self._motion.duration, 0.01)
            self.time.value = round(t, 2)
        self.show(t)

    def run(self) -> None:
        """Until Ctrl-C."""
        last = time.monotonic()
        while True:
            time.sleep(TICK_S)
            now = time.monotonic()
            self.tick(now - last)
            last = now


def bars(lib: Library, q: Array, dq: Array | None, tau: Array | None) -> str:
    """Per joint a bar in its range, and shares of the limits of velocity and torque, as HTML."""
    joints = lib.manifest.joints
    blocks = []
    for j, joint in enumerate(joints):
        rows = [_row(f"q {q[j]:+.2f} {joint.unit}", _place(q[j], joint.lower, joint.upper))]
        kinds: Sequence[tuple[str, Array | None, float | None, str]] = (
            ("dq", dq, joint.velocity, f"{joint.unit}/s"),
            ("τ", tau, joint.effort, "N·m" if joint.unit == "rad" else "N"),
        )
        for symbol, values, limit, unit in kinds:
            if values is not None:
                share = None if not limit else abs(values[j]) / limit
                rows.append(_row(f"{symbol} {values[j]:+.2f} {unit}", share))
        blocks.append(f"<b>{escape(joint.name)}</b>{''.join(rows)}")
    return (
        '<div style="font:12px sans-serif;padding:0 1em;line-height:1.5">'
        f"{'<br>'.join(blocks)}</div>"
    )


def _place(value: float, lower: float | None, upper: float | None) -> float | None:
    """How far from the middle of its range, as a share of half of it."""
    if lower is None or upper is None:
        return None
    return abs(2 * value - lower - upper) / (upper - lower)


def _row(text: str, share: float | None) -> str:
    """A bar of a share; without a limit the number alone."""
    label = f'<span style="display:inline-block;width:9.5em">{text}</span>'
    if share is None:
        return f"<div>{label}no limit</div>"
    colour = _FULL if share > NEAR else _GOOD
    width = f"{100 * min(share, 1.0):.0f}%"
    return (
        f'<div style="display:flex;align-items:center">{label}'
        '<span style="flex:1;height:6px;background:#8883;border-radius:3px">'
        f'<span style="display:block;width:{width};height:6px;background:{colour};'
        f'border-radius:3px"></span></span><span style="width:3.2em;text-align:right">'
        f"{100 * share:.0f} %</span></div>"
    )
