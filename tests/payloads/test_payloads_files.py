"""Payload files: what is written reads back, and what cannot be used says in one sentence what is wrong."""

import json
import os
import stat

import numpy as np
import pytest
import trimesh

from armload.errors import PayloadError
from armload.inertia import InertialParameters
from armload.payloads import (
    Payload,
    container_loadings,
    franka_hand,
    random_payload,
    read_payload,
    solids,
    write_payload,
)
from armload.payloads.uncertainty import Uncertainty
from armload.runtime.atomic import replacing

HAND = franka_hand().parameters


@pytest.mark.parametrize("payload", [franka_hand(), random_payload(4), container_loadings()[40]], ids=lambda p: p.name)
def test_a_written_payload_reads_back_to_the_last_bit(tmp_path, payload):
    write_payload(tmp_path / "p.json", payload)
    back = read_payload(tmp_path / "p.json")
    assert np.array_equal(back.parameters.phi, payload.parameters.phi)
    assert (back.name, back.parameters.frame, back.boxes) == (payload.name, payload.parameters.frame, payload.boxes)


def test_nothing_is_a_payload_that_reads_back(tmp_path):
    write_payload(tmp_path / "p.json", Payload("nothing", InertialParameters.zero("tool0")))
    assert not read_payload(tmp_path / "p.json").parameters.phi.any()


def write(tmp_path, content):
    path = tmp_path / "p.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_a_file_may_name_a_mesh_beside_it_and_how_well_the_drawing_is_known(tmp_path):
    trimesh.creation.box((40.0, 60.0, 100.0)).export(tmp_path / "gear.stl")
    turned = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    about = {"mesh": "gear.stl", "scale": 1e-3, "translation": [0.0, 0.0, 0.05], "rotation": turned, "frame": "tool0"}
    read = read_payload(write(tmp_path, about | {"mass": 0.6, "std": {"mass": 0.01, "com": 1e-3, "inertia": 0.02}}))
    box = solids.box((0.06, 0.04, 0.1), mass=0.6, translation=(0.0, 0.0, 0.05))
    assert read.parameters.phi == pytest.approx(box.phi, abs=1e-9)
    assert (read.name, read.parameters.frame) == ("p", "tool0")
    assert read.uncertainty == Uncertainty(0.01, 1e-3, 0.02)
    dense = read_payload(write(tmp_path, about | {"density": 2500.0}))
    assert dense.parameters.mass == pytest.approx(0.6)
    for wrong, said in (
        (about, "neither mass nor density"),
        (about | {"mass": 0.6, "com": [0, 0, 0]}, "has a mesh and com"),
        (about | {"mass": 0.6, "scale": 0.0}, "scale of the mesh"),
        ({"mass": 0.6, "com": [0, 0, 0.05], "scale": 1e-3}, "has scale, but no mesh"),
        (about | {"mass": 0.6, "mesh": "none.stl"}, "none.stl does not exist"),
        (about | {"mass": 0.6, "translation": [0, 0]}, "translation"),
        (about | {"mass": 0.6, "translation": [0, 0, 50]}, "is it in millimetres"),
    ):
        with pytest.raises(PayloadError, match=said):
            read_payload(write(tmp_path, wrong))


def test_the_result_of_an_identification_reads_as_the_payload_it_found(tmp_path):
    result = {
        "method": "least squares",
        "frame": "panda_link8",
        "phi": HAND.phi.tolist(),
        "mass": round(HAND.mass, 4),
        "com": HAND.com.round(5).tolist(),
        "inertia_com": HAND.inertia_com.round(6).tolist(),
        "intervals": [[0, 1]] * 10,
        "warnings": [],
        "interval": "approximate",
        "com_low": [0.0, 0.0, 0.0],
    }
    read = read_payload(write(tmp_path, result))
    assert np.array_equal(read.parameters.phi, HAND.phi)
    assert (read.name, read.parameters.frame) == ("p", "panda_link8")
    del result["phi"]
    np.testing.assert_allclose(read_payload(write(tmp_path, result)).parameters.phi, HAND.phi, atol=2e-5)


TRIPLE = {"mass": 1.0, "com": [0, 0, 0.1], "inertia_com": [[1e-3, 0, 0], [0, 1e-3, 0], [0, 0, 1e-3]]}
PHI = InertialParameters.from_com(1.0, TRIPLE["com"], TRIPLE["inertia_com"]).phi.tolist()


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "is empty"),
        ("{", "is not JSON.*line 1"),
        ("mass: 1", "is not JSON"),
        ("[" * 100_000, "cannot be read as JSON"),
        ("[1, 2]", "holds a JSON list"),
        ({}, "lacks mass and com and inertia_com.*no keys at all"),
        ({"mass": 1}, "lacks com and inertia_com.*found: mass"),
        ({"mass": 1, "com": [0, 0, 100]}, "100 m from the frame.*millimetres"),
        ({"mass": -1, "com": [0, 0, 0]}, "mass of -1 kg: expected a mass above 0"),
        ({"phi": [1, 2, 3]}, r"phi is \[1, 2, 3\], expected 10 numbers"),
        ({"phi": "heavy"}, "expected 10 numbers"),
        ({"phi": [*PHI[:9], "x"]}, "expected 10 numbers"),
        ({"phi": [*PHI[:9], True]}, "expected 10 numbers"),
        ({"phi": [*PHI[:9], float("nan")]}, "expected 10 numbers, finite"),
        ({"phi": [*PHI[:9], 10**400]}, "expected 10 numbers, finite"),
        ({"phi": [[1, 2], 3]}, "expected 10 numbers"),
        ({"phi": [*PHI[:8], None, None]}, "leaves Iyz, Izz undetermined"),
        ({**TRIPLE, "mass": "1 kg"}, 'mass is "1 kg", expected a number'),
        ({**TRIPLE, "mass": -1}, "mass of -1 kg"),
        ({**TRIPLE, "mass": 0}, "mass of 0 kg"),
        ({**TRIPLE, "com": [0, 0]}, "com is .*expected 3 numbers"),
        ({**TRIPLE, "com": [0, 0, 100]}, "100 m from the frame.*millimetres"),
        ({**TRIPLE, "inertia_com": [[9, 0, 0], [0, 9, 0], [0, 0, 9]]}, r"inertia of a body .* m wide.*kg·m²"),
        ({**TRIPLE, "inertia_com": [1, 2, 3]}, "inertia_com is .*expected 3 rows of 3 numbers"),
        ({**TRIPLE, "inertia_com": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]}, r"p\.json: inertia_com is not symmetric"),
        ({**TRIPLE, "inertia_com": [[1, 0, 0], [0, 1, 0], [0, 0, 3]]}, "cannot exist.*1, 1, 3"),
        ({**TRIPLE, "phi": [2 * x for x in PHI]}, "contradicts itself: its mass"),
        ({**TRIPLE, "com": [0, 0, 0.2], "phi": PHI}, "contradicts itself: its com"),
        ({"mass": 1, "com": [0, 0, 0.1], "inertia": TRIPLE["inertia_com"]}, "key 'inertia': expected 'inertia_com'"),
        ({**TRIPLE, "frame_id": "tool0"}, "key 'frame_id': expected 'frame'"),
        ({**TRIPLE, "frame": 8}, "frame is 8, expected text"),
        ({**TRIPLE, "boxes": [{"size": [1, 2]}]}, "boxes are not a list"),
        ({**TRIPLE, "boxes": 7}, "boxes are not a list"),
    ],
)
def test_a_payload_file_that_cannot_be_used_says_why_in_one_sentence(tmp_path, content, says):
    with pytest.raises(PayloadError, match=says) as caught:
        read_payload(write(tmp_path, content))
    message = str(caught.value)
    assert "p.json" in message
    assert "\n" not in message
    assert len(message) < 500


def test_a_payload_file_may_begin_with_a_byte_order_mark(tmp_path):
    (tmp_path / "tool.json").write_text('{"mass": 0.4, "com": [0, 0, 0.05]}', encoding="utf-8-sig")
    assert read_payload(tmp_path / "tool.json").parameters.mass == 0.4


def test_a_payload_file_that_is_not_there_or_not_text_says_so(tmp_path):
    with pytest.raises(PayloadError, match="does not exist"):
        read_payload(tmp_path / "none.json")
    with pytest.raises(PayloadError, match="is a folder"):
        read_payload(tmp_path)
    (tmp_path / "b.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PayloadError, match="is not text"):
        read_payload(tmp_path / "b.json")
    with pytest.raises(PayloadError, match="cannot be written"):
        write_payload(tmp_path / "no" / "p.json", franka_hand())


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("part.stl", '"mesh": "part.stl"'),
        ("Part.STL", '"mesh": "Part.STL"'),
        ("part.step", r'save it as a mesh .*"mesh": "part.stl"'),
    ],
)
def test_a_drawing_in_the_place_of_a_payload_file_says_how_to_name_it_in_one(tmp_path, name, says):
    drawing = tmp_path / name
    drawing.write_bytes(b"solid part \xff\xfe")
    with pytest.raises(PayloadError, match=f"is a drawing.*{says}") as caught:
        read_payload(drawing)
    assert "\n" not in str(caught.value)


def test_what_a_link_points_to_is_replaced_and_the_link_stays(tmp_path):
    (tmp_path / "there").mkdir()
    target, far, link = tmp_path / "there" / "p.json", tmp_path / "far.json", tmp_path / "link.json"
    target.write_text("old")
    far.symlink_to(target)
    link.symlink_to("far.json")
    write_payload(link, franka_hand())
    assert (link.is_symlink(), far.is_symlink(), target.is_symlink()) == (True, True, False)
    np.testing.assert_array_equal(read_payload(target).parameters.phi, HAND.phi)
    target.unlink()
    write_payload(link, franka_hand())  # a link to nothing is where the file appears
    np.testing.assert_array_equal(read_payload(target).parameters.phi, HAND.phi)
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["far.json", "link.json", "p.json", "there"]


def test_a_pipe_is_written_into_and_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    kept = os.open(pipe, os.O_RDWR)  # so that nobody waits for ever if the pipe is replaced
    try:
        write_payload(pipe, franka_hand())
        assert stat.S_ISFIFO(pipe.stat().st_mode)
        os.set_blocking(kept, False)
        read = os.read(kept, 65536)
    finally:
        os.close(kept)
    write_payload(tmp_path / "p.json", franka_hand())
    assert read == (tmp_path / "p.json").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["p.json", "pipe"]


def test_a_device_is_written_into_and_stays_a_device(tmp_path):
    ours, theirs = os.openpty()  # a terminal: not even root can put a file in its place
    try:
        link = tmp_path / "terminal.json"
        link.symlink_to(os.ttyname(theirs))
        write_payload(link, franka_hand())
        assert link.is_symlink()
        assert stat.S_ISCHR(link.stat().st_mode)
        shown = ""
        while not shown.rstrip().endswith("}"):  # a terminal hands on what it has
            shown += os.read(ours, 65536).decode()
    finally:
        os.close(ours)
        os.close(theirs)
    np.testing.assert_array_equal(json.loads(shown)["phi"], HAND.phi)


def test_a_folder_that_is_missing_is_said_under_the_name_that_was_given(tmp_path):
    for path in (tmp_path / "no" / "p.json", tmp_path, tmp_path / "round"):
        if path.name == "round":
            path.symlink_to(path)
        with pytest.raises(PayloadError, match="cannot be written") as caught:
            write_payload(path, franka_hand())
        assert str(path) in str(caught.value)
        with pytest.raises(OSError) as raised, replacing(path):  # noqa: PT011
            pass
        assert raised.value.filename == str(path)
    assert [p.name for p in tmp_path.iterdir()] == ["round"]


def test_of_mass_and_centre_alone_the_inertia_is_a_ball_s_and_said_to_be_unknown(tmp_path):
    path, copy = tmp_path / "gripper.json", tmp_path / "copy.json"
    path.write_text(json.dumps({"mass": 0.9, "com": [0.01, 0.0, 0.06], "frame": "tool0"}))
    found = read_payload(path)
    radius = (3 * 0.9 / 1000 / (4 * np.pi)) ** (1 / 3)
    assert (found.name, found.inertia_known, found.parameters.frame) == ("gripper", False, "tool0")
    assert found.parameters.inertia_com == pytest.approx(0.4 * 0.9 * radius**2 * np.eye(3), abs=1e-12)
    write_payload(copy, found)
    assert "phi" not in json.loads(copy.read_text())
    assert read_payload(copy).parameters.phi == pytest.approx(found.parameters.phi, abs=1e-15)
    assert not read_payload(copy).inertia_known
