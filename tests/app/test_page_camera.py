"""Where a page is looked at from: on a phone from farther, and of what its sheet leaves of the picture the middle."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload.app.page.server import look_at_arm, look_at_middle, look_from


class Camera(SimpleNamespace):
    """A browser's camera."""

    def on_update(self, callback):
        self.moved = callback
        return callback


class Server:
    """What is asked of viser's server, and of the one browser that comes."""

    def __init__(self, width):
        self.initial_camera, self.camera = SimpleNamespace(), Camera(image_width=width, fov=1.3, moved=None)
        self.gui = SimpleNamespace(configure_theme=lambda **_: None)

    def on_client_connect(self, callback):
        self.camera.position, self.camera.look_at = self.initial_camera.position, self.initial_camera.look_at
        callback(SimpleNamespace(camera=self.camera))
        return callback


@pytest.mark.parametrize("look", [look_at_arm, look_at_middle])
def test_a_phone_that_is_sent_to_where_others_begin_looks_again_as_phones_do(look):
    look(server := Server(390), 1.0)
    camera, begin = server.camera, server.initial_camera.position
    first = camera.position
    assert np.linalg.norm(first) > 1.2 * np.linalg.norm(begin)
    camera.position = tuple(np.array(begin) + 1e-5)  # its first picture came after it was told
    camera.moved(camera)
    assert camera.position == first
    camera.position = (9.0, 9.0, 9.0)  # somebody turned it
    camera.moved(camera)
    assert camera.position == (9.0, 9.0, 9.0)


@pytest.mark.parametrize("look", [look_at_arm, look_at_middle])
def test_a_wide_screen_begins_where_the_page_says(look):
    look(server := Server(1280), 1.0)
    assert server.camera.position == server.initial_camera.position
    assert server.camera.moved is None


@pytest.mark.parametrize("width", [390, 1280])
def test_what_is_looked_at_is_in_the_middle_of_what_a_phones_sheet_leaves_of_the_picture(width):
    """From farther on a phone, whose picture is narrow; along the same line, so that left and right stay so."""
    camera = SimpleNamespace(image_width=width, fov=1.3)
    look_from(camera, 1.0, True)
    eye, at = np.array(camera.position), np.array(camera.look_at)
    along = (at - eye) / np.linalg.norm(at - eye)
    assert np.linalg.norm(eye - at) == pytest.approx((1.6 if width < 576 else 1.0) * np.sqrt(0.3**2 + 0.3**2 + 0.12**2))
    right = np.cross(along, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(along, [0.0, 0.0, 1.0]))
    up = np.cross(right, along)
    share = (-eye @ up) / (-eye @ along) / np.tan(0.5 * camera.fov)  # of the origin: 0 the middle, 1 the upper edge
    assert -eye @ right == pytest.approx(0.0, abs=1e-12)
    assert (0.3 < share < 0.9) if width < 576 else share == pytest.approx(0.0, abs=1e-12)
