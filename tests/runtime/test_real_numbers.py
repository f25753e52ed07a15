"""What numpy would make floats of with a loss is refused, in every room, in a sentence; what is lossless is taken."""

from dataclasses import replace

import numpy as np
import pytest

from armload.arms import arm, momentum_regressor
from armload.errors import ArmError, ArmloadError, InertiaError, MotionError, PayloadError, RecordingError
from armload.inertia import InertialParameters, from_log_cholesky, from_order, is_consistent, nearest_consistent
from armload.motion import FourierMotion, check_motion, start_and_stop_at_rest, taie2024
from armload.payloads import Box, random_payload
from armload.payloads.uncertainty import Measured, Uncertainty
from armload.posterior import KnownCentre, KnownMass
from armload.recording import Recording
from armload.runtime.real_numbers import own_reals, reals

TEN = np.array([2.0, 0.1, -0.05, 0.2, 0.05, 0.001, 0.002, 0.06, 0.003, 0.04])
NO_NUMBERS = {
    "masked": np.ma.array(TEN, mask=np.arange(10) == 1),
    "complex": TEN + 1j,
    "dates": np.arange(10).astype("M8[s]"),
    "time spans": np.arange(10).astype("m8[s]"),
    "records": np.zeros(10, dtype=[("a", float)]),
    "too large": [10**400] * 10,
    "ragged": [[1.0], [1.0, 2.0]],
    "words": ["a"] * 10,
}
SAME = {
    "float32": TEN.astype("f4").astype("f8").astype("f4"),
    "big-endian": TEN.astype(">f8"),
    "not contiguous": np.repeat(TEN, 2)[::2],
    "list": TEN.tolist(),
    "objects": TEN.astype(object),
    "nothing masked": np.ma.array(TEN, mask=False),
}


@pytest.mark.parametrize("given", NO_NUMBERS.values(), ids=NO_NUMBERS)
@pytest.mark.parametrize(
    "taken_by",
    [
        InertialParameters,
        is_consistent,
        from_log_cholesky,
        nearest_consistent,
        lambda x: from_order(x, "ur"),
        lambda x: (
            Recording(np.arange(10.0), *[np.reshape(x, (10, -1))] * 3)
            if isinstance(x, np.ma.MaskedArray)
            else Recording(x, *[np.zeros((10, 1))] * 3)
        ),
        lambda x: arm("panda").torque(x[:7]),
        lambda x: arm("panda").leaning(x[:2]),
        lambda x: momentum_regressor(arm("panda").frame_motion(np.zeros(7)), x[:7]),
        lambda x: taie2024()(x),
        lambda x: FourierMotion(x, np.zeros((10, 2)), np.zeros((10, 2)), 6.0),
        lambda x: Box(x[:3], (0.0, 0.0, 0.0), 1.0),
        lambda x: KnownCentre(x[:3], 0.01),
    ],
    ids=lambda taken_by: getattr(taken_by, "__name__", ""),
)
def test_what_would_lose_something_as_a_float_is_refused(taken_by, given):
    with pytest.raises(ArmloadError) as refused:
        taken_by(given)
    assert len(str(refused.value)) > 20


@pytest.mark.parametrize("given", SAME.values(), ids=SAME)
def test_the_same_numbers_are_the_same_whatever_holds_them(given):
    np.testing.assert_allclose(InertialParameters(given).phi, TEN, rtol=1e-7)
    assert reals(TEN) is TEN
    own = own_reals(given, "what is given", ArmloadError)
    assert not own.flags.writeable
    assert not np.shares_memory(own, np.asarray(given))


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_a_check_of_a_motion_that_looks_nowhere_is_refused(rate):
    panda = arm("panda")
    for option in ("rate", "collision_rate"):
        with pytest.raises(MotionError, match="Hz: expected a positive number"):
            check_motion(panda, taie2024(), **{option: rate})


@pytest.mark.parametrize("options", [{"floor": np.nan}, {"payload_radius": np.nan}, {"payload_radius": -0.1}])
def test_a_floor_or_ball_that_is_no_number_clears_no_motion(options):
    with pytest.raises(MotionError, match="expected a"):
        check_motion(arm("panda"), taie2024(), **options)


@pytest.mark.parametrize(
    "options",
    [
        {"jerk": (np.nan,) * 7},
        {"acceleration": (1.0, 2.0)},
        {"acceleration": (-1.0,) * 7},
        {"rated_payload": np.nan},
        {"link_spread": np.nan},
        {"gear_loss": -1.0},
        {"torque_gain_std": np.nan},
    ],
    ids=str,
)
def test_an_arm_of_limits_that_are_none_is_refused(options):
    with pytest.raises(ArmError, match="expected a"):
        replace(arm("panda"), **options)


def test_shapes_that_numpy_would_stretch_are_refused():
    motion = arm("panda").frame_motion(np.zeros((5, 7)))
    for rates in (0.1, np.zeros(6), np.zeros((4, 7)), np.zeros((1, 5, 7))):
        with pytest.raises(ArmError, match="expected"):
            momentum_regressor(motion, rates)
    with pytest.raises(MotionError, match=r"\(n, K\)"):
        start_and_stop_at_rest([[1.0, 2.0]], [[1.0]])
    with pytest.raises(ArmError, match="finite"):
        arm("panda").with_links(np.full((7, 10), np.nan))


def test_a_covariance_is_ten_by_ten_finite_and_ones_own():
    for given in (np.zeros((9, 9)), np.zeros(10), np.full((10, 10), np.nan), np.zeros((2, 10, 10))):
        with pytest.raises(PayloadError, match=r"symmetric matrix \(10, 10\)"):
            Measured(given)
    given = np.eye(10)
    kept = Measured(given)
    given[0, 0] = 7.0
    assert kept.covariance[0, 0] == 1.0
    assert not kept.covariance.flags.writeable


@pytest.mark.parametrize("std", [1e308, np.nan, np.inf])
def test_a_standard_deviation_without_a_square_is_refused(std):
    for given in (lambda: KnownMass(1.0, std), lambda: KnownCentre((0.0, 0.0, 0.1), std), lambda: Uncertainty(com=std)):
        with pytest.raises(ArmloadError, match="expected"):
            given()


@pytest.mark.parametrize("seed", [np.nan, np.inf, None, 1.5, -1])
def test_a_seed_that_is_no_whole_number_is_refused(seed):
    with pytest.raises(PayloadError, match="whole number"):
        random_payload(seed)


def test_coordinates_of_a_chart_are_finite():
    with pytest.raises(InertiaError, match="10 finite numbers"):
        from_log_cholesky([np.nan, *np.zeros(9)])


def test_a_recording_says_what_of_it_cannot_be():
    t, x = np.arange(3.0), np.zeros((3, 2))
    log = Recording(t, x, x, x, notes=["one sentence"])
    assert log.notes == ("one sentence",)
    for options in ({"notes": "one sentence"}, {"epoch": None}, {"epoch": np.nan}, {"joint_names": 2}):
        with pytest.raises(RecordingError, match="expected"):
            Recording(t, x, x, x, **options)
    with pytest.raises(RecordingError, match="at least one joint"):
        Recording(t, *[np.zeros((3, 0))] * 3)
    for rows in ([0, 7], np.ones(2, dtype=bool), [0.0, 1.5]):
        with pytest.raises(RecordingError, match="no such rows"):
            log.select(rows)
