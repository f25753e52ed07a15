"""Logs as users have them: clocks that jitter, samples lost, channels apart, long standstills, any rate, motor torque.

All arms differ from their models as real ones do; what is done to the logs is done to run and tare alike, as one
logger made both. A mass error is bounded absolutely, and the 95 % interval holds the truth. The default method is tried
on more arms than its physics alone.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from armload.identification import identify
from armload.inertia import InertialParameters
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.motion import Motion
from armload.payloads import Payload
from armload.recording import Recording
from armload.simulation import World

# the default in the quick tests, and its physics alone where another arm would have it: in the full ones
METHODS = (None, *(pytest.param(name, marks=pytest.mark.full) for name in ("map-gp", "map")))
TARED = pytest.mark.parametrize("tared", [True, False], ids=["tare", "no tare"])
RUN, TARE = 6.0, 8.0  # [s]
HEAVY = Payload("heavy", InertialParameters.from_com(2.5, (0.03, -0.02, 0.08), np.diag([8e-3, 9e-3, 6e-3])))


def half(answer):
    """Half-widths (10,)."""
    return 0.5 * (np.array(answer.phi_high) - answer.phi_low)


def holds(answer, truth):
    """Whether each interval (10,) holds the truth."""
    return (np.array(answer.phi_low) <= truth.phi) & (truth.phi <= np.array(answer.phi_high))


@pytest.fixture(scope="module")
def drawn(panda):
    """Two arms with a payload each, and a tare on another motion."""
    return [replace(e, duration=RUN, tare_duration=TARE) for e in draw_episodes(panda, "reference", 2, seed=0)]


@pytest.fixture(scope="module")
def logs(drawn):
    """A factory of the logs of one or the other at 1 kHz, as a Panda's sensors see them (8 % of the samples lost)."""
    return cache(lambda which: next(iter(simulate_episodes([drawn[which]], rate=1000.0))))


# ---------------------------------------------------------------- clocks and channels


def at_rate(log: Recording, hz: float) -> Recording:
    """The samples next to an even clock, as from a logger that keeps one now and then."""
    ticks = np.arange(log.t[0], log.t[-1], 1.0 / hz)
    return log.select(np.unique(np.searchsorted(log.t, ticks)))


def irregular(log: Recording) -> Recording:
    """1 to 30 ms between samples, at random."""
    rows = np.cumsum(np.random.default_rng(1).choice([1, 2, 5, 10, 20, 30], size=len(log)))
    return log.select(rows[rows < len(log)])


def jittered(log: Recording) -> Recording:
    """Stamps that are wrong by a third of a sample time."""
    log = at_rate(log, 200.0)
    h, wrong = np.diff(log.t), np.random.default_rng(2).normal(size=len(log) - 2)
    t = log.t.copy()
    t[1:-1] += np.clip(wrong / 3.0, -0.45, 0.45) * np.minimum(h[1:], h[:-1])
    return replace(log, t=t)


def lossy(log: Recording) -> Recording:
    """A third of the samples lost one by one, and four gaps of a quarter of a second."""
    log, rng = at_rate(log, 200.0), np.random.default_rng(3)
    keep = rng.random(len(log)) > 1 / 3
    for start in rng.uniform(log.t[0], log.t[-1], size=4):
        keep &= ~((log.t > start) & (log.t < start + 0.25))
    return log.select(keep)


def late(log: Recording, hz: float, samples: int) -> Recording:
    """Torque that comes so many samples behind position and velocity."""
    log = at_rate(log, hz)
    return replace(log.select(slice(samples, None)), tau=log.tau[:-samples])


# what is done to a log, and the largest mass error [kg] with and without a tare
FOUND = {
    "irregular": (irregular, 0.04, 0.12),
    "jittered": (jittered, 0.04, 0.12),
    "lossy": (lossy, 0.04, 0.12),
    "torque 5 ms late": (lambda log: late(log, 200.0, 1), 0.05, 0.12),
    "torque 10 ms late": (lambda log: late(log, 200.0, 2), 0.06, 0.15),
    "torque 20 ms late": (lambda log: late(log, 100.0, 2), 0.09, 0.2),
}


# the default method with and without a tare; its physics alone mostly with one
BETWEEN = ("torque 5 ms late", "torque 10 ms late")  # what is told by none and by 20 ms
TRIED = [(name, True, None, 0) for name in FOUND if name not in BETWEEN]
TRIED += [(name, False, None, 0) for name in ("irregular", "torque 20 ms late")]
OTHERS = [(name, tared, None, 0) for name in BETWEEN for tared in (True, False)]
OTHERS += [(name, False, None, 0) for name in ("jittered", "lossy")]
OTHERS += [(name, True, None, 1) for name in FOUND]
OTHERS += [(name, True, method, 0) for name in FOUND for method in ("map-gp", "map")]
OTHERS += [(name, False, method, 0) for name in ("irregular", "torque 20 ms late") for method in ("map-gp", "map")]
TRIED += [pytest.param(*other, marks=pytest.mark.full) for other in OTHERS]  # some seconds


@pytest.mark.parametrize(("name", "tared", "method", "which"), TRIED)
@pytest.mark.full  # some seconds
def test_the_mass_is_right_whatever_the_clock_and_its_interval_holds(panda, logs, name, tared, method, which):
    change, *worst = FOUND[name]
    bound = worst[0 if tared else 1] * (1.5 if method == "map" else 1.0)
    run, tare, truth = logs(which)
    answer = identify(change(run), panda, tare=change(tare) if tared else None, method=method)
    assert answer.held
    assert abs(answer.mass - truth.mass) < bound
    assert holds(answer, truth)[0]


@pytest.mark.full
@TARED
def test_30_hz_100_hz_and_1_khz_of_one_run_agree_within_their_intervals(panda, logs, tared):
    for run, tare, truth in map(logs, range(2 if tared else 1)):
        answers = [
            identify(change(run), panda, tare=change(tare) if tared else None)
            for change in (lambda log: log, lambda log: at_rate(log, 100.0), lambda log: at_rate(log, 30.0))
        ]
        for k, one in enumerate(answers):
            assert holds(one, truth)[0]
            for other in answers[k + 1 :]:
                assert np.all(np.abs(np.array(one.phi) - other.phi) <= np.maximum(half(one), half(other)))


# ---------------------------------------------------------------- standstill

STILL = 10.0  # [s]


class Waits(Motion):
    """A motion that begins after a while; before and after it the arm stands still."""

    def __init__(self, inner: Motion):
        self.inner, self.name = inner, f"waits, {inner.name}"

    @property
    def n(self):
        return self.inner.n

    @property
    def duration(self):
        return self.inner.duration + 2 * STILL

    def derivative(self, t, order):
        return self.inner._at(t - STILL, order)


@pytest.fixture(scope="module")
def waiting(drawn):
    """The first arm with 10 s of standstill before and after the run, at 100 Hz, with stiction, and its tare.

    Friction at rest may be anything up to its level: each joint has one value of it before, and one after.
    """
    rng, first = np.random.default_rng(4), drawn[0]
    waits = replace(first, motion=Waits(first.motion), duration=first.motion.duration + 2 * STILL)
    ((run, tare, truth),) = simulate_episodes([waits], rate=100.0)
    tau = run.tau.copy()
    for still in (run.t < STILL, run.t > run.t[-1] - STILL):
        tau[still] += rng.uniform(-1.0, 1.0, size=run.n) * waits.world.friction.level
    return replace(run, tau=tau), tare, truth


@pytest.mark.parametrize("method", METHODS)
@TARED
@pytest.mark.full  # some seconds
def test_standstill_at_the_ends_neither_moves_the_answer_nor_makes_it_surer(panda, waiting, tared, method):
    run, tare, truth = waiting
    tare = tare if tared else None
    padded = identify(run, panda, tare=tare, method=method)
    cut = identify(run.between(STILL, run.t[-1] - STILL), panda, tare=tare, method=method)
    assert np.all(np.abs(np.array(padded.phi) - cut.phi)[:4] < half(cut)[:4])
    assert np.all(half(padded) > 0.9 * half(cut))  # `map` counts a second of each standstill: 7 %
    assert abs(padded.mass - truth.mass) < (0.05 if tared else 0.12)
    assert holds(padded, truth)[0]


@pytest.mark.parametrize("method", METHODS)
@TARED
def test_an_arm_that_stood_still_tells_no_inertia_and_no_more_mass_by_standing_longer(panda, waiting, tared, method):
    run, tare, truth = waiting
    tare = tare if tared else None
    once = run.between(0.0, 0.5 * STILL)
    q, dq, tau = (np.concatenate([x, x]) for x in (once.q, once.dq, once.tau))
    twice = Recording(np.append(once.t, once.t + 0.5 * STILL), q, dq, tau)  # as if it had gone on
    answers = [identify(log, panda, tare=tare, method=method) for log in (once, twice)]
    for answer in answers:
        assert not any(answer.determined[4:])
        assert holds(answer, truth)[0]
    assert half(answers[1])[0] > 0.95 * half(answers[0])[0]


# ---------------------------------------------------------------- another torque


@pytest.fixture(scope="module")
def motor_logs(panda, drawn):
    """The same payloads on arms with torque measured on the motors' side: friction of 5–15 % of the rated torque."""
    motor = [replace(e, world=World.beyond(panda, k, motor_side=True), rate=200.0) for k, e in enumerate(drawn)]
    return list(simulate_episodes(motor))


@pytest.mark.parametrize("method", METHODS[:2])
@TARED
@pytest.mark.full  # some seconds
def test_torque_from_motor_currents_has_its_friction_found_and_wider_intervals(panda, motor_logs, tared, method):
    for run, tare, truth in motor_logs:
        answer = identify(run, panda, tare=tare if tared else None, method=method)
        assert holds(answer, truth)[0]
        assert abs(answer.mass - truth.mass) < (0.15 if tared else 0.25)
        if method is None:  # a sensor behind the gear: 0.035 and 0.1 kg
            assert half(answer)[0] > (0.07 if tared else 0.14)


@pytest.mark.xfail(strict=True, reason="`map` has no smooth functions: friction of another shape becomes mass")
def test_map_alone_finds_the_mass_from_motor_currents_without_a_tare(panda, motor_logs):
    assert all(holds(identify(log.run, panda, method="map"), log.truth)[0] for log in motor_logs)


@pytest.mark.full
@pytest.mark.xfail(
    strict=True, reason="the gain of a link-side torque is taken to be known to 0.5 %, whatever the log says"
)
def test_a_torque_channel_with_2_percent_gain_is_within_the_interval(panda, drawn):
    heavy = [replace(e, payload=HEAVY, rate=200.0) for e in drawn]
    inside = []
    for run, tare, truth in simulate_episodes(heavy):
        assert tare is not None
        for gain in (0.98, 1.02):
            seen, before = (replace(log, tau=gain * log.tau) for log in (run, tare))
            inside.append(holds(identify(seen, panda, tare=before), truth)[0])
    assert all(inside)


# ---------------------------------------------------------------- a tool


@pytest.mark.parametrize("which", [0, pytest.param(1, marks=pytest.mark.full)])
@pytest.mark.parametrize("method", METHODS)
def test_with_a_tool_at_the_tare_the_answer_is_what_was_added_and_without_a_tare_all_of_it(panda, method, which):
    episodes = draw_episodes(panda, "tool", 2, seed=0)
    mounted = [replace(episodes[which], duration=RUN, tare_duration=TARE)]
    for episode, (run, tare, truth) in zip(mounted, simulate_episodes(mounted, rate=200.0), strict=True):
        added, whole = identify(run, panda, tare=tare, method=method), identify(run, panda, method=method)
        assert episode.tool is not None
        both = truth + InertialParameters(episode.tool.parameters.phi, truth.frame)
        assert (added.relative_to, whole.relative_to) == ("tare", "arm")
        assert holds(added, truth)[0]
        assert holds(whole, both)[0]
        assert abs(added.mass - truth.mass) < 0.06
        assert abs(whole.mass - both.mass) < 0.15
