"""The stream contract: one list of checks over every identifier there is, learned or not."""

import contextlib
import dataclasses
import pickle
from xml.etree import ElementTree

import numpy as np
import pytest

from armload.arms import arm
from armload.ensembles import BaggingEnsemble, LearnedIdentifier, save_model
from armload.errors import ArmloadError, IdentificationError
from armload.estimators import CommandedLeastSquares, Identifier, RecursiveLeastSquares, Tared
from armload.identification import METHODS
from armload.inertia import InertialParameters
from armload.lab.evaluation import PriorLeastSquares, TrainingMean
from armload.motion import taie2024
from armload.posterior import HybridIdentifier, PosteriorLeastSquares, SmoothPosteriorLeastSquares
from armload.recording import Recording
from armload.regression import GaussianPrior, JointFeatures
from armload.simulation import simulate

BODY = InertialParameters.from_com(1.2, (0.02, -0.01, 0.06), np.diag([4e-3, 5e-3, 3e-3]))
PRIOR = GaussianPrior.of([BODY.phi, 1.4 * BODY.phi, 0.7 * BODY.phi])
RATE = 50.0  # [Hz]
FEW = JointFeatures(7, pose=16, velocity=4)


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def log(panda):
    return simulate(panda, taie2024(), BODY, rate=RATE)


@pytest.fixture(scope="module")
def short(log):
    """Its first three seconds: enough where one way to the same answer is held against another."""
    return log.select(slice(150))


@pytest.fixture(scope="module")
def empty(panda):
    return simulate(panda, taie2024(), rate=RATE)


@pytest.fixture(scope="module")
def model(panda, log, tmp_path_factory):
    X = np.column_stack([log.t - log.t[0], log.q, log.dq, log.tau])
    ensemble = BaggingEnsemble("tree", members=3).fit(X, np.tile(BODY.phi, (len(X), 1)) + 1e-3 * X[:, :10])
    path = tmp_path_factory.mktemp("model") / "tree.safetensors"
    return save_model(path, ensemble, arm=panda, motion=taie2024(), dataset_hash="none")


# Every method of the catalogue that needs no trained model and no motion; one that needs a tare gets it.
CATALOGUE = {
    name: lambda arm, empty, _, method=method: method.make(arm, empty if method.needs == "tare" else None)
    for name, method in METHODS.items()
    if method.needs in ("", "tare")
}
MAKE = CATALOGUE | {
    "commanded": lambda arm, *_: CommandedLeastSquares(arm, taie2024()),
    # with few features a solution is cheap
    "map-gp": lambda arm, *_: SmoothPosteriorLeastSquares(arm, features=FEW),
    "hybrid": lambda arm, *_: HybridIdentifier(arm, features=FEW),
    "hybrid, with tare": lambda arm, empty, _: HybridIdentifier(arm, empty, features=FEW),
    "map, with tare": lambda arm, empty, _: PosteriorLeastSquares(arm, empty),
    "rls, tared": lambda arm, empty, _: Tared(RecursiveLeastSquares(arm), empty),
    "trees": lambda arm, _, model: LearnedIdentifier(model, arm),
    "trees, single": lambda arm, _, model: LearnedIdentifier(model, arm, single=True),
    "training mean": lambda arm, *_: TrainingMean(arm, PRIOR.mean, PRIOR.covariance),
    "same-prior least squares": lambda arm, *_: PriorLeastSquares(arm, PRIOR.mean, PRIOR.covariance),
}


DEAR = {"ekf": pytest.mark.full}  # it is slow on every sample, and shares the base class with the others


@pytest.fixture(scope="module", params=[pytest.param(name, marks=DEAR.get(name, ())) for name in MAKE])
def make(request, panda, empty, model):
    return lambda: MAKE[request.param](panda, empty, model)


@pytest.fixture(scope="module")
def whole(make, short):
    """What an identifier says of the whole of a short log."""
    return make().run(short)


def test_no_identifier_escapes_the_list(panda, empty, model):
    def shipped(kind):
        own = [kind] if kind.__module__.startswith("armload.") and not kind.__abstractmethods__ else []
        return own + [k for child in kind.__subclasses__() for k in shipped(child)]

    listed = {type(make(panda, empty, model)) for make in MAKE.values()}
    assert set(shipped(Identifier)) == listed


def test_a_stream_that_is_concluded_says_what_the_whole_recording_says(make, short, whole):
    identifier = make()
    for sample in short:
        running = identifier.update(sample)
    concluded = identifier.conclude()
    assert running.n_samples == concluded.n_samples == whole.n_samples == len(short)
    assert running.t == concluded.t == whole.t == short.t[-1]
    np.testing.assert_allclose(concluded.phi, whole.phi, rtol=0, atol=1e-9)
    np.testing.assert_allclose(concluded.covariance, whole.covariance, rtol=1e-6, atol=1e-12)


def test_a_trace_has_every_nth_estimate_and_the_last(make, short):
    trace = make().trace(short, every=35)
    assert [e.t for e in trace] == [short.t[k] for k in (0, 35, 70, 105, 140, 149)]
    assert [e.n_samples for e in trace] == [1, 36, 71, 106, 141, 150]


def test_how_the_log_is_cut_into_pieces_changes_nothing(make, short, whole):
    pieces, at = make().trace(short, every=37), 37 * 2 + 1  # samples
    np.testing.assert_allclose(pieces[-1].phi, whole.phi, rtol=0, atol=1e-9)
    np.testing.assert_allclose(pieces[2].phi, make().run(short.select(slice(at))).phi, rtol=0, atol=1e-9)


def test_an_estimate_at_a_time_rests_on_the_samples_until_then(make, short, whole):
    late = Recording(short.t + 40.0, short.q, short.dq, short.tau)
    early, middle, again, end = make().at(late, [0.0, 2.0, 2.01, 60.0])
    assert [e.n_samples for e in (early, middle, again, end)] == [1, 101, 101, 150]
    assert [e.t for e in (early, middle, again, end)] == [late.t[k] for k in (0, 100, 100, 149)]
    np.testing.assert_allclose(middle.phi, make().run(short.select(slice(101))).phi, rtol=0, atol=1e-9)
    np.testing.assert_allclose(end.phi, whole.phi, rtol=0, atol=1e-9)


@pytest.mark.parametrize("times", [[], [-0.1, 1.0], [1.0, 1.0], [2.0, 1.0], [np.nan], [[1.0]], 1.0])
def test_times_that_do_not_rise_from_zero_are_refused(panda, log, times):
    with pytest.raises(ArmloadError, match="rising seconds"):
        PosteriorLeastSquares(panda).at(log, times)


def test_reset_forgets_the_run(make, short, whole):
    identifier = make()
    identifier.run(short.between(0.0, 1.0))
    again = identifier.run(short)
    np.testing.assert_array_equal(whole.phi, again.phi)
    np.testing.assert_array_equal(whole.covariance, again.covariance)


def test_estimates_are_ten_numbers_about_the_payload_frame_with_a_symmetric_covariance(make, short, panda):
    for estimate in make().trace(short, every=50):
        assert estimate.phi.shape == (10,)
        assert np.all(np.isfinite(estimate.phi))
        assert estimate.frame == panda.frame
        variance = np.diag(estimate.covariance)
        assert np.all(variance >= 0)  # not NaN: finite, or infinite where nothing is known
        known = np.isfinite(variance) & (variance > 0)
        C = estimate.covariance[np.ix_(known, known)] / np.outer(estimate.std[known], estimate.std[known])
        np.testing.assert_allclose(C, C.T, rtol=0, atol=1e-9)
        assert np.linalg.eigvalsh(C).min(initial=0.0) > -1e-9  # positive semi-definite
    assert np.isfinite(estimate.covariance).all()


def test_an_estimate_is_not_changed_by_later_samples(make, short):
    identifier, samples = make(), list(short)
    for sample in samples[:60]:
        early = identifier.update(sample)
    phi, covariance = early.phi.copy(), early.covariance.copy()
    for sample in samples[60:120]:
        identifier.update(sample)
    np.testing.assert_array_equal(early.phi, phi)
    np.testing.assert_array_equal(early.covariance, covariance)


def test_memory_does_not_grow(make, log):
    def size(identifier):
        return len(pickle.dumps({k: v for k, v in vars(identifier).items() if k not in ("arm", "model")}))

    identifier, sizes, part = make(), [], log.select(slice(50))
    for k in range(12):
        for sample in part:
            identifier.update(sample._replace(t=sample.t + k * (part.t[-1] + 0.02)))
        if hasattr(identifier, "close"):
            identifier.close()  # threads are not its memory
        sizes.append(size(identifier))
    # with a second thread up to 200 rows of 7 kB wait to be added up; the 400 rows of eight parts would be 2.6 MB
    room = 1_500_000 if hasattr(identifier, "close") else 200_000
    assert max(sizes[8:]) <= max(sizes[:4]) + room


def test_a_recording_of_another_arm_is_refused(make):
    other = arm("ur10e")
    t = np.arange(20) / RATE
    log = Recording(t, np.zeros((20, other.n)), np.zeros((20, other.n)), np.zeros((20, other.n)))
    with pytest.raises(ArmloadError, match="6 joints"):
        make().run(log)


@pytest.mark.parametrize("joints", [6, 8])
def test_a_sample_of_another_arm_is_refused_and_leaves_no_trace(make, short, joints):
    identifier, samples, other = make(), list(short)[:60], np.zeros(joints)
    for k, sample in enumerate(samples):
        if k in (0, 30):
            for at in range(3):  # any one of the three is enough
                wrong = sample._replace(**{("q", "dq", "tau")[at]: other})
                with pytest.raises(ArmloadError, match="7 numbers"):
                    identifier.update(wrong)
        last = identifier.update(sample)
    assert last.n_samples == len(samples)
    expected = make().run(short.select(slice(len(samples))))
    np.testing.assert_allclose(identifier.conclude().phi, expected.phi, rtol=0, atol=1e-9)


def test_what_is_no_sample_of_arrays_is_refused_in_a_sentence_and_leaves_no_trace(make, short):
    identifier, untouched = make(), make()
    first, second = (sample for _, sample in zip(range(2), short, strict=False))
    identifier.update(first)
    untouched.update(first)
    with pytest.raises(IdentificationError, match=r"a tuple was given: expected a Sample\(t, q, dq, tau\)"):
        identifier.update(tuple(second))
    with pytest.raises(IdentificationError, match="are list, ndarray, ndarray: expected arrays of NumPy"):
        identifier.update(second._replace(q=second.q.tolist()))
    np.testing.assert_array_equal(identifier.update(second).phi, untouched.update(second).phi)


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_a_number_that_is_not_finite_enters_no_answer(make, short, number):
    identifier, samples = make(), list(short)[:60]
    for k, sample in enumerate(samples):
        if k in (0, 30):
            for channel in ("q", "dq", "tau"):
                values = getattr(sample, channel).copy()
                values[3] = number
                with contextlib.suppress(ArmloadError):  # an ensemble passes over it
                    identifier.update(sample._replace(**{channel: values}))
        identifier.update(sample)
    expected = make().run(short.select(slice(len(samples))))
    np.testing.assert_allclose(identifier.conclude().phi, expected.phi, rtol=0, atol=1e-9)


def test_before_the_first_sample_an_estimate_is_what_was_known(make):
    identifier = make()
    first = identifier.conclude()
    assert first.n_samples == 0
    assert np.all(np.isfinite(first.phi))
    identifier.reset()
    np.testing.assert_array_equal(identifier.conclude().phi, first.phi)


# ---------------------------------------------------------------------- what a method says of exact data

SCALE = np.array([1.0] + [0.1] * 3 + [0.01] * 6)  # [kg, kg·m, kg·m²]
# Largest error on a log without noise at 50 Hz, in units of SCALE, and of the mass alone [kg]. The backward difference
# of `rls` lags half a sample, its inertia shows it; `rls-filter` lags q and dq, which is not the same as lagging Y.
# `ekf` integrates over 20 ms with one midpoint; at 200 Hz its mass is a gram off.
# `hybrid` does not trust a log of 6 s further than arms like those it was trained on deserve, and leans on its prior.
EXACT = {"rls": (1.2, 0.03), "ekf": (0.1, 0.02), "hybrid": (0.3, 0.03)}
# A standing arm's inertia is at least so many times less certain than a moving one's; what a body of that mass and
# centre can have at all, the hybrid knows.
STANDING = {"hybrid": 1.3}
WITHIN = (0.1, 0.01 * BODY.mass)


@pytest.fixture(scope="module", params=CATALOGUE)
def method(request):
    return METHODS[request.param]


def made(method, arm, tare):
    return method.make(arm, tare if method.needs == "tare" else None)


@pytest.fixture(scope="module")
def found(method, panda, log, empty):
    """What a method says of the whole log."""
    return made(method, panda, empty).run(log)


def assert_close(phi, expected, method):
    most, mass = EXACT.get(method.name, WITHIN)
    assert np.abs((phi - expected) / SCALE).max() < most
    assert abs(phi[0] - expected[0]) < mass


def test_exact_data_give_the_payload_back(method, found):
    assert_close(found.phi, BODY.phi, method)


def test_an_empty_arm_carries_nothing(method, panda, empty):
    assert_close(made(method, panda, empty).run(empty).phi, np.zeros(10), method)


def test_a_tare_of_the_exact_arm_changes_nothing(method, panda, log, empty):
    if method.tare != "none":
        assert_close(method.make(panda, empty).run(log).phi, BODY.phi, method)


def test_base_and_gravity_turned_together_change_nothing(method, panda, log, empty, found):
    a, c, s = 0.7, np.cos(0.7), np.sin(0.7)
    tree = ElementTree.fromstring(panda.urdf)
    (base,) = {x.get("name") for x in tree.iter("link")} - {x.get("link") for x in tree.iter("child")}
    joint = (
        f'<joint name="turn" type="fixed"><parent link="turned"/><child link="{base}"/><origin rpy="{a} 0 0"/></joint>'
    )
    tree.extend([ElementTree.fromstring('<link name="turned"/>'), ElementTree.fromstring(joint)])
    gravity = tuple(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ panda.gravity)
    turned = dataclasses.replace(panda, urdf=ElementTree.tostring(tree, encoding="unicode"), gravity=gravity)
    there = made(method, turned, empty).run(log)
    np.testing.assert_allclose(there.phi / SCALE, found.phi / SCALE, rtol=0, atol=1e-8)
    np.testing.assert_allclose(there.std, found.std, rtol=1e-4)


def test_another_payload_frame_means_the_same_body(method, panda, log, empty, found):
    wrist = arm("panda", "panda_link7")  # 0.107 m behind the flange
    there = made(method, wrist, empty).run(log).phi
    moved = wrist.in_frame(InertialParameters(found.phi, panda.frame)).phi
    # what keeps the first samples finite, and a prior, know of a frame: nothing else does
    assert np.abs((there - moved) / SCALE).max() < 0.05


def test_only_the_log_s_own_clock_counts(method, panda, log, empty, found):
    later = Recording(log.t + 1e6, log.q, log.dq, log.tau)
    there = made(method, panda, empty).run(later).phi
    np.testing.assert_allclose(there / SCALE, found.phi / SCALE, rtol=0, atol=1e-6)


def test_a_gap_in_the_log_does_not_bend_the_estimate(method, panda, log, empty):
    gappy = log.select((log.t < 2.0) | (log.t > 2.7))
    assert_close(made(method, panda, empty).run(gappy).phi, BODY.phi, method)


def test_a_standing_arm_leaves_what_it_cannot_tell_open(method, panda, log, empty, found):
    pose = np.tile(log.q[0], (200, 1))
    still = Recording(np.arange(200) / RATE, pose, 0 * pose, panda.with_payload(BODY).torque(pose))
    if method.tare == "same motion":
        return  # a standing run is no run along the tare
    estimate = made(method, panda, empty).run(still)
    assert np.all(np.abs(estimate.phi - BODY.phi)[4:] < 3.0 * estimate.std[4:])
    assert np.all(estimate.std[4:] > STANDING.get(method.name, 2.0) * found.std[4:])


def test_a_tare_leaves_what_was_added(panda, log, empty):
    tared, plain = Tared(RecursiveLeastSquares(panda), empty), RecursiveLeastSquares(panda)
    after, before = plain.run(log), RecursiveLeastSquares(panda).trace(empty, every=max(1, len(empty) // 100))
    second_half = np.mean([e.phi for e in before[len(before) // 2 :]], axis=0)
    estimate = tared.run(log)
    np.testing.assert_allclose(estimate.phi, after.phi - second_half, rtol=0, atol=1e-12)
    np.testing.assert_allclose(estimate.covariance, after.covariance + before[-1].covariance, rtol=1e-12)
