"""The server of a page (viser): on this machine only or behind a token, silent, looking at the arm."""

from __future__ import annotations

import contextlib
import importlib
import io
import logging
import math
import secrets
import socket
from collections.abc import Callable
from typing import Any
from urllib.parse import quote

from armload.app.page.token_door import TokenDoor
from armload.errors import UsageError
from armload.runtime.extras import install
from armload.service.access import is_loopback

# [length of all links] from what is looked at to the eye: the whole arm is seen, or the payload and the wrist
_FROM_AFAR, _FROM_CLOSE = (0.7, -0.7, 0.28), (0.3, -0.3, 0.12)
_PHONE = 576  # [px] of width below which viser shows all panels as one sheet, over the lower 60 % of the picture
_FARTHER = 1.6  # times as far on a phone, whose picture is narrow and whose sheet hides the lower part
_SAME = 1e-3  # [m] between two places of the eye that are the same one
_HIGHER, _A_LITTLE_HIGHER = 0.3, 0.2  # of the picture's height above its middle: the middle of what a sheet leaves


class PageServer:
    """A viser server that listens at once, behind a `TokenDoor`: beyond this machine only to who brings a token.

    Args:
        host: the interface to listen on. port: if it is taken, the next free one; 0: any. label: title of the page.
        token: of 16 characters or more, that lets in; None: one is drawn for a host beyond loopback, none is asked for
            on this machine. otherwise: what whoever has no viser can do instead of installing it.

    Attributes:
        viser: viser's own server. label: title of the page. url: where to find the page, with the token that lets in.

    Raises:
        UsageError: viser is not installed, or there is no such interface.
    """

    def __init__(
        self, host: str, port: int, label: str, token: str | None = None, otherwise: str = "use --headless"
    ) -> None:
        self.label = label
        try:
            viser: Any = importlib.import_module("viser")
        except ImportError:
            hint = install("viser")
            raise UsageError(f"the page needs viser, which is not installed: {hint}; or {otherwise}") from None
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            socket.create_server((host, 0), family=family).close()  # viser would try one port after another, for ever
        except OSError as error:
            raise UsageError(f"no page can be served at {host!r}: {error.strerror or error}; try 127.0.0.1") from None
        # what a stranger's request is not is told with a traceback, where a terminal shows what armload says
        logging.getLogger("websockets").setLevel(logging.CRITICAL)
        with contextlib.redirect_stdout(io.StringIO()):
            self.viser = viser.ViserServer("127.0.0.1", 0, label, verbose=False)
        # the page leaves this machine only if somebody forwards it
        self.viser.request_share_url = lambda *_, **__: None
        if token is None and not is_loopback(host):
            token = secrets.token_urlsafe(24)
        self._door: TokenDoor | None = None
        try:
            self._door = TokenDoor(host, port, self.viser.get_port(), token)
        except UsageError:
            self.stop()
            raise
        name = socket.gethostname() if host in ("", "0.0.0.0", "::") else f"[{host}]" if ":" in host else host
        self.url = f"http://{name}:{self._door.port}" + ("" if token is None else f"/?token={quote(token)}")

    def stop(self) -> None:
        """Stop serving."""
        if self._door is not None:
            self._door.close()
        with contextlib.redirect_stdout(io.StringIO()):  # viser says goodbye on stdout
            self.viser.stop()


def look_at_arm(server: Any, reach: float) -> None:
    """Where whoever opens the page looks from: at an arm of a length [m], without the maker's logo."""
    middle = (0.15 * reach, 0.0, 0.32 * reach)
    server.initial_camera.position = (0.85 * reach, -0.7 * reach, 0.6 * reach)
    server.initial_camera.look_at = middle
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    _on_phones(
        server, lambda camera: _look(camera, middle, (0.85 * reach, -0.7 * reach, 0.28 * reach), _A_LITTLE_HIGHER)
    )


def look_at_middle(server: Any, reach: float) -> None:
    """The same at a payload that stays at the origin, close to it: of the arm there is what it hangs on."""
    server.initial_camera.position = tuple(reach * x for x in _FROM_CLOSE)
    server.initial_camera.look_at = (0.0, 0.0, 0.0)
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    _on_phones(server, lambda camera: look_from(camera, reach, True))


def _on_phones(server: Any, look: Callable[[Any], None]) -> None:
    """How a phone looks at first, and whenever it is sent back to where others begin.

    A browser goes there when it has drawn its first picture, which may be after it was told to look otherwise.
    """

    @server.on_client_connect
    def _(client: Any) -> None:
        if client.camera.image_width < _PHONE:
            look(client.camera)

            @client.camera.on_update
            def _(camera: Any) -> None:
                if math.dist(camera.position, server.initial_camera.position) < _SAME:
                    look(client.camera)


def look_from(camera: Any, reach: float, close: bool) -> None:
    """Look at the origin: close if the payload is there, or else from as far as the whole arm of a length [m] needs."""
    x, y, z = (reach * x for x in (_FROM_CLOSE if close else _FROM_AFAR))
    _look(camera, (0.0, 0.0, 0.0), (x, y, z))


def _look(
    camera: Any, at: tuple[float, float, float], away: tuple[float, float, float], higher: float = _HIGHER
) -> None:
    """Look at a point [m] from another, so far away from it.

    On a phone, whose lower part shows the numbers, from farther and at a point below: what is looked at is in the upper
    part then.
    """
    phone = camera.image_width < _PHONE
    x, y, z = ((_FARTHER if phone else 1.0) * d for d in away)
    seen = 2.0 * math.hypot(x, y, z) * math.tan(0.5 * camera.fov)  # [m] from the lower edge to the upper one
    below = higher * seen if phone else 0.0
    camera.position = (at[0] + x, at[1] + y, at[2] + z - below)
    camera.look_at = (at[0], at[1], at[2] - below)
