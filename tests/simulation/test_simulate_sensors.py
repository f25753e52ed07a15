"""Each sensor effect has its measured size, can be switched off by itself, and repeats with its seed."""

from dataclasses import fields, replace

import numpy as np
import pytest

from armload.arms import arm
from armload.errors import ArmError
from armload.recording import Recording
from armload.simulation import Sensors

RATE, SECONDS = 1000.0, 20.0


@pytest.fixture(scope="module")
def truth() -> Recording:
    """Ten seconds at rest, then ten seconds of motion."""
    t = np.arange(int(RATE * SECONDS)) / RATE
    moving = t[:, None] >= SECONDS / 2
    angle = 2.0 * (t[:, None] - SECONDS / 2) + np.arange(7)
    q = np.where(moving, np.sin(angle), np.sin(np.arange(7)))
    dq = np.where(moving, 2.0 * np.cos(angle), 0.0)
    return Recording(t, q, dq, 10.0 * np.sin(3.0 * t)[:, None] + np.arange(7.0))


@pytest.fixture(scope="module")
def panda_sensors() -> Sensors:
    return Sensors.panda(arm("panda"))


def only(sensors: Sensors, *names: str) -> Sensors:
    return Sensors(**{name: getattr(sensors, name) for name in names})


def rms(x) -> np.ndarray:
    return np.sqrt(np.mean(np.square(x), axis=0))


def test_ideal_sensors_change_nothing(truth):
    assert Sensors.ideal().observe(truth, seed=3) is truth


def test_white_noise_has_the_measured_size(truth, panda_sensors):
    for effect, channel in (("torque_noise", "tau"), ("velocity_noise", "dq"), ("position_noise", "q")):
        seen = only(panda_sensors, effect).observe(truth, seed=1)
        noise = getattr(seen, channel) - getattr(truth, channel)
        np.testing.assert_allclose(rms(noise), getattr(panda_sensors, effect), rtol=0.05)
        assert np.abs(np.mean(noise[1:] * noise[:-1], axis=0) / np.var(noise, axis=0)).max() < 0.05
        for other in {"q", "dq", "tau"} - {channel}:
            np.testing.assert_array_equal(getattr(seen, other), getattr(truth, other))


def test_vibration_is_coloured_and_only_there_while_moving(truth, panda_sensors):
    noise = only(panda_sensors, "vibration").observe(truth, seed=1).tau - truth.tau
    half = len(noise) // 2
    assert np.all(noise[:half] == 0.0)
    np.testing.assert_allclose(rms(noise[half:]), panda_sensors.vibration, rtol=0.1)
    power = np.abs(np.fft.rfft(noise[half:], axis=0)) ** 2
    frequency = np.fft.rfftfreq(half, 1 / RATE)
    inside = (frequency > 14) & (frequency < 121)
    assert power[~inside].sum() < 1e-2 * power[inside].sum()
    low, high = inside & (frequency < 60), inside & (frequency > 75)
    assert power[low].mean() == pytest.approx(power[high].mean(), rel=0.2)


@pytest.mark.parametrize("rate", [100.0, 540.0])
def test_vibration_keeps_its_size_in_slow_logs(rate, panda_sensors):
    t = np.arange(int(20 * rate)) / rate
    log = Recording(t, np.zeros((len(t), 7)), np.ones((len(t), 7)), np.zeros((len(t), 7)))
    np.testing.assert_allclose(
        rms(only(panda_sensors, "vibration").observe(log).tau), panda_sensors.vibration, rtol=0.1
    )


def test_quantised_torque_is_a_multiple_of_the_quantum(truth, panda_sensors):
    seen = only(panda_sensors, "torque_quantum").observe(truth)
    steps = seen.tau / panda_sensors.torque_quantum
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.all(np.abs(seen.tau - truth.tau) <= 0.5 * panda_sensors.torque_quantum + 1e-12)


def test_lag_and_skew_delay_each_channel_by_its_own_time(truth):
    late = Sensors(command_lag=0.005, velocity_skew=0.002, torque_skew=0.003).observe(truth)
    steady = slice(int(0.6 * len(truth)), None)
    for channel, rows in (("q", 5), ("dq", 7), ("tau", 8)):
        shifted = np.roll(getattr(truth, channel), rows, axis=0)
        np.testing.assert_allclose(getattr(late, channel)[steady], shifted[steady], atol=1e-9)
    np.testing.assert_array_equal(late.q[0], truth.q[0])


def test_lost_samples_come_in_bursts(truth, panda_sensors):
    seen = only(panda_sensors, "lost").observe(truth, seed=1)
    assert 1 - len(seen) / len(truth) == pytest.approx(0.08, abs=0.01)
    gaps = np.round(np.diff(seen.t) * RATE).astype(int) - 1
    bursts = gaps[gaps > 0]
    assert bursts.mean() == pytest.approx(2.0, abs=0.2)
    index = np.round(seen.t * RATE).astype(int)
    np.testing.assert_array_equal(seen.tau, truth.tau[index])


def test_jitter_moves_the_stamps_and_never_their_order(truth):
    seen = Sensors(jitter=1e-4).observe(truth, seed=1)
    assert np.std(seen.t - truth.t) == pytest.approx(1e-4, rel=0.05)
    wild = Sensors(jitter=1.0).observe(truth, seed=1)
    assert np.diff(wild.t).min() > 0
    np.testing.assert_array_equal(seen.q, truth.q)


def test_seed_repeats_and_switching_one_effect_off_leaves_the_others_alone(truth, panda_sensors):
    first, again = (panda_sensors.observe(truth, seed=4) for _ in range(2))
    np.testing.assert_array_equal(first.tau, again.tau)
    np.testing.assert_array_equal(first.t, again.t)
    other = panda_sensors.evenly().observe(truth, seed=5)
    plain = panda_sensors.evenly().observe(truth, seed=4)
    assert np.any(other.tau != plain.tau)
    still = replace(panda_sensors.evenly(), vibration=None, torque_quantum=None).observe(truth, seed=4)
    np.testing.assert_array_equal(still.dq, plain.dq)
    noisy = replace(panda_sensors.evenly(), torque_quantum=None).observe(truth, seed=4)
    vibration = noisy.tau - still.tau
    single = only(panda_sensors, "vibration", "command_lag").observe(truth, seed=4).tau
    lagged = only(panda_sensors, "command_lag").observe(truth).tau
    np.testing.assert_allclose(vibration, single - lagged, atol=1e-9)


@pytest.mark.parametrize("name", [f.name for f in fields(Sensors)])
def test_every_effect_can_be_switched_off(truth, panda_sensors, name):
    everything = replace(panda_sensors, velocity_skew=1e-3)
    default = getattr(Sensors.ideal(), name)
    seen = replace(everything, **{name: default}).observe(truth, seed=2)
    full = everything.observe(truth, seed=2)
    changed = len(seen) != len(full) or any(
        np.any(getattr(seen, channel) != getattr(full, channel)) for channel in ("t", "q", "dq", "tau")
    )
    assert changed


def test_generic_sensors_scale_with_rated_torque():
    ur10e = arm("ur10e")
    sensors = Sensors.generic(ur10e)
    assert sensors.torque_noise is not None
    ratio = sensors.torque_noise / ur10e.limits.effort
    np.testing.assert_allclose(ratio, ratio[0])


def test_mistakes_are_named(truth):
    with pytest.raises(ArmError, match="ur10e has 6 joints: the Panda's sensors have 7"):
        Sensors.panda(arm("ur10e"))
    with pytest.raises(ArmError, match="vibration of the sensors has shape"):
        Sensors(vibration=np.ones(6)).observe(truth)
    with pytest.raises(ArmError, match="samples: expected 0 ≤ lost"):
        Sensors(lost=0.95).observe(truth)
