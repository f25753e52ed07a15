"""Support-vector regression as a learner: the same machines as scikit-learn's, saved without a pickle."""

import dataclasses

import numpy as np
import pytest
from sklearn.svm import SVR

from armload.ensembles import (
    BaggingEnsemble,
    LearnedIdentifier,
    SupportVectorLearner,
    TwoStage,
    load_model,
    save_model,
)
from armload.ensembles.bag import Scaling
from armload.errors import ModelError
from armload.motion import taie2024
from armload.recording import Recording

SMALL = SupportVectorLearner(cap=150, jobs=1)


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(400, 4)) * [1.0, 10.0, 0.1, 1.0] + [0.0, 50.0, 0.0, 0.0]
    y = np.column_stack([np.sin(X[:, 0]), 1e-3 * (X[:, 1] - 50.0) * X[:, 3], np.full(400, 0.7)])
    return X, y


def test_each_machine_is_scikit_learn_s_own_on_the_rows_its_member_drew(data):
    X, y = data
    ensemble = BaggingEnsemble(SMALL, members=2, seed=3).fit(X, y)
    scaling = Scaling.of(X, y, "standard")
    Z, Y = scaling.features(X), scaling.outputs(y)  # to the bit: libsvm stops at 1e-3
    said = ensemble.compiled_.members(X[:50])
    for m in range(2):
        drawn = np.random.default_rng([3, m, 0]).integers(400, size=400)
        rows = drawn[np.sort(np.random.default_rng([3, m, 6]).choice(400, 150, replace=False))]
        for output in range(2):
            machine = SVR(kernel="rbf", C=10.0, epsilon=0.05, gamma=0.25).fit(Z[rows], Y[rows, output])
            expected = y.mean(axis=0)[output] + y.std(axis=0)[output] * machine.predict(Z[:50])
            assert said[m, :, output] == pytest.approx(expected, rel=1e-9, abs=1e-12)
        assert said[m, :, 2] == pytest.approx(0.7)  # an output that does not vary is its mean


def test_it_learns_what_the_mean_does_not_know(data):
    X, y = data
    error = y[300:] - BaggingEnsemble(SMALL, members=3).fit(X[:300], y[:300]).predict(X[300:])
    assert np.all(error[:, :2].std(axis=0) < 0.5 * y[300:, :2].std(axis=0))


def test_the_cap_bounds_the_rows_and_the_seed_decides_which(data):
    X, y = data
    first, again, other = (BaggingEnsemble(SMALL, members=2, seed=s).fit(X, y).compiled_ for s in (1, 1, 2))
    assert first.rows.shape[1] <= 150
    assert np.array_equal(first.weights, again.weights)
    assert not np.array_equal(first.predict(X), other.predict(X))
    few = BaggingEnsemble(SMALL, members=1).fit(X[:40], y[:40]).compiled_
    assert few.rows.shape[1] <= 40


def test_one_row_predicts_as_it_does_among_many(data):
    X, y = data
    compiled = BaggingEnsemble(SMALL, members=2).fit(X, y).compiled_
    together = compiled.members(np.tile(X, (2, 1)))  # more rows than one block
    for k in (0, 399, 400):
        assert compiled.members(X[k % 400][None])[:, 0] == pytest.approx(together[:, k], rel=1e-9)


@pytest.mark.parametrize("ensemble", [BaggingEnsemble(SMALL, members=2), TwoStage(SMALL, members=2)])
def test_a_saved_model_answers_as_before_and_is_a_stream_identifier(ensemble, panda, tmp_path):
    motion = taie2024()
    t = np.arange(0, motion.duration, 0.02)
    q, dq, ddq = motion(t)
    log = Recording(t, q, dq, panda.torque(q, dq, ddq))
    X = np.column_stack([t, q, dq, log.tau])
    y = np.column_stack([X[:, 15:19], 1e-3 * X[:, 1:7]])
    path = tmp_path / "svr.safetensors"
    save_model(path, ensemble.fit(X, y), arm=panda, motion=motion, dataset_hash="abc")
    model = load_model(path)
    assert model.kind.endswith("svr")
    assert np.array_equal(model.predict(X), ensemble.predict(X))
    assert LearnedIdentifier(model, panda).run(log).phi == pytest.approx(ensemble.predict(X).mean(axis=0), abs=1e-9)


def test_arrays_from_a_file_that_do_not_fit_are_refused(data):
    X, y = data
    compiled = BaggingEnsemble(SMALL, members=2).fit(X, y).compiled_
    compiled.validate()
    for wrong in (
        {"weights": compiled.weights[:, :-1]},
        {"rows": np.full_like(compiled.rows, np.nan)},
        {"gamma": -compiled.gamma},
        {"bias": compiled.bias.astype(np.float32)},
        {"per_x": compiled.per_x[None]},
    ):
        with pytest.raises(ValueError, match="support vectors"):
            dataclasses.replace(compiled, **wrong).validate()


@pytest.mark.parametrize("setting", [{"cap": 1}, {"C": 0.0}, {"epsilon": -0.1}, {"gamma": 0.0}])
def test_settings_out_of_range_are_refused(setting, data):
    with pytest.raises(ModelError, match="support vectors with"):
        BaggingEnsemble(SupportVectorLearner(**setting), members=1).fit(*data)
