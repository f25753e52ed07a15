"""The page: the state of the session in a browser (viser), read ten times a second; nothing waits for it.

viser keeps its state, so that a page that is opened later shows the same.
"""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np

from armload.app.page import tables
from armload.app.page.curves import AXES, GROUPS, HEIGHT, PADDING, Group, bands_of, data_of, legend_of, series_of
from armload.app.page.download import ENDINGS, file_of
from armload.app.page.scene import Scene
from armload.app.page.server import PageServer, look_at_middle, look_from
from armload.app.page.spoken import spoken
from armload.app.page.status import Status, Watcher
from armload.app.page.style import SHEET, SOFT, TEXT, awake, heard, unheard
from armload.arms import Arm, rated_mass
from armload.errors import ArmloadError, ModelError
from armload.identification import METHODS, default_for
from armload.inertia import InertialParameters
from armload.service.session import Session

_NUMBERS, _CURVES = 3, 8  # pictures from which on numbers and curves follow
SPANS = {"last 30 s": 30.0, "last 2 min": 120.0, "last 10 min": 600.0, "last hour": 3600.0, "everything": float("inf")}
_SPAN = SPANS["last 30 s"]  # at first
_BALL = 0.05  # [m] radius of what a simulated arm takes up by hand
_VIEWS = ("payload", "whole arm")
_KEY = (
    f'<div style="{TEXT};{SOFT}">line: estimate over time [s], shaded: 95 % interval, dashed: truth where it is known. '
    "In the picture: box of the same mass and inertia (grey: not all determined), red: 95 % region of the centre of "
    "mass, green outline: truth.</div>"
)


class Page:
    """A server and what it shows.

    Args:
        session: started by whoever made it.
        host: the interface to listen on. port: if it is taken, the next free one; 0: any.
        period: between two pictures [s].
        token: that lets in where the host is not this machine alone; None: one is drawn.

    Attributes:
        url: where to find the page, with the token if one is needed.

    Raises:
        UsageError: viser is not installed, or there is no such interface.
    """

    def __init__(
        self,
        session: Session,
        host: str = "127.0.0.1",
        port: int = 8080,
        period: float = 1 / 15,
        token: str | None = None,
    ) -> None:
        self.session, self.period = session, period
        self._page = PageServer(host, port, f"armload · {session.source.name}", token)
        self._server = server = self._page.viser
        self.url = self._page.url
        self._stop = threading.Event()
        self._ticks, self._watcher = 0, Watcher(session)
        self.scene = Scene(server.scene, session.arm)
        look_at_middle(server, self.scene.reach)
        self._plots: list[Any] = []  # as GROUPS
        self._build_panel(server.gui)
        self._build_curves(server.gui)

    def serve(self) -> None:
        """Show the session until `close` or Ctrl-C."""
        due = time.monotonic()
        while not self._stop.is_set():
            status = self._watcher.look()  # also while nobody looks on: what is old then is old
            if self._server.get_clients():
                self.show(status)
            due = max(due + self.period, time.monotonic())
            self._stop.wait(due - time.monotonic())

    def show(self, status: Status | None = None) -> None:
        """Bring what is seen up to date.

        Args:
            status: how the answer is to be taken; None: look.
        """
        status = self._watcher.look() if status is None else status
        session = self.session
        sample, estimate = session.sample, session.estimate
        numbers, curves = self._ticks % _NUMBERS == 0, self._ticks % _CURVES == 0
        self._ticks += 1
        with self._server.atomic():
            now = None if status.gone else estimate  # what may be shown as being so at present
            truth = None if now is None else session.truth(now.t)
            if sample is not None:
                self.scene.show(sample, now, truth)
            if numbers:
                beat = int(time.monotonic())
                headline = tables.gone(status) if status.gone else tables.headline(now, truth, status)
                self._headline.content = unheard(beat) + heard(headline, beat)
                self._status.content = heard(tables.status(estimate, status), beat)
                self._table.content = heard(tables.parameters(now, truth), beat)
                self._events.content = tables.events(session.log)
                self._stream.content = tables.stream(
                    session.source.name, estimate, session.lost, None if status.why is None else status.why.reason
                )
            if curves:
                span = SPANS.get(self._span.value, _SPAN)  # a client may send any text, and all look at one page
                t, rows = session.history.last(span)
                for group, plot in zip(GROUPS, self._plots, strict=True):
                    plot.data = data_of(group, t, rows)

    def close(self) -> None:
        """Stop serving; nothing happens the second time."""
        if not self._stop.is_set():
            self._stop.set()
            self._page.stop()

    # ------------------------------------------------------------------ what is on it

    def _build_curves(self, gui: Any) -> None:
        panel = gui.add_panel()
        with panel.add_tab("Curves"):
            self._span = gui.add_dropdown("Time span", tuple(SPANS), initial_value="last 30 s")
            for group in GROUPS[1:]:
                self._add_curves(gui, group)
            gui.add_html(_KEY)
        panel.dock_left()
        panel.set_width(400)
        panel.expand()  # on a phone panels are sections of one sheet, closed at first

    def _add_curves(self, gui: Any, group: Group) -> None:
        named = f'data-armload="legend" data-title="{group.title}"'
        gui.add_html(f'<div style="{TEXT};padding-bottom:0" {named}>{legend_of(group)}</div>')
        plot = gui.add_uplot(
            data_of(group, *self.session.history.last(1.0)),
            series_of(group),
            bands=bands_of(group),
            scales={"x": {"time": False}, "y": {"auto": True}},
            axes=AXES,
            legend={"show": False},
            padding=PADDING,
            height=HEIGHT,
        )
        self._plots.append(plot)

    def _build_hand(self, gui: Any) -> None:
        """What a simulated arm holds, changed by hand: a ball of some mass, some way from the flange."""
        most = rated_mass(self.session.arm)
        with gui.add_folder("Simulated payload"):
            mass = gui.add_number("Mass [kg]", 1.0, min=0.05, max=float(most), step=0.05)
            away = gui.add_number("Offset [m]", 0.06, min=0.0, max=0.3, step=0.01, hint="Along z of the flange")
            hand = gui.add_button_group("  ", ("Take up", "Put down"))

        @hand.on_click
        def _(event: Any) -> None:
            taken = event.target.value == "Take up"
            held = (float(mass.value), float(away.value)) if taken else (0.0, 0.0)
            _done(event.client, event.target.value, lambda: self.take_up(*held))

    def take_up(self, mass: float, away: float) -> None:
        """Let a simulated arm hold a ball of 5 cm radius, of so many kg, so many metres along z; 0 kg: nothing.

        Raises:
            SourceError: the simulator has ended.
        """
        body = InertialParameters.zero(self.session.arm.frame)
        if mass > 0.0:
            body = InertialParameters.from_com(mass, (0.0, 0.0, away), 0.4 * mass * _BALL**2 * np.eye(3), body.frame)
        self.session.source.hold(body)

    def _build_panel(self, gui: Any) -> None:
        session = self.session
        gui.add_html(SHEET + awake(self._page.label) + spoken())
        self._headline = gui.add_html(tables.headline(None))
        self._add_curves(gui, GROUPS[0])  # where a phone shows it without scrolling
        self._status = gui.add_html("")
        self._table = gui.add_html("")
        methods = methods_for(session)
        self._view = gui.add_dropdown("View", _VIEWS, hint="Payload: it stays in the middle while the arm moves")
        with gui.add_folder("Identification"):
            self._method = gui.add_dropdown("Method", methods, initial_value=session.identifier.method)
            again = gui.add_button_group(" ", ("Start anew", "Tare"), hint="Tare: what is held now counts as nothing")
        if session.source.simulated:
            self._build_hand(gui)
        with gui.add_folder("Export"):
            self._form = gui.add_dropdown("Form", tuple(ENDINGS), initial_value="urdf")
            export = gui.add_button("Download")
        with gui.add_folder("Events"):
            self._events = gui.add_html(tables.events(()))
        self._stream = gui.add_html(tables.stream(session.source.name, None))
        gui.main_panel.dock_right()
        gui.main_panel.set_width(400)

        @self._method.on_update
        def _(event: Any) -> None:
            if event.client is None or event.target.value == session.identifier.method:
                return  # we set it ourselves
            if not _done(event.client, "Method", lambda: session.use(event.target.value)):
                self._method.value = session.identifier.method

        @self._view.on_update
        def _(_: Any) -> None:
            self.scene.close = self._view.value == _VIEWS[0]
            for client in self._server.get_clients().values():
                look_from(client.camera, self.scene.reach, self.scene.close)

        @again.on_click
        def _(event: Any) -> None:
            what = session.take_tare if event.target.value == "Tare" else session.reset
            _done(event.client, event.target.value, what)

        @export.on_click
        def _(event: Any) -> None:
            def send() -> None:
                name, text = file_of(session.estimate, session.arm, self._form.value)
                event.client.send_file_download(name, text.encode(), save_immediately=True)

            _done(event.client, "Download", send)


def methods_for(session: Session) -> tuple[str, ...]:
    """Names of the methods a session can be switched to: those that need nothing but its samples and its tare."""
    names = [
        name
        for name, method in METHODS.items()
        if (method.needs == "" or (method.needs == "tare" and session.tare is not None))
        and (name != "hybrid" or _has_hybrid(session.arm))
    ]
    return tuple(names) if session.identifier.method in names else (session.identifier.method, *names)


def _has_hybrid(arm: Arm) -> bool:
    try:
        return default_for(arm) == "hybrid"
    except ModelError:  # its file is missing: reported when the method is chosen
        return True


def _done(client: Any, title: str, action: Any) -> bool:
    """Do what was asked for at the page; False, with a notification there, if it failed."""
    try:
        action()
    except ArmloadError as error:
        client.add_notification(title, str(error), color="red", auto_close_seconds=10.0)
        return False
    return True
