"""Networks over windows: what each architecture is, that bags learn, and that the seed decides everything."""

from functools import cache

import numpy as np
import pytest

from armload.ensembles import WindowNetworks
from armload.ensembles.window_networks import ARCHITECTURES, _functions
from armload.errors import ModelError

SMALL = {"members": 2, "width": 8, "steps": 200, "batch": 16}


@pytest.fixture(scope="module")
def windows():
    """Windows of two waves; the outputs are what a mean over time and a difference in time can tell."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(300, 12, 3)).cumsum(axis=1)
    return X, np.column_stack([X[:, :, 0].mean(axis=1), 1e-3 * np.abs(np.diff(X[:, :, 1], axis=1)).mean(axis=1)])


@pytest.fixture(scope="module")
def bags(windows):
    """A trained bag of an architecture, by its name; one that nobody asks for is not trained."""
    return cache(lambda name: WindowNetworks(name, **SMALL, learning_rate=1e-2).fit(*windows))


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.full  # some seconds
def test_every_architecture_learns_more_than_the_mean(bags, windows, architecture):
    X, y = windows
    error = np.abs(bags(architecture).predict(X) - y).mean(axis=0)
    assert error[0] < 0.75 * np.abs(y - y.mean(axis=0)).mean(axis=0)[0]


def test_the_same_seed_gives_the_same_bag_and_another_seed_another(bags, windows):
    X, y = windows
    same, other = (WindowNetworks("conv", **SMALL, learning_rate=1e-2, seed=s).fit(X, y) for s in (0, 1))
    np.testing.assert_array_equal(same.predict(X), bags("conv").predict(X))
    assert np.abs(other.predict(X) - same.predict(X)).max() > 0.0


def test_members_see_their_own_draw_and_the_answer_is_their_mean(bags, windows):
    bag, X = bags("gru"), windows[0][:5]
    each = np.asarray(_functions("gru")[2](bag.weights_, bag._scaled(X)), dtype=float)
    assert np.abs(each[0] - each[1]).max() > 0.0
    np.testing.assert_allclose(bag.predict(X), bag.y_mean_ + bag.y_scale_ * each.mean(axis=0), rtol=1e-6)


def test_units_of_inputs_and_outputs_do_not_matter(windows, bags):
    X, y = windows
    units, outputs = np.array([1e3, 1e-3, 5.0]), np.array([2.0, 1e4])
    scaled = WindowNetworks("conv", **SMALL, learning_rate=1e-2).fit(X * units + 7.0, y * outputs - 3.0)
    np.testing.assert_allclose((scaled.predict(X * units + 7.0) + 3.0) / outputs, bags("conv").predict(X), rtol=0.05)


def test_a_gated_recurrent_unit_is_that_of_its_equations():
    """h = z·h + (1 − z)·tanh(Wx + b + r·(Uh + c)), r and z logistic: written anew in numpy."""
    rng, w = np.random.default_rng(1), 4
    shapes = {"Wx": (3, 3 * w), "Wh": (w, 3 * w), "b": (3 * w,), "b_new": (w,), "W_hidden": (w, w), "b_hidden": (w,)}
    shapes |= {"W_out": (w, 2), "b_out": (2,)}
    p = {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}
    x = rng.normal(size=(1, 6, 3)).astype(np.float32)
    h, all_h = np.zeros(w), []
    for given in x[0]:
        a, b = given @ p["Wx"] + p["b"], h @ p["Wh"]
        r, z = (1.0 / (1.0 + np.exp(-(a + b)[k * w : (k + 1) * w])) for k in (0, 1))
        h = z * h + (1.0 - z) * np.tanh(a[2 * w :] + r * (b[2 * w :] + p["b_new"]))
        all_h.append(h)
    hidden = np.maximum(np.mean(all_h, axis=0) @ p["W_hidden"] + p["b_hidden"], 0.0)
    expected = hidden @ p["W_out"] + p["b_out"]
    found = _functions("gru")[2]({name: v[None] for name, v in p.items()}, x)
    np.testing.assert_allclose(np.asarray(found)[0, 0], expected, rtol=1e-4, atol=1e-5)


def test_a_convolution_answers_alike_wherever_in_a_window_something_happens(bags):
    answer, p = _functions("conv")[2], bags("conv").weights_
    still = np.zeros((1, 61, 3), np.float32)
    moved = still.copy()
    moved[0, 30] = 5.0
    found = np.asarray(answer(p, moved))
    np.testing.assert_allclose(found, answer(p, np.roll(moved, 4, axis=1)), rtol=1e-5, atol=1e-6)
    assert np.abs(found - np.asarray(answer(p, still))).max() > 1e-4


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"architecture": "lstm"}, "expected one of conv, gru, transformer"),
        ({"width": 10}, "expected a multiple of 4"),
    ],
)
def test_what_cannot_be_is_said(windows, settings, said):
    with pytest.raises(ModelError, match=said):
        WindowNetworks(**{**SMALL, **settings}).fit(*windows)


def test_rows_are_not_windows(windows):
    with pytest.raises(ModelError, match=r"expected \(N, T, c\) and \(N, k\)"):
        WindowNetworks(**SMALL).fit(windows[0][:, 0], windows[1])
