"""Saved models and the stream: what comes back is what was saved, and it answers for its own arm and motion only."""

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import save_file

from armload.arms import arm as named_arm
from armload.ensembles import (
    BaggingEnsemble,
    LearnedIdentifier,
    MixedEnsemble,
    NetworkLearner,
    TwoStage,
    load_model,
    save_model,
)
from armload.errors import ArmloadError, IdentificationError, ModelError
from armload.inertia import InertialParameters
from armload.motion import MotionFingerprint, random_motion, taie2024
from armload.online import OnlineIdentifier
from armload.recording import Recording, Sample
from armload.runtime.content import content_digest

SMALL = NetworkLearner(hidden=8, max_epochs=2, batch=64)
ENSEMBLES = {
    "tree": BaggingEnsemble("tree", members=3),
    "network": BaggingEnsemble(SMALL, members=3),
    "two-stage tree": TwoStage("tree", members=3),
    "two-stage network": TwoStage(SMALL, members=3),
    "tree + network": MixedEnsemble(("tree", SMALL), members=2),
}


def log_of(motion, arm, *, seed=0, rate=100.0, start=3.0, **changes) -> Recording:
    """The motion at the arm's own torques plus noise, on a clock that does not start at 0."""
    t = np.arange(0, motion.duration, 1 / rate)
    q, dq, ddq = motion(t)
    tau = arm.torque(q, dq, ddq) + np.random.default_rng(seed).normal(size=q.shape)
    return dataclasses.replace(Recording(start + t, q, dq, tau, source="log.csv"), **changes)


def rows_of(log: Recording) -> np.ndarray:
    return np.column_stack([log.t - log.t[0], log.q, log.dq, log.tau])


@pytest.fixture(scope="module")
def log(panda):
    return log_of(taie2024(), panda)


# networks are in "tree + network", two stages in those of trees
DEAR = {name: pytest.mark.full for name in ("network", "two-stage network")}


@pytest.fixture(scope="module", params=[pytest.param(name, marks=DEAR.get(name, ())) for name in ENSEMBLES])
def saved(request, panda, log, tmp_path_factory):
    """(fitted ensemble, its file, the model loaded from it)."""
    rng = np.random.default_rng(1)
    X = rows_of(log)
    y = np.column_stack([X[:, 15:19], X[:, 1:7] * 1e-3]) + rng.normal(size=(len(X), 10)) * 1e-4
    ensemble = ENSEMBLES[request.param].fit(X, y)
    path = tmp_path_factory.mktemp("models") / "model.safetensors"
    save_model(path, ensemble, arm=panda, motion=taie2024(), dataset_hash="abc", notes="a test")
    return ensemble, path, load_model(path)


@pytest.fixture(scope="module")
def tree(panda, log, tmp_path_factory):
    """A small tree model and its file."""
    X = rows_of(log)[::4]
    y = np.column_stack([X[:, 15:19], X[:, 1:7]])
    path = tmp_path_factory.mktemp("tree") / "tree.safetensors"
    ensemble = BaggingEnsemble("tree", members=2).fit(X, y)
    return path, save_model(path, ensemble, arm=panda, motion=taie2024(), dataset_hash="abc")


# ---------------------------------------------------------------------- artefacts


def test_a_loaded_model_predicts_bit_for_bit_what_the_saved_one_did(saved, log):
    ensemble, _, model = saved
    X = rows_of(log)
    for ours, theirs in zip(model.predict(X, return_std=True), ensemble.predict(X, return_std=True), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_a_model_says_where_it_belongs(saved, panda):
    ensemble, _, model = saved
    assert (model.arm_name, model.arm_fingerprint, model.frame) == ("panda", panda.fingerprint, "panda_link8")
    assert model.motions == (MotionFingerprint.of(taie2024()),)
    assert (model.dataset_hash, model.notes, model.kind) == ("abc", "a test", ensemble.kind_name)
    assert model.features[:2] == ["t", "q1"]
    assert model.features[-1] == "tau7"
    assert len(model.features) == 22
    assert model.settings["seed"] == 0
    assert "scikit-learn" in model.versions
    np.testing.assert_array_equal(model.phi_mean, ensemble.y_mean_)
    np.testing.assert_array_equal(model.phi_std, ensemble.y_std_)
    assert "panda_link8" in str(model)


def test_saving_twice_writes_the_same_bytes_and_leaves_nothing_beside(saved, panda, tmp_path):
    ensemble, path, _ = saved
    again = tmp_path / "again.safetensors"
    save_model(again, ensemble, arm=panda, motion=MotionFingerprint.of(taie2024()), dataset_hash="abc", notes="a test")
    assert again.read_bytes() == path.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["again.safetensors"]


KINDS = [pytest.param(name, marks=[] if name == "tree + network" else pytest.mark.full) for name in ENSEMBLES]


@pytest.mark.parametrize("saved", KINDS, indirect=True)
def test_a_saved_model_predicts_without_the_libraries_that_trained_it(saved):
    _, path, model = saved
    program = (
        "import sys, numpy as np\n"
        "from armload.ensembles import load_model\n"
        f"phi = load_model({str(path)!r}).predict(np.ones((1, 22)))\n"
        "assert not {'sklearn', 'jax', 'torch'} & set(sys.modules), 'heavy library imported'\n"
        "print(phi.tolist())"
    )
    run = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    np.testing.assert_array_equal(json.loads(run.stdout), model.predict(np.ones((1, 22))))


@pytest.mark.full
def test_training_says_nothing_on_its_own(tmp_path):
    """No banner, warning or log of JAX reaches the user's terminal."""
    program = (
        "import numpy as np\n"
        "from armload.ensembles import BaggingEnsemble, NetworkLearner\n"
        "BaggingEnsemble(NetworkLearner(hidden=4, max_epochs=1), members=2).fit(np.eye(20), np.eye(20)[:, :2])"
    )
    run = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert not list(tmp_path.iterdir())


def test_a_cut_off_file_is_one_sentence(tree, tmp_path):
    whole, path = tree[0].read_bytes(), tmp_path / "model.safetensors"
    rng = np.random.default_rng(0)
    for length in [0, 1, 8, 9, 100, len(whole) - 1, *rng.integers(len(whole), size=40).tolist()]:
        path.write_bytes(whole[:length])
        with pytest.raises(ModelError, match=r"model.safetensors is not a readable model") as caught:
            load_model(path)
        assert "\n" not in str(caught.value)


def test_a_changed_byte_is_one_sentence(tree, tmp_path):
    """Wherever it is: in the sizes, in the header, in the motion's table, in a weight."""
    whole, path = tree[0].read_bytes(), tmp_path / "model.safetensors"
    rng = np.random.default_rng(0)
    header_end = 8 + int.from_bytes(whole[:8], "little")
    places = [*range(8), *rng.integers(8, header_end, size=60), *rng.integers(header_end, len(whole), size=60)]
    for at in map(int, places):
        changed = bytes([whole[at] ^ 0x04 if at >= 8 else whole[at] ^ 0xFF])
        path.write_bytes(whole[:at] + changed + whole[at + 1 :])
        with pytest.raises(ModelError, match=r"model\.safetensors") as caught:
            load_model(path)
        assert "\n" not in str(caught.value)
        assert at < header_end or "altered" in str(caught.value)


def test_other_files_are_refused_by_name(tmp_path):
    foreign = tmp_path / "foreign.safetensors"
    save_file({"W": np.zeros(3)}, foreign)
    with pytest.raises(ModelError, match=r"foreign.safetensors is no model: expected .* `armload train` wrote"):
        load_model(foreign)
    with pytest.raises(ModelError, match=r"no model at .*nothing.safetensors"):
        load_model(tmp_path / "nothing.safetensors")
    with pytest.raises(ModelError, match="not a readable model"):
        load_model(tmp_path)
    (tmp_path / "text.safetensors").write_text("t,q1,q2\n")
    with pytest.raises(ModelError, match="not a readable model"):
        load_model(tmp_path / "text.safetensors")


def rewritten(path, change, target):
    """The model at `path` changed on purpose: the SHA-256 fits again."""
    with safe_open(path, framework="np") as file:
        header = json.loads(file.metadata()["armload"])
        tensors = {k: file.get_tensor(k).copy() for k in file.keys()}  # noqa: SIM118
    header.pop("sha256")
    change(header, tensors)
    header["sha256"] = content_digest(header, tensors)
    save_file(tensors, target, {"armload": json.dumps(header)})
    return target


def test_a_model_without_its_sha_256_is_no_unaltered_one(tree, tmp_path):
    with safe_open(tree[0], framework="np") as file:
        header = json.loads(file.metadata()["armload"])
        tensors = {k: file.get_tensor(k) for k in file.keys()}  # noqa: SIM118
    for removed in ({k: v for k, v in header.items() if k != "sha256"}, header | {"sha256": None}):
        save_file(tensors, tmp_path / "bare.safetensors", {"armload": json.dumps(removed)})
        with pytest.raises(ModelError, match=r"bare\.safetensors was altered"):
            load_model(tmp_path / "bare.safetensors")


def test_a_model_of_members_that_armload_no_longer_has_is_said_to_be_of_another_version(tree, tmp_path):
    old = rewritten(tree[0], lambda h, _: h["structure"].update(type="support vectors"), tmp_path / "svr.safetensors")
    with pytest.raises(ModelError, match=r"svr\.safetensors belongs to another version of armload.*'support vectors'"):
        load_model(old)


CHANGES = {
    "a newer format": lambda h, _: h.update(format=2),
    "a walk that never ends": lambda _, t: t["left"].__setitem__(t["feature"] >= 0, 0),
    "a child outside": lambda _, t: t["right"].__setitem__(0, 10**6),
    "a leaf without a value": lambda _, t: t["left"].__setitem__(t["feature"] < 0, 10**6),
    "a feature that does not exist": lambda _, t: t["feature"].__setitem__(0, 22),
    "no roots": lambda _, t: t.pop("roots"),
    "a root outside": lambda _, t: t["roots"].__setitem__(0, -1),
    "another type": lambda _, t: t.__setitem__("threshold", t["threshold"].astype(np.float64)),
    "an unknown kind of part": lambda h, _: h["structure"].update(type="forest"),
    "no arm": lambda h, _: h.pop("arm"),
    "a damaged motion": lambda h, _: h["motions"][0]["q"][3].__setitem__(0, 9.0),
    "nine outputs": lambda _, t: t.__setitem__("values", t["values"][:, :9].copy()),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_model_that_does_not_fit_together_is_refused(change, tree, tmp_path):
    path = rewritten(tree[0], CHANGES[change], tmp_path / "odd.safetensors")
    with pytest.raises(ModelError, match=r"odd.safetensors"):
        load_model(path)


def test_only_payload_models_of_the_arm_can_be_saved(panda, tmp_path):
    keep = {"arm": panda, "motion": None, "dataset_hash": ""}
    with pytest.raises(ModelError, match="not fitted"):
        save_model(tmp_path / "m", BaggingEnsemble(), **keep)
    X = np.random.default_rng(0).normal(size=(20, 22))
    fitted = BaggingEnsemble().fit(X, X[:, :10])
    with pytest.raises(ModelError, match="22 features to 4 outputs"):
        save_model(tmp_path / "m", BaggingEnsemble().fit(X, X[:, :4]), **keep)
    with pytest.raises(ModelError, match="frame is 'tool'"):
        save_model(tmp_path / "m", fitted, frame="tool", **keep)
    with pytest.raises(ModelError, match="cannot be written"):
        save_model("/dev/null/m", fitted, **keep)
    assert not list(tmp_path.iterdir())


# ---------------------------------------------------------------------- whose answers a model gives


def test_a_model_refuses_another_arm_frame_tool_torque_or_motion(tree, panda, log):
    _, model = tree
    ur, hand = named_arm("ur10e"), log_of(taie2024(), panda)
    body = InertialParameters.from_com(0.7, (0, 0, 0.05), np.eye(3) * 1e-3)
    other_frame = dataclasses.replace(panda, frame="panda_link7")
    other_motion = log_of(random_motion(panda, 3), panda)
    model.check(panda, log)
    cases = [
        (ur, None, "was trained on panda .7 joints.: it cannot answer for ur10e"),
        (other_frame, None, "about 'panda_link8': panda is set to 'panda_link7'"),
        (panda.with_payload(body), None, "attached tool differ"),
        (dataclasses.replace(panda, gravity=(0.0, 9.81, 0.0)), None, "gravity"),
        (panda, dataclasses.replace(hand, channel="external"), "holds external torque"),
        (panda, other_motion, "does not follow a motion"),
        (panda, log.between(4.0, 9.0), "does not follow a motion"),
    ]
    for arm, recording, message in cases:
        with pytest.raises(ModelError, match=message) as caught:
            model.check(arm, recording)
        assert "\n" not in str(caught.value)


def test_a_model_of_several_motions_takes_each_and_one_of_none_takes_any(panda, log, tmp_path):
    X = rows_of(log)[::4]
    fitted = BaggingEnsemble(members=2).fit(X, X[:, :10])
    other, third = random_motion(panda, 3), random_motion(panda, 4)
    several = save_model(tmp_path / "a", fitted, arm=panda, motion=[taie2024(), other], dataset_hash="")
    for motion in (taie2024(), other):
        several.check(panda, log_of(motion, panda))
    with pytest.raises(ModelError, match="does not follow"):
        several.check(panda, log_of(third, panda))
    free = save_model(tmp_path / "b", fitted, arm=panda, motion=None, dataset_hash="")
    free.check(panda, log_of(third, panda))


def test_a_model_is_shown_on_payloads_of_its_own_data_set_only_where_they_are_new_to_it(panda, log, tmp_path):
    X = rows_of(log)[::4]
    fitted, keep = BaggingEnsemble(members=2).fit(X, X[:, :10]), {"arm": panda, "motion": None, "dataset_hash": "own"}
    model = save_model(tmp_path / "a", fitted, payloads=[3, 1, 3], **keep)
    assert model.payloads == (1, 3)
    model.check_new("own", [0, 2, 2])
    model.check_new("another", [1])
    with pytest.raises(ModelError, match="learned from 1 of the 2 payloads that are to be new to it"):
        model.check_new("own", [0, 1, 1])
    silent = save_model(tmp_path / "b", fitted, **keep)
    silent.check_new("another", [1])
    with pytest.raises(ModelError, match="does not say from which of its payloads"):
        silent.check_new("own", [0])


def test_rows_of_another_width_are_refused(tree):
    with pytest.raises(ModelError, match=r"expects 22 columns \(t, q1 … tau7\)"):
        tree[1].predict(np.zeros((3, 21)))


# ---------------------------------------------------------------------- the stream


def test_the_stream_is_the_cumulative_average_of_the_batch(saved, panda, log):
    model = saved[2]
    predicted = model.predict(rows_of(log))
    averages = np.cumsum(predicted, axis=0) / np.arange(1, len(log) + 1)[:, None]
    trace = LearnedIdentifier(model, panda).trace(log)
    np.testing.assert_allclose([e.phi for e in trace], averages, rtol=1e-9, atol=1e-12)
    assert [e.n_samples for e in trace] == list(range(1, len(log) + 1))
    np.testing.assert_array_equal([e.t for e in trace], log.t)
    members = model.compiled.members(rows_of(log)).mean(axis=1)  # (M, 10)
    np.testing.assert_allclose(trace[-1].std, members.std(axis=0, ddof=1), rtol=1e-7, atol=1e-12)
    assert trace[-1].frame == "panda_link8"


def test_a_single_sample_gives_the_prediction_of_its_row(saved, panda, log):
    model = saved[2]
    mean, spread = model.predict(rows_of(log), return_std=True)
    trace = LearnedIdentifier(model, panda, single=True).trace(log)
    np.testing.assert_allclose([e.phi for e in trace], mean, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose([e.std for e in trace], spread, rtol=1e-7, atol=1e-12)


def test_the_stream_keeps_constant_memory(saved, panda, log):
    identifier = LearnedIdentifier(saved[2], panda)

    def size() -> int:
        own = {k: v for k, v in vars(identifier).items() if k not in ("model", "arm")}
        return sum(v.nbytes if isinstance(v, np.ndarray) else sys.getsizeof(v) for v in own.values())

    samples = list(log)
    for sample in samples[:10]:
        identifier.update(sample)
    after_ten = size()
    for sample in samples[10:]:
        identifier.update(sample)
    assert size() <= after_ten + 8  # an integer counter may widen


def test_reset_forgets_everything(saved, panda, log):
    identifier = LearnedIdentifier(saved[2], panda)
    first = [e.phi for e in identifier.trace(log, every=50)]
    again = [e.phi for e in identifier.trace(log, every=50)]
    np.testing.assert_array_equal(first, again)


def test_the_stream_passes_over_what_is_not_a_number(tree, panda, log):
    """Before the first good sample it knows the training mean and no more; after it, a bad sample changes nothing."""
    model = tree[1]
    identifier = LearnedIdentifier(model, panda)
    good = next(iter(log))
    bad = Sample(good.t - 0.01, good.q * np.nan, good.dq, good.tau)
    before = identifier.update(bad)
    np.testing.assert_array_equal(before.phi, model.phi_mean)
    assert np.isinf(before.std).all()
    assert before.n_samples == 0
    expected = LearnedIdentifier(model, panda).update(good)
    estimate = identifier.update(good)
    assert estimate.n_samples == 1
    np.testing.assert_array_equal(estimate.phi, expected.phi)
    after = identifier.update(bad)
    np.testing.assert_array_equal(after.phi, estimate.phi)
    assert (after.n_samples, after.t) == (1, estimate.t)


def test_the_stream_refuses_a_sample_of_another_size(tree, panda):
    with pytest.raises(IdentificationError, match="expected 7 numbers each"):
        LearnedIdentifier(tree[1], panda).update(Sample(0.0, np.zeros(6), np.zeros(7), np.zeros(7)))


def test_a_live_identifier_answers_as_the_stream_and_goes_on_from_a_file(saved, panda, log, tmp_path):
    model, samples = saved[1], list(log)[:80]
    expected = LearnedIdentifier(saved[2], panda).trace(log)[79]
    online = OnlineIdentifier(panda, method=model)
    for sample in samples[:50]:
        online.update(*sample)
    restored = OnlineIdentifier.restore(online.save(tmp_path / "state.npz"), panda, model)
    for each in (online, restored):
        for sample in samples[50:]:
            estimate = each.update(*sample)
        np.testing.assert_array_equal(estimate.phi, expected.phi)
        np.testing.assert_array_equal(estimate.covariance, expected.covariance)
        assert estimate.n_samples == 80


def test_a_live_identifier_s_state_is_refused_with_another_ensemble_or_the_hybrid(saved, panda, log, tmp_path):
    online = OnlineIdentifier(panda, method=saved[1])
    for sample in list(log)[:20]:
        online.update(*sample)
    path = online.save(tmp_path / "state.npz")

    def change(_, tensors):
        array = next(array for array in tensors.values() if array.dtype.kind == "f")
        array.flat[0] += 1.0

    for method in (rewritten(saved[1], change, tmp_path / "other.safetensors"), None):
        with pytest.raises(IdentificationError, match="its trained model"):
            OnlineIdentifier.restore(path, panda, method)


def test_the_stream_refuses_another_arm_at_once_and_another_motion_on_a_recording(tree, panda):
    model = tree[1]
    with pytest.raises(ModelError, match="cannot answer for ur10e"):
        LearnedIdentifier(model, named_arm("ur10e"))
    elsewhere = log_of(random_motion(panda, 3), panda)
    with pytest.raises(ArmloadError, match="does not follow a motion"):
        LearnedIdentifier(model, panda).run(elsewhere)
    anyway = LearnedIdentifier(model, panda, any_motion=True).run(elsewhere)
    assert anyway.n_samples == len(elsewhere)


# ---------------------------------------------------------------------------- error bars


def test_error_bars_rest_on_held_out_payloads_and_not_on_the_members_agreement(panda, tmp_path):
    """Trees that agree to the gram may be wrong together: the interval must know."""
    from armload.identification import identify
    from armload.lab.dataset import build_dataset, split_payloads
    from armload.lab.evaluation import held_out_error
    from armload.motion import taie2024
    from armload.payloads import container_loadings
    from armload.simulation import simulate

    motion, loadings = taie2024(), container_loadings()[::8]
    dataset = build_dataset(tmp_path / "data", panda, [motion], loadings, rows_per_run=60, progress=False)
    split = split_payloads(dataset, 0, (0.7, 0.0, 0.3))
    bag = BaggingEnsemble("tree", members=3, seed=0).fit(dataset.X[split.train], dataset.y[split.train])
    error = held_out_error(bag, dataset, split.test)

    by_hand = []
    for run in np.unique(dataset.run[split.test]):
        rows = np.flatnonzero(dataset.run == run)
        by_hand.append(bag.predict(dataset.X[rows]).mean(axis=0) - dataset.truth(run).phi)
    assert error == pytest.approx(np.sqrt(np.mean(np.square(by_hand), axis=0)))

    where = {"arm": panda, "motion": motion, "dataset_hash": dataset.hash}
    known = save_model(tmp_path / "known.safetensors", bag, **where, error_std=error)
    save_model(tmp_path / "unknown.safetensors", bag, **where)
    assert np.array_equal(load_model(tmp_path / "known.safetensors").error_std, error)
    for wrong in (error[:3], -error, np.full(10, np.nan)):
        with pytest.raises(ModelError, match="expected 10 finite numbers, none below 0"):
            save_model(tmp_path / "known.safetensors", bag, **where, error_std=wrong)
    assert np.array_equal(load_model(tmp_path / "known.safetensors").error_std, error)  # the file stayed as it was

    log = simulate(panda, motion, dataset.truth(int(dataset.run[split.test][0])), rate=100.0)
    answer = identify(log, panda, method=tmp_path / "known.safetensors")
    half = 0.5 * (np.array(answer.phi_high) - answer.phi_low)[np.array(answer.determined)]
    assert np.all(half >= 1.95 * error[np.array(answer.determined)])
    assert np.all(LearnedIdentifier(known, panda).run(log).std >= error)
    assert not any(identify(log, panda, method=tmp_path / "unknown.safetensors").determined)
