"""The Fourier motion against finite differences and closed forms, and its files against themselves."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from armload.errors import MotionError
from armload.motion import FourierMotion, load_motion, save_motion, start_and_stop_at_rest, taie2024

coefficient = st.floats(-2, 2, allow_subnormal=False)


@st.composite
def motions(draw):
    shape = draw(st.integers(1, 7)), draw(st.integers(2, 8))
    return FourierMotion(
        draw(arrays(float, shape[0], elements=coefficient)),
        draw(arrays(float, shape, elements=coefficient)),
        draw(arrays(float, shape, elements=coefficient)),
        draw(st.floats(1, 20)),
    )


def test_equation_5_and_6_term_by_term():
    rng = np.random.default_rng(1)
    q0, rho, delta, T, t = rng.normal(size=3), rng.normal(size=(3, 4)), rng.normal(size=(3, 4)), 6.0, 1.234
    expected = [
        q0[i]
        + sum(
            rho[i, k - 1] * np.sin(2 * np.pi * k / T * t) + delta[i, k - 1] * np.cos(2 * np.pi * k / T * t)
            for k in range(1, 5)
        )
        for i in range(3)
    ]
    np.testing.assert_allclose(FourierMotion(q0, rho, delta, T)([t])[0][0], expected, rtol=0, atol=1e-14)


@given(motions())
@settings(max_examples=30, deadline=None)
def test_each_derivative_is_the_central_difference_of_the_one_before(motion):
    t, h = np.linspace(0.1, 0.9, 17) * motion.duration, 1e-5 * motion.duration
    for order in range(3):
        difference = (motion.derivative(t + h, order) - motion.derivative(t - h, order)) / (2 * h)
        exact = motion.derivative(t, order + 1)
        # the central difference errs by h²/6 of the third derivative, and by rounding
        size = 4 * motion.harmonics * (2 * np.pi * motion.harmonics / motion.period) ** (order + 1) + 1
        np.testing.assert_allclose(difference, exact, rtol=0, atol=1e-5 * size)
    np.testing.assert_array_equal(motion.jerk(t), motion.derivative(t, 3))


@given(motions())
@settings(max_examples=30, deadline=None)
def test_parseval_the_mean_square_over_a_period_is_half_the_sum_of_squares(motion):
    t = np.arange(64) * motion.period / 64  # exact for harmonics below 32
    for order in range(4):
        omega = (2 * np.pi * np.arange(1, motion.harmonics + 1) / motion.period) ** order
        energy = 0.5 * np.sum(omega**2 * (motion.sine**2 + motion.cosine**2), axis=1)
        value = motion.derivative(t, order) - (motion.offset if order == 0 else 0.0)
        np.testing.assert_allclose(np.mean(value**2, axis=0), energy, rtol=1e-9, atol=1e-12)


@given(motions())
@settings(max_examples=30, deadline=None)
def test_smooth_motions_start_and_stop_at_rest_without_acceleration(motion):
    q, dq, ddq = motion.smooth()([0.0, motion.duration])
    size = (2 * np.pi * motion.harmonics / motion.period) ** 2 * 4 * motion.harmonics + 1
    np.testing.assert_allclose(dq, 0.0, atol=1e-13 * size)
    np.testing.assert_allclose(ddq, 0.0, atol=1e-13 * size)
    np.testing.assert_allclose(q[0], q[1], atol=1e-12)


@given(motions())
@settings(max_examples=30, deadline=None)
def test_the_projection_is_orthogonal_and_idempotent(motion):
    once = start_and_stop_at_rest(motion.sine, motion.cosine)
    for x, y in zip(once, start_and_stop_at_rest(*once), strict=True):
        np.testing.assert_allclose(x, y, atol=1e-13)
    k = np.arange(1, motion.harmonics + 1)
    # what is taken away is along the constraint's normal: nothing nearer satisfies it
    for before, after, normal in ((motion.sine, once[0], k), (motion.cosine, once[1], k**2)):
        removed = before - after
        np.testing.assert_allclose(removed * (normal @ normal), np.outer(removed @ normal, normal), atol=1e-8)


def test_before_the_start_and_after_the_end_the_arm_waits():
    motion = taie2024()
    q, dq, ddq = motion([-1.0, 0.0, 6.0, 9.0])
    np.testing.assert_array_equal(q[0], q[1])
    np.testing.assert_array_equal(q[2], q[3])
    assert not dq[[0, 3]].any()
    assert not ddq[[0, 3]].any()
    assert not motion.jerk([-1.0, 9.0]).any()


def test_a_scaled_motion_keeps_its_mean_and_scales_its_speed():
    motion, factor = taie2024(), np.linspace(0.1, 0.7, 7)
    t = np.arange(50) * 6.0 / 50
    np.testing.assert_allclose(motion.scaled(factor)(t)[1], motion(t)[1] * factor, atol=1e-12)
    np.testing.assert_allclose(motion.scaled(factor)(t)[0].mean(axis=0), motion.offset, atol=1e-12)


@given(motions())
@settings(max_examples=20, deadline=None)
def test_a_saved_motion_comes_back_bit_for_bit(tmp_path_factory, motion):
    path = tmp_path_factory.mktemp("motion") / "m.json"
    save_motion(path, motion)
    back = load_motion(path)
    for key in ("offset", "sine", "cosine", "period", "name", "note"):
        np.testing.assert_array_equal(getattr(back, key), getattr(motion, key))


GOOD = {"format": "armload-motion-1", "name": "m", "period": 6, "offset": [0], "sine": [[1, 2]], "cosine": [[1, 2]]}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not JSON"),
        ("[1, 2]", "armload-motion-1"),
        (json.dumps({**GOOD, "format": "other"}), "armload-motion-1"),
        (json.dumps({k: v for k, v in GOOD.items() if k != "sine"}), "'sine' is missing"),
        (json.dumps({**GOOD, "sine": [[1, 2], [3]]}), "sine"),
        (json.dumps({**GOOD, "sine": [[1, "x"]]}), "sine"),
        (json.dumps({**GOOD, "sine": [[1, 2, 3]]}), "sine"),
        (json.dumps({**GOOD, "offset": [0, 1]}), "offset"),
        (json.dumps({**GOOD, "offset": [float("nan")]}), "offset"),
        (json.dumps({**GOOD, "period": -6}), "period"),
        (json.dumps({**GOOD, "period": None}), "period"),
    ],
)
def test_a_bad_motion_file_is_one_sentence_that_names_it(tmp_path, text, says):
    path = tmp_path / "broken.json"
    path.write_text(text)
    with pytest.raises(MotionError, match=says) as caught:
        load_motion(path)
    assert "broken.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_or_binary_motion_file_is_one_sentence(tmp_path):
    with pytest.raises(MotionError, match="does not exist"):
        load_motion(tmp_path / "none.json")
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(MotionError, match="not UTF-8"):
        load_motion(tmp_path / "binary.json")
    with pytest.raises(MotionError, match="cannot be read"):
        load_motion(tmp_path)
    with pytest.raises(MotionError, match="cannot be written"):
        save_motion(tmp_path / "no" / "folder.json", taie2024())


def test_saving_leaves_nothing_else_behind(tmp_path):
    save_motion(tmp_path / "m.json", taie2024())
    save_motion(tmp_path / "m.json", taie2024().scaled(0.5))
    assert [p.name for p in tmp_path.iterdir()] == ["m.json"]
    np.testing.assert_array_equal(load_motion(tmp_path / "m.json").sine, taie2024().scaled(0.5).sine)
