"""The page of a motion: the arm stands where the motion says, among what stands around."""

import urllib.request
from types import SimpleNamespace

import numpy as np
import pytest

from armload.app.cli import main
from armload.app.page.motion_page import MotionPage
from armload.arms import arm
from armload.errors import MotionError
from armload.excitation import Obstacle, Surroundings
from armload.motion import taie2024

BOX = Obstacle((0.6, 0.0, 0.2), (0.1, 0.2, 0.4))


@pytest.fixture
def page(panda):
    pytest.importorskip("viser", reason="the page needs viser")
    page = MotionPage(taie2024(), panda, Surroundings(panda, boxes=(BOX,)), port=0)
    yield page
    page.close()


@pytest.mark.parametrize("t", [0.0, 1.7, 6.0])
def test_the_arm_stands_where_the_motion_says_and_the_numbers_are_of_that_instant(page, panda, t):
    page.show(t)
    q, dq, _ = (x[0] for x in taie2024()([t]))
    _, place = panda.frame_pose(q[None])
    np.testing.assert_allclose(page.drawn.frames[-1].position, place[0], atol=1e-6)
    assert f"t = {t:.2f} s" in page.numbers.content
    assert all(f"{x:+.3f}" in page.numbers.content for x in (*q, *dq))
    near = Surroundings(panda, boxes=(BOX,)).clearance(q[None])[0]
    assert f"boxes {1000 * near[2]:.0f} mm" in page.numbers.content


def test_the_line_that_is_drawn_is_the_payload_frames_path(page, panda):
    points = page.path.points
    _, ends = panda.frame_pose(taie2024().position([0.0, 6.0]))
    np.testing.assert_allclose([points[0, 0], points[-1, 1]], ends, atol=1e-6)
    assert np.abs(np.diff(points, axis=1)).max() < 0.02  # no step between two points


def test_a_motion_goes_on_rests_and_begins_again(page):
    page.go_on(5.5)
    assert "t = 5.50 s" in page.numbers.content
    page.go_on(1.0)
    assert "t = 6.00 s" in page.numbers.content
    page.go_on(1.0)
    assert "t = 0.00 s" in page.numbers.content


def test_a_motion_goes_on_whatever_a_client_sends(page):
    page._speed.value = "nonsense"
    (moved,) = page._time._impl.update_cb
    moved(SimpleNamespace(client=object(), target=SimpleNamespace(value=float("nan"))))
    page.go_on(1.5)
    assert "t = 1.50 s" in page.numbers.content


def test_the_page_is_served_and_a_motion_of_another_arm_is_refused(page):
    with urllib.request.urlopen(page.url, timeout=30) as answer:
        assert b"<html" in answer.read(2000).lower()
    with pytest.raises(MotionError, match="moves 7 joints: ur10e has 6"):
        MotionPage(taie2024(), arm("ur10e"), port=0)


def test_what_is_of_the_page_is_refused_without_it(capsys):
    assert main(["motion", "show", "taie2024", "--box", "0.6,0,0.2,0.1,0.2,0.4"]) == 2
    assert "there is no --page" in capsys.readouterr().err
