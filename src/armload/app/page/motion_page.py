"""A motion on a page: the arm runs it again and again, or stands where the slider says, among what stands around.

viser keeps its state, so that a page that is opened later shows the same.
"""

from __future__ import annotations

import math
import threading
import time
from html import escape
from typing import Any

import numpy as np

from armload.app.page.scene import HELD, REGION, TRUTH, DrawnArm
from armload.app.page.server import PageServer, look_at_arm
from armload.app.page.spoken import spoken
from armload.app.page.style import SHEET, TEXT, awake
from armload.arms import PAYLOAD_REACH, Arm
from armload.arms.units import heading, marked
from armload.excitation import Surroundings
from armload.motion import Motion, check_joints

SPEEDS = {"real time": 1.0, "half": 0.5, "a quarter": 0.25, "a tenth": 0.1}
_PICTURES = 1 / 30  # [s] between two
_REST = 0.7  # [s] at the end, before the motion begins again
_PATH = 200.0  # [Hz] of points on the line that the payload frame draws
_STEP = 1e-3  # [s] of the slider


class MotionPage:
    """A server and what it shows of a motion.

    Args:
        motion: what the arm does.
        arm: whose motion it is.
        around: floor, boxes and what is held, as they are drawn, with distances; None: a floor at the base.
        host: the interface to listen on. port: if it is taken, the next free one; 0: any.

    Attributes:
        url: where to find the page.

    Raises:
        MotionError: the motion is of another arm. UsageError: viser is not installed, or there is no such interface.
    """

    def __init__(
        self,
        motion: Motion,
        arm: Arm,
        around: Surroundings | None = None,
        host: str = "127.0.0.1",
        port: int = 8080,
    ) -> None:
        check_joints(motion, arm)
        self._motion, self._arm = motion, arm
        self._around = Surroundings(arm) if around is None else around
        self._page = PageServer(host, port, f"armload · {motion.name}", otherwise="draw it with --figure")
        self._server = server = self._page.viser
        self.url = self._page.url
        self._stop, self._one_at_a_time = threading.Event(), threading.Lock()  # whoever moves the slider is a thread
        self.drawn = DrawnArm(server.scene, arm)
        self._draw_around(server.scene)
        look_at_arm(server, self.drawn.reach)
        self._build_panel(server.gui)
        self._at = 0.0
        self.show(0.0)

    def serve(self) -> None:
        """Run the motion again and again, while somebody looks, until `close` or Ctrl-C."""
        last = time.monotonic()
        while not self._stop.is_set():
            now = time.monotonic()
            if self._server.get_clients():
                self.go_on(now - last)
            last = now
            self._stop.wait(_PICTURES)

    def go_on(self, seconds: float) -> None:
        """Show the motion so many seconds later, if it runs: after its end it rests, and begins again."""
        if self._runs.value:
            self._at += SPEEDS.get(self._speed.value, 1.0) * seconds  # a client may send any text
            if self._at > self._motion.duration + _REST:
                self._at = 0.0
            self.show(self._at)

    def show(self, t: float) -> None:
        """Show the arm where it is at a time [s]."""
        t = float(np.clip(t, 0.0, self._motion.duration))
        with self._one_at_a_time, self._server.atomic():
            q, dq, _ = (x[0] for x in self._motion([t]))
            self.drawn.stand(q)
            self._time.value = round(t / _STEP) * _STEP
            self.numbers.content = self._table(t, q, dq)

    def close(self) -> None:
        """Stop serving; nothing happens the second time."""
        if not self._stop.is_set():
            self._stop.set()
            self._page.stop()

    # ------------------------------------------------------------------ what is on it

    def _draw_around(self, scene: Any) -> None:
        around, times = self._around, np.linspace(0.0, self._motion.duration, round(_PATH * self._motion.duration) + 2)
        path = self._arm.frame_pose(self._motion.position(times))[1]
        self.path = scene.add_line_segments(
            "/path", np.stack([path[:-1], path[1:]], axis=1).astype(np.float32), TRUTH, thickness=2.5,
            thickness_units="screen",
        )  # fmt: skip
        for number, box in enumerate(around.boxes, start=1):
            scene.add_box(f"/box{number}", REGION, box.edges, position=box.centre, opacity=0.5)
        held, where = around.held, "/arm/flange/held"
        if isinstance(held, tuple):
            scene.add_box(where, HELD, held, position=(0.0, 0.0, held[2] / 2), opacity=0.25)
        elif held > 0.0:
            scene.add_icosphere(where, held, HELD, position=(0.0, 0.0, PAYLOAD_REACH), opacity=0.25)

    def _build_panel(self, gui: Any) -> None:
        motion = self._motion
        gui.add_html(SHEET + awake(self._page.label) + spoken())
        gui.add_html(f'<div style="{TEXT}"><b>{escape(motion.name)}</b>, {motion.duration:g} s</div>')
        self._runs = gui.add_checkbox("Run", initial_value=True)
        self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="real time")
        last = max(_STEP, round(motion.duration / _STEP) * _STEP)
        self._time = gui.add_slider("Time [s]", min=0.0, max=last, step=_STEP, initial_value=0.0)
        self.numbers = gui.add_html("")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(400)

        @self._time.on_update
        def _(event: Any) -> None:
            if event.client is not None and math.isfinite(event.target.value):  # else we set it ourselves
                self._runs.value = False
                self._at = float(event.target.value)
                self.show(self._at)

    def _table(self, t: float, q: np.ndarray, dq: np.ndarray) -> str:
        limits = self._arm.limits
        rows = []
        for k, name in enumerate(self._arm.joint_names):
            most = limits.velocity[k]
            share = f"{100 * abs(dq[k]) / most:.0f} %" if np.isfinite(most) else "no limit"
            cells = "".join(f'<td style="text-align:right;padding:0 6px">{x}</td>' for x in
                            (f"{q[k]:+.3f}", f"{dq[k]:+.3f}", share))  # fmt: skip
            rows.append(
                f'<tr data-armload="joint{k + 1}"><th scope="row" style="text-align:left;font-weight:400">'
                f"{escape(marked(name, limits.slides, k))}</th>{cells}</tr>"
            )
        where, how_fast = (heading(what, limits.slides).removeprefix(f"{what} ") for what in ("position", "velocity"))
        head = "".join(
            f'<th scope="col" style="text-align:{side};font-weight:600;padding:0 6px">{text}</th>'
            for text, side in (("joint", "left"), (where, "right"), (how_fast, "right"), ("of its limit", "right"))
        )
        distances = zip(("floor", "itself", "boxes"), self._around.clearance(q[None])[0], strict=True)
        near = ", ".join(f"{what} {1000 * far:.0f} mm" for what, far in distances if np.isfinite(far))
        return (
            f'<div style="{TEXT}"><div data-armload="state">t = {t:.2f} s</div>'
            f'<table style="width:100%;border-collapse:collapse"><tr>{head}</tr>{"".join(rows)}</table>'
            f'<div data-armload="near">distances: {near}</div></div>'
        )
