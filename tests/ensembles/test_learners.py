"""Ensembles: one list of checks over every implementation, then what each kind promises of its own."""

import signal

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.tree import DecisionTreeRegressor
from sklearn.utils.estimator_checks import check_estimator, estimator_checks_generator

from armload.ensembles import BaggingEnsemble, MixedEnsemble, NetworkLearner, TreeLearner, TwoStage, network
from armload.ensembles.checkpoint import Weights
from armload.ensembles.compiled import CompiledNetworks
from armload.ensembles.network import _fold, plateaued
from armload.ensembles.tree import compile_trees
from armload.ensembles.weak_learner import INITIAL_WEIGHTS, SHUFFLE, Scaling, draw_bag
from armload.errors import ModelError

UNITS = np.array([1.0, 0.1, 0.1, 0.1] + [1e-3] * 6)  # the sizes of kg, kg·m and kg·m² in a payload


def rows(seed: int, n: int = 240, d: int = 22) -> tuple[np.ndarray, np.ndarray]:
    """Features with the offsets of gravity torque, and ten outputs of a payload's sizes, linear in them."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n, d)) * rng.uniform(0.1, 10, size=d) + rng.uniform(-40, 40, size=d)
    mixing = np.random.default_rng(99).normal(size=(d, 10)) / 5
    return X, (1.5 + (X - X.mean(axis=0)) / X.std(axis=0) @ mixing) * UNITS


SMALL = NetworkLearner(hidden=12, max_epochs=4, batch=64)
ENSEMBLES = {
    "tree": BaggingEnsemble("tree", members=3),
    "network": BaggingEnsemble(SMALL, members=3),
    "two-stage tree": TwoStage("tree", members=3),
    "two-stage network": TwoStage(SMALL, members=3),
    "mixed": MixedEnsemble(("tree", SMALL), members=2),
}


# two stages of networks are the two stages of trees, and networks, which JAX compiles anew for each stage
DEAR = {"two-stage network": pytest.mark.full}


@pytest.fixture(params=[pytest.param(name, marks=DEAR.get(name, ())) for name in ENSEMBLES], scope="module")
def fitted(request):
    ensemble = clone(ENSEMBLES[request.param])
    return ensemble.fit(*rows(0), *rows(1, 60))


# ---------------------------------------------------------------------- every implementation


def test_fit_returns_the_ensemble_and_predicts_ten_outputs_per_row(fitted):
    X, _ = rows(2, 7)
    mean, spread = fitted.predict(X, return_std=True)
    assert mean.shape == spread.shape == (7, 10)
    assert np.isfinite(mean).all()
    assert (spread >= 0).all()
    assert (spread > 0).any()
    np.testing.assert_array_equal(fitted.predict(X), mean)


def test_mean_and_spread_are_those_of_the_members(fitted):
    X, _ = rows(2, 7)
    members = fitted.compiled_.members(X)
    assert members.shape == (fitted.compiled_.n_members, 7, 10)
    mean, spread = fitted.predict(X, return_std=True)
    np.testing.assert_allclose(mean, sum(members) / len(members), rtol=1e-12)
    by_hand = np.sqrt(sum((m - mean) ** 2 for m in members) / (len(members) - 1))
    np.testing.assert_allclose(spread, by_hand, rtol=1e-9, atol=1e-15)


def test_one_row_alone_equals_the_row_in_a_batch(fitted):
    X, _ = rows(2, 50)
    batch = fitted.predict(X)
    single = np.concatenate([fitted.predict(X[k : k + 1]) for k in range(len(X))])
    np.testing.assert_allclose(single, batch, rtol=1e-11, atol=1e-14)


def test_the_path_for_one_row_equals_the_batch(fitted):
    """To rounding, for every learner, with any number of features and of units."""
    X, _ = rows(2, 9)
    single = np.stack([fitted.compiled_.row(x) for x in X], axis=1)
    together = fitted.compiled_.members(X)
    np.testing.assert_allclose(single, together, rtol=0, atol=1e-12 * np.abs(together).max())


@pytest.mark.parametrize(("d", "h"), [(1, 1), (5, 8), (22, 13), (4, 500)])
def test_one_row_of_networks_of_any_size(d, h):
    rng = np.random.default_rng(d)
    networks = CompiledNetworks(*(rng.normal(size=s) for s in [(3, d, h), (3, h), (3, h, 4), (3, 4)]))
    x = rng.normal(size=d)
    np.testing.assert_allclose(networks.row(x), networks.members(x[None])[:, 0], rtol=0, atol=1e-12)


def test_the_same_seed_gives_the_same_ensemble_bit_for_bit(fitted):
    again = clone(fitted).fit(*rows(0), *rows(1, 60))
    X, _ = rows(2, 20)
    np.testing.assert_array_equal(again.compiled_.members(X), fitted.compiled_.members(X))


def test_another_seed_gives_another_ensemble(fitted):
    other = clone(fitted).set_params(seed=7).fit(*rows(0), *rows(1, 60))
    X, _ = rows(2, 20)
    assert not np.array_equal(other.predict(X), fitted.predict(X))


def test_clone_keeps_settings_and_forgets_the_fit(fitted):
    copy = clone(fitted)
    assert repr(copy) == repr(fitted)
    assert not hasattr(copy, "compiled_")
    with pytest.raises(ValueError, match="not fitted"):
        copy.predict(np.zeros((1, 22)))


def test_fit_leaves_its_input_alone(fitted):
    data = (*rows(0), *rows(1, 60))
    before = [a.copy() for a in data]
    clone(fitted).fit(*data)
    for a, b in zip(data, before, strict=True):
        np.testing.assert_array_equal(a, b)


def test_predictions_carry_the_units_of_y(fitted):
    """Scaled training must scale back: a kilogram given in grams gives the same kilogram."""
    X, y = rows(0)
    Xv, yv = rows(1, 60)
    grams = clone(fitted).fit(X, 1024 * y, Xv, 1024 * yv)  # a power of two: the scaled data are the same to the bit
    np.testing.assert_allclose(grams.predict(X) / 1024, fitted.predict(X), rtol=1e-9, atol=1e-12)


def test_an_output_that_never_changed_is_given_back(fitted):
    """The container's Ixy is the same in all 77 loadings: no ensemble may wander from it, whatever the features say."""
    X, y = rows(0)
    y[:, 5] = 0.0123
    X[:, 3] = -7.7
    ensemble = clone(fitted).fit(X, y, X, y)
    np.testing.assert_allclose(ensemble.predict(rows(2, 50)[0])[:, 5], 0.0123, rtol=1e-12)


def test_an_unfinished_pair_of_validation_rows_is_refused(fitted):
    with pytest.raises(ModelError, match="X_val and y_val go together"):
        clone(fitted).fit(*rows(0), rows(1, 60)[0])


# ---------------------------------------------------------------------- scikit-learn's own contract


def test_scikit_learns_own_checks_pass_for_trees():
    results = check_estimator(BaggingEnsemble("tree", members=2), on_skip=None)  # a failed check raises
    assert sum(r["status"] == "passed" for r in results) > 40
    assert {r["check_name"] for r in results if r["status"] != "passed"} <= {
        "check_array_api_input",  # skipped without SCIPY_ARRAY_API
        "check_regressor_data_not_an_array",  # skipped without pandas
    }


@pytest.mark.full  # each of them compiles networks of its own; trees pass all of scikit-learn's checks above
@pytest.mark.parametrize(
    "name",
    [
        "check_regressors_train",
        "check_regressor_multioutput",
        "check_fit_idempotent",
        "check_estimators_pickle",
        "check_estimators_nan_inf",
        "check_fit2d_1sample",
        "check_methods_subset_invariance",
    ],
)
def test_scikit_learns_checks_of_fit_and_predict_pass_for_networks(name):
    """Those that depend on the learner; the rest sees what all share, and JAX compiles per shape."""
    learner = NetworkLearner(hidden=8, max_epochs=20, patience=20, learning_rate=0.1, batch=20)
    ensemble = BaggingEnsemble(learner, members=1)
    checks = [c for _, c in estimator_checks_generator(ensemble) if getattr(c, "func", c).__name__ == name]
    assert checks
    for check in checks:
        check(ensemble)


def test_unknown_settings_are_named():
    X, y = rows(0, 20)
    with pytest.raises(ModelError, match="unknown kind of learner 'forest': expected one of tree, network"):
        BaggingEnsemble("forest").fit(X, y)
    with pytest.raises(ModelError, match="unknown scale 'log'"):
        BaggingEnsemble("tree", scale="log").fit(X, y)
    with pytest.raises(ModelError, match="members is 0"):
        BaggingEnsemble("tree", members=0).fit(X, y)
    with pytest.raises(ModelError, match="max_epochs is 0"):
        BaggingEnsemble(NetworkLearner(max_epochs=0)).fit(X, y)
    for setting, wrong in (("hidden", 2.5), ("batch", "8"), ("learning_rate", -1e-3), ("learning_rate", float("nan"))):
        with pytest.raises(ModelError, match=f"{setting} is {wrong!r}"):
            BaggingEnsemble(NetworkLearner(max_epochs=1, **{setting: wrong})).fit(X, y)
    with pytest.raises(ModelError, match="kinds of a mixed ensemble are none"):
        MixedEnsemble(()).fit(X, y)
    with pytest.raises(ModelError, match="expects the ten of phi"):
        TwoStage("tree").fit(X, y[:, :4])
    for setting, wrong in (("members", 2.5), ("members", "3"), ("seed", None), ("hold_out", 1.0), ("hold_out", -0.1)):
        with pytest.raises(ModelError, match=f"{setting} is {wrong!r}"):
            BaggingEnsemble("tree", **{setting: wrong}).fit(X, y)
    with pytest.raises(ModelError, match=r"unknown kind of learner \['tree'\]"):
        BaggingEnsemble(["tree"]).fit(X, y)


def test_however_much_is_held_out_a_row_is_left_to_train_on():
    X, y = rows(0, 20)
    bag = draw_bag(X, y, None, members=2, seed=0, bootstrap=True, scale="standard", hold_out=0.99)
    assert (len(bag.X), len(bag.X_val)) == (1, 19)


def test_one_member_has_no_spread_to_show():
    X, y = rows(0, 30)
    _, spread = BaggingEnsemble("tree", members=1).fit(X, y).predict(X, return_std=True)
    assert np.isinf(spread).all()


# ---------------------------------------------------------------------- the bag


def test_every_member_draws_its_own_rows_with_replacement():
    X, y = rows(0, 400)
    bag = draw_bag(X, y, rows(1, 100), members=5, seed=3, bootstrap=True, scale="standard", hold_out=0.15)
    assert bag.rows.shape == (5, 400)
    assert bag.rows_val.shape == (5, 100)
    assert len({tuple(r) for r in bag.rows}) == len({tuple(r) for r in bag.rows_val}) == 5
    distinct = np.mean([len(np.unique(r)) / 400 for r in bag.rows])
    assert abs(distinct - (1 - np.exp(-1))) < 0.03  # 63 % of the rows, as drawing with replacement gives


def test_members_do_not_depend_on_how_many_there_are():
    X, y = rows(0)
    few = BaggingEnsemble("tree", members=2).fit(X, y)
    many = BaggingEnsemble("tree", members=4).fit(X, y)
    np.testing.assert_array_equal(many.compiled_.members(X)[:2], few.compiled_.members(X))


def test_rows_held_out_for_validation_do_not_train():
    X, y = rows(0, 100)
    bag = draw_bag(X, y, None, members=2, seed=0, bootstrap=True, scale="none", hold_out=0.15)
    assert len(bag.X_val) == 15
    assert len(bag.X) == 85
    together = np.concatenate([bag.X, bag.X_val])
    assert len(np.unique(together, axis=0)) == 100


# ---------------------------------------------------------------------- trees


@pytest.mark.parametrize("scale", ["standard", "none"])
def test_trees_memorise_their_training_rows_without_bootstrap(scale):
    X, y = rows(0)
    ensemble = BaggingEnsemble("tree", bootstrap=False, scale=scale).fit(X, y)
    np.testing.assert_allclose(ensemble.predict(X), y, rtol=0, atol=1e-13)


def test_compiled_trees_decide_as_scikit_learns():
    X, y = rows(0, 500)
    trees = [DecisionTreeRegressor(random_state=k, max_depth=d).fit(X, y) for k, d in enumerate([None, 4, 1])]
    compiled = compile_trees(trees)
    thresholds = [t.tree_.threshold[t.tree_.feature >= 0] for t in trees]
    # Rows that sit on the thresholds, and one float32 step either side: where a rounded threshold would show.
    on = np.repeat(np.concatenate(thresholds)[:, None], X.shape[1], axis=1).astype(np.float32)
    probes = np.concatenate([rows(2, 300)[0], on, np.nextafter(on, np.float32(np.inf)), np.nextafter(on, -on)])
    for m, tree in enumerate(trees):
        np.testing.assert_array_equal(compiled.members(probes)[m], tree.predict(probes))
    with pytest.raises(ModelError, match=f"expected {X.shape[1]} columns"):
        compiled.predict(X[:, 1:])


def test_scaling_lets_small_outputs_shape_the_splits():
    """A column in SI units of kg·m² is invisible to splits beside one in kg; scaled, both are learnt."""
    rng = np.random.default_rng(0)
    X = rng.uniform(size=(400, 2))
    y = np.stack([np.sign(X[:, 0] - 0.5), 1e-3 * np.sign(X[:, 1] - 0.5)], axis=1)
    y[:, 0] += 0.1 * rng.normal(size=400)
    shallow = TreeLearner(max_depth=2)
    errors = {}
    for scale in ("standard", "none"):
        ensemble = BaggingEnsemble(shallow, scale=scale).fit(X, y)
        errors[scale] = np.abs(ensemble.predict(X) - y)[:, 1].mean() / 1e-3
    assert errors["standard"] < 0.1
    assert errors["none"] > 0.5


# ---------------------------------------------------------------------- networks


def test_a_network_learns_a_linear_map_to_three_percent():
    X, y = rows(0, 1200, 5)
    learner = NetworkLearner(hidden=64, max_epochs=80, batch=50)
    ensemble = BaggingEnsemble(learner, members=3).fit(X[:1000], y[:1000], X[1000:], y[1000:])
    error = np.abs(ensemble.predict(X[1000:]) - y[1000:]).mean(axis=0) / y.std(axis=0)
    assert error.max() < 0.03, error


def test_folded_numpy_networks_equal_the_trained_jax_networks():
    import jax.numpy as jnp

    rng = np.random.default_rng(0)
    X, y = rows(0, 50, 4)
    s = Scaling.of(X, y, "standard")
    w = Weights(*(rng.normal(size=shape) for shape in ((3, 4, 16), (3, 16), (3, 16, 10), (3, 10))))
    compiled = _fold(w, s)
    x = jnp.asarray((X - s.x_mean) / s.x_scale, dtype=jnp.float32)
    for m in range(3):
        hidden = jnp.maximum(x @ jnp.float32(w.W1[m]) + jnp.float32(w.b1[m]), 0)
        expected = np.asarray(hidden @ jnp.float32(w.W2[m]) + jnp.float32(w.b2[m])) * s.y_scale + s.y_mean
        np.testing.assert_allclose(compiled.members(X)[m], expected, rtol=2e-5, atol=2e-5 * s.y_scale.max())


def test_two_epochs_equal_adam_written_out_by_hand():
    """Batched JAX epochs against a plain numpy Adam; the last batch is not full, each epoch has its own order."""
    X, y = rows(0, 50, 4)
    learner = NetworkLearner(hidden=6, batch=16, max_epochs=2, learning_rate=0.01)
    ensemble = BaggingEnsemble(learner, members=2, seed=5, scale="none").fit(X / 10, y, X / 10, y)
    assert (np.diff(ensemble.losses_, axis=0) < 0).all()  # so the weights kept are those after the second epoch
    bag = draw_bag(X / 10, y, (X / 10, y), members=2, seed=5, bootstrap=True, scale="none", hold_out=0.15)
    for m in range(2):
        rng = np.random.default_rng([5, m, INITIAL_WEIGHTS])
        a, b = np.sqrt(6 / 10), np.sqrt(6 / 16)
        w = [rng.uniform(-a, a, (4, 6)), np.zeros(6), rng.uniform(-b, b, (6, 10)), np.zeros(10)]
        first, second = [np.zeros_like(p) for p in w], [np.zeros_like(p) for p in w]
        orders = [np.random.default_rng([5, m, SHUFFLE, e]).permutation(bag.rows[m]) for e in (0, 1)]
        batches = [order[start : start + 16] for order in orders for start in range(0, 50, 16)]
        for step, chosen in enumerate(batches, start=1):
            x, target = X[chosen] / 10, y[chosen]
            z = x @ w[0] + w[1]
            h = np.maximum(z, 0)
            e = 2 * (h @ w[2] + w[3] - target) / target.size
            back = (e @ w[2].T) * (z > 0)
            for k, g in enumerate((x.T @ back, back.sum(0), h.T @ e, e.sum(0))):
                first[k] = 0.9 * first[k] + 0.1 * g
                second[k] = 0.999 * second[k] + 0.001 * g * g
                w[k] = w[k] - 0.01 * first[k] / (1 - 0.9**step) / (np.sqrt(second[k] / (1 - 0.999**step)) + 1e-8)
        trained = ensemble.compiled_
        for name, mine in zip(("W1", "b1", "W2", "b2"), w, strict=True):
            np.testing.assert_allclose(getattr(trained, name)[m], mine, rtol=0, atol=2e-4)  # steps are 1e-2, float32


def test_the_kept_weights_are_those_of_the_lowest_validation_loss():
    X, y = rows(0, 60)
    Xv, yv = rows(1, 40)
    learner = NetworkLearner(hidden=64, max_epochs=40, batch=8, learning_rate=0.02)
    ensemble = BaggingEnsemble(learner, members=3, seed=2).fit(X, y, Xv, yv)
    bag = draw_bag(X, y, (Xv, yv), members=3, seed=2, bootstrap=True, scale="standard", hold_out=0.15)
    error = (ensemble.compiled_.members(Xv) - yv) / bag.scaling.y_scale
    for m in range(3):
        assert np.nanargmin(ensemble.losses_[:, m]) < ensemble.epochs_[m] - 1  # it did overfit: the case is a case
        loss = np.mean(error[m][bag.rows_val[m]] ** 2)
        assert loss == pytest.approx(np.nanmin(ensemble.losses_[:, m]), rel=1e-4)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("patience", [1, 3, 10])
def test_the_stopping_rule_agrees_with_brute_force(seed, patience):
    """Stop after the first epoch e whose best so far is not 1 % better than the best of p epochs earlier."""
    rng = np.random.default_rng(seed)
    losses = np.exp(-np.arange(200) / rng.uniform(5, 60)) + 0.1 * rng.uniform(size=200) + 0.05
    losses[rng.integers(200, size=5)] = np.nan

    def brute() -> int:
        best = []
        for e in range(200):
            lowest = np.inf
            for value in losses[: e + 1]:
                if value < lowest:  # False for NaN
                    lowest = value
            best.append(lowest)
            if e >= patience and best[e] > 0.99 * best[e - patience]:
                return e + 1
        return 200

    stopped = next((e for e in range(1, 201) if plateaued(losses[:e], patience, 0.01)), 200)
    assert stopped == brute()
    assert stopped < 200


@pytest.mark.full  # the rule itself has quick tests above
def test_training_stops_by_the_rule_for_every_member():
    X, y = rows(0, 60)
    learner = NetworkLearner(hidden=16, max_epochs=200, batch=20, learning_rate=0.01, patience=3, tolerance=1e-2)
    ensemble = BaggingEnsemble(learner, members=2, seed=1).fit(X, y, *rows(1, 40))
    assert len(set(ensemble.epochs_.tolist())) > 1  # members stop at epochs of their own
    for m, epochs in enumerate(ensemble.epochs_):
        losses = ensemble.losses_[:, m]
        assert np.isfinite(losses[:epochs]).all()
        assert np.isnan(losses[epochs:]).all()
        assert plateaued(losses[:epochs], 3, 1e-2)
        assert not any(plateaued(losses[:e], 3, 1e-2) for e in range(1, epochs))


@pytest.mark.parametrize("stop_after", [1, 5, 9])
def test_an_interrupted_training_goes_on_exactly(tmp_path, stop_after):
    X, y = rows(0, 60)
    Xv, yv = rows(1, 40)
    learner = NetworkLearner(hidden=16, max_epochs=12, batch=20, learning_rate=0.02, patience=3, tolerance=1e-1)
    ensemble = BaggingEnsemble(learner, members=2)
    whole = clone(ensemble).fit(X, y, Xv, yv)
    assert min(whole.epochs_) < 12  # some stop before the end, so that the checkpoint holds that too

    def interrupt(state):
        if state.done == stop_after:
            raise KeyboardInterrupt

    path = tmp_path / "training.npz"
    with pytest.raises(KeyboardInterrupt):
        clone(ensemble).fit(X, y, Xv, yv, checkpoint=path, progress=interrupt)
    epochs = []
    resumed = clone(ensemble).fit(X, y, Xv, yv, checkpoint=path, progress=lambda s: epochs.append(s.done))
    assert epochs == list(range(stop_after + 1, max(whole.epochs_) + 1))
    np.testing.assert_array_equal(resumed.compiled_.members(Xv), whole.compiled_.members(Xv))
    np.testing.assert_array_equal(resumed.losses_, whole.losses_)


def test_an_interruption_within_an_epoch_is_heard_once_that_is_whole_and_kept(tmp_path, monkeypatch):
    """Compiled code that still runs when Python ends takes the process with it."""
    X, y = rows(0, 60)
    epoch, loss = network._functions()

    def interrupted(*given):
        signal.raise_signal(signal.SIGINT)
        return epoch(*given)

    monkeypatch.setattr(network, "_functions", lambda: (interrupted, loss))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    path, ensemble = tmp_path / "training.npz", BaggingEnsemble(SMALL, members=2)
    try:
        with pytest.raises(KeyboardInterrupt):
            ensemble.fit(X, y, checkpoint=path)
    finally:
        signal.signal(signal.SIGINT, before)
    monkeypatch.undo()
    epochs = []
    ensemble.fit(X, y, checkpoint=path, progress=lambda s: epochs.append(s.done))
    assert epochs[0] == 2


def test_a_checkpoint_of_other_data_or_settings_is_refused(tmp_path):
    path = tmp_path / "training.npz"
    X, y = rows(0, 60)
    ensemble = BaggingEnsemble(SMALL, members=2).fit(X, y, checkpoint=path)
    for changed, data in ((ensemble, (X, y + 1)), (clone(ensemble).set_params(seed=1), (X, y))):
        with pytest.raises(ModelError, match="belongs to another training"):
            changed.fit(*data, checkpoint=path)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ModelError, match="is not a training checkpoint"):
        ensemble.fit(X, y, checkpoint=path)


def test_a_network_that_diverges_says_so():
    X, y = rows(0, 40)
    learner = NetworkLearner(hidden=4, max_epochs=3, learning_rate=1e38)
    with pytest.raises(ModelError, match=r"diverged.*lower learning_rate"):
        BaggingEnsemble(learner, members=2).fit(X, y)


# ---------------------------------------------------------------------- ensembles of ensembles


@pytest.mark.parametrize("kind", ["tree", pytest.param(SMALL, marks=pytest.mark.full)], ids=["tree", "network"])
def test_two_stages_equal_two_single_ensembles(kind):
    X, y = rows(0)
    Xv, yv = rows(1, 60)
    two = TwoStage(kind, members=3, seed=4).fit(X, y, Xv, yv)
    one = BaggingEnsemble(kind, members=3, seed=4)
    moments = clone(one).fit(X, y[:, :4], Xv, yv[:, :4]).predict(X, return_std=True)
    inertia = clone(one).fit(X, y[:, 4:], Xv, yv[:, 4:]).predict(X, return_std=True)
    for ours, *theirs in zip(two.predict(X, return_std=True), moments, inertia, strict=True):
        np.testing.assert_array_equal(ours, np.concatenate(theirs, axis=1))


def test_the_mixed_ensemble_averages_all_members_alike():
    X, y = rows(0)
    mixed = MixedEnsemble(("tree", SMALL), members=2, seed=4).fit(X, y, X, y)
    trees = BaggingEnsemble("tree", members=2, seed=4).fit(X, y, X, y).compiled_.members(X)
    networks = BaggingEnsemble(SMALL, members=2, seed=4).fit(X, y, X, y).compiled_.members(X)
    np.testing.assert_allclose(mixed.predict(X), (trees.sum(0) + networks.sum(0)) / 4, rtol=1e-12)


def test_progress_counts_every_tree_and_epoch():
    X, y = rows(0, 60)
    seen = []
    MixedEnsemble(("tree", SMALL), members=2).fit(X, y, progress=seen.append)
    assert [(s.label, s.done, s.total) for s in seen] == [
        *(("trees", k, 2) for k in (1, 2)),
        *(("networks", k, 4) for k in (1, 2, 3, 4)),
    ]


def test_the_progress_bar_leaves_the_standard_output_alone(capsys):
    X, y = rows(0, 60)
    bar = MixedEnsemble(("tree", SMALL), members=2).fit(X, y, progress=True)
    assert capsys.readouterr().out == ""
    quiet = MixedEnsemble(("tree", SMALL), members=2).fit(X, y)
    assert capsys.readouterr() == ("", "")
    np.testing.assert_array_equal(bar.predict(X), quiet.predict(X))
