"""An identifier on a running robot: what a stream may do to it, and what it must not."""

import json
import os
import re
import threading
import time
from copy import deepcopy
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armload.arms import arm
from armload.devices import Load, Simulator
from armload.devices.franka import writer as franka_robot
from armload.ensembles.compiled import AveragedMembers
from armload.errors import ArmError, IdentificationError
from armload.identification import METHODS
from armload.motion import random_motion, taie2024
from armload.online import OnlineEstimate, OnlineIdentifier
from armload.online.state import saved_at
from armload.payloads import franka_hand
from armload.payloads import test_payload as make_payload
from armload.posterior import shipped_model
from armload.recording import Sample, read_recording, write_recording
from armload.simulation import World, simulate


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def log(panda):
    payload = make_payload().parameters
    return simulate(panda, taie2024(), payload=payload, world=World.real_like(panda, seed=3), rate=200.0)


@pytest.fixture
def online(panda):
    identifier = OnlineIdentifier(panda)
    yield identifier
    identifier.close()


def fed(identifier, samples):
    estimate = None
    for sample in samples:
        estimate = identifier.update(*sample)
    return estimate


@pytest.fixture(scope="module")
def clean(panda, log):
    """A factory of what is said after the first so many samples, with nothing wrong among them."""

    @cache
    def after(count):
        identifier = OnlineIdentifier(panda)
        estimate = fed(identifier, list(log)[:count])
        identifier.close()
        return estimate

    return after


def test_a_payload_is_found_and_said_with_all_that_a_controller_asks(online, log):
    estimate = fed(online, log)
    truth = make_payload().parameters.phi
    assert np.mean((estimate.low <= truth) & (truth <= estimate.high)) >= 0.9
    assert estimate.held
    assert estimate.determined.all()
    assert estimate.moving
    assert estimate.age <= 0.0101
    assert estimate.calibrated
    said = json.loads(json.dumps(estimate.to_dict(), allow_nan=False))
    assert said["mass"] == pytest.approx(truth[0], abs=0.15)
    assert said["n_samples"] == len(log)


def test_an_arm_with_a_known_tool_answers_relative_to_it(panda, log):
    """Whoever writes the answer to a controller must be told that the tool is not in it."""
    identifier = OnlineIdentifier(panda.with_payload(franka_hand().parameters), method="map")
    assert fed(identifier, list(log)[:20]).relative_to == "tool"
    identifier.close()


def test_a_name_and_a_path_stand_for_an_arm_and_its_tare_as_in_identify(panda, log, tmp_path):
    path, world, said = tmp_path / "empty.csv", World.real_like(panda, seed=3), []
    write_recording(path, simulate(panda, random_motion(panda, 5, duration=6.0), None, world=world, rate=200.0))
    for named in (OnlineIdentifier("panda", path, "map"), OnlineIdentifier(panda, read_recording(path, panda), "map")):
        said.append(fed(named, log.between(0.0, 1.0)))
        named.close()
    np.testing.assert_array_equal(said[0].phi, said[1].phi)
    assert said[0].relative_to == "tare"
    with pytest.raises(ArmError, match="unknown robot 'pandar'"):
        OnlineIdentifier("pandar")


def test_methods_that_cannot_run_live_are_not_offered(panda):
    with pytest.raises(IdentificationError, match="the method tree cannot follow a live stream") as raised:
        OnlineIdentifier(panda, method="tree")
    offered = str(raised.value).split("expected one of ")[1].split(", or the file")[0].split(", ")
    assert not {"tree", "network", "commanded"} & set(offered)
    assert {"hybrid", "map", "rls"} <= set(offered)


class Foreign:
    """An array of another library, which does not let itself be read (as a tensor that still has a gradient)."""

    def __array__(self, *_, **__):
        raise RuntimeError("call detach() first")


def test_values_that_refuse_to_be_read_are_counted(online, log):
    first = next(iter(log))
    assert online.update(first.t, Foreign(), first.dq, first.tau).health.bad == 1


def bad_samples(n=7):
    numbers = st.floats(allow_nan=True, allow_infinity=True)
    broken = st.one_of(
        st.lists(numbers, max_size=12),
        st.none(),
        st.text(max_size=3),
        st.just([np.nan] * n),
        st.just([1e300] * n),
        st.just([[0.0] * n]),
        st.just({"q": 1}),
    )
    return st.lists(st.tuples(numbers, broken, broken, broken), max_size=6)


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(bad=bad_samples(), where=st.integers(1, 59))
@pytest.mark.full  # some seconds
def test_samples_that_are_none_leave_no_trace(panda, log, clean, bad, where):
    """Bit for bit: the estimate after a stream with garbage in it is the one after the stream without."""
    samples = list(log)[:60]
    identifier = OnlineIdentifier(panda)
    fed(identifier, samples[:where])
    used = identifier.health.used
    for sample in bad:
        estimate = identifier.update(*sample)
        assert np.isfinite(estimate.phi).all()
    assert identifier.health.used == used
    assert identifier.health.bad == len(bad)
    after = fed(identifier, samples[where:])
    identifier.close()
    assert np.array_equal(after.phi, clean(len(samples)).phi)


@pytest.mark.parametrize("column", range(3))
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e9])
def test_one_wrong_number_is_counted_and_left_out(online, log, clean, column, value):
    samples = list(log)[:40]
    broken = [x.copy() for x in samples[20][1:]]
    broken[column][3] = value
    estimate = fed(online, [*samples[:20], (samples[20].t - 1e-4, *broken), *samples[20:]])
    assert online.health.bad == 1
    assert np.array_equal(estimate.phi, clean(len(samples)).phi)


def test_a_callers_buffers_may_be_used_again(online, log, clean):
    samples = list(log)[:60]
    buffers = [np.empty(7) for _ in range(3)]
    for sample in samples:
        for buffer, values in zip(buffers, sample[1:], strict=True):
            buffer[:] = values
        estimate = online.update(sample.t, *buffers)
        for buffer in buffers:
            buffer[:] = 1e6
    assert np.array_equal(estimate.phi, clean(len(samples)).phi)


def test_an_estimate_says_all_that_one_is_made_of(online, log):
    """It is made past the constructor, which would see to that."""
    for estimate in (online.update(None, None, None, None), fed(online, list(log)[:60])):
        said = {field.name: getattr(estimate, field.name) for field in fields(OnlineEstimate)}
        assert said == vars(estimate)
        assert vars(OnlineEstimate(**said)) == said


def test_swapped_joints_are_left_out(online, log):
    samples = list(log)[:200]
    order = [3, 1, 2, 0, 4, 5, 6]
    stream = [
        Sample(s.t, s.q[order], s.dq[order], s.tau[order]) if 100 <= k < 110 else s for k, s in enumerate(samples)
    ]
    fed(online, stream)
    assert online.health.left_out["jump"] + online.health.left_out["implausible"] == 10
    assert online.health.used == 190


@pytest.mark.parametrize("counted_from", [0.0, -np.pi])
@pytest.mark.full  # some seconds
def test_a_joint_that_turns_without_end_may_be_counted_anew(counted_from):
    """Kinova's drivers tell its angles from -pi to pi, or from 0 to 2 pi."""
    gen3, t, endless = arm("gen3"), np.arange(600) / 200.0, [0, 2, 4, 6]
    q = 0.3 * np.sin(np.outer(t, np.arange(1.0, 8.0)))
    q[:, endless] += np.outer(t, [1.0, -1.0, 1.2, -1.2])
    dq = np.gradient(q, t, axis=0)
    tau = gen3.torque(q, dq)
    wrapped = q.copy()
    wrapped[:, endless] = np.mod(q[:, endless] - counted_from, 2.0 * np.pi) + counted_from
    assert np.abs(np.diff(wrapped, axis=0)).max() > 6.0
    said = []
    for angles in (q, wrapped):
        identifier = OnlineIdentifier(gen3)
        said.append(fed(identifier, map(Sample, t, angles, dq, tau)))
        assert identifier.health.used == len(t)
        identifier.close()
    assert np.allclose(said[0].phi, said[1].phi, atol=1e-9)


def test_an_arm_that_is_elsewhere_after_a_pause_is_believed(online, log):
    samples = list(log)
    later = [Sample(s.t + 5.0, s.q, s.dq, s.tau) for s in samples[600:900]]
    fed(online, samples[:300])
    estimate = fed(online, later)
    assert online.health.used == 600
    assert online.health.pauses == 1
    assert np.isfinite(estimate.phi).all()


def test_repeated_and_late_samples_count_once(online, log, clean):
    samples = list(log)[:60]
    stream = []
    for k, sample in enumerate(samples):
        stream += [sample, sample] + ([samples[k - 3]] if k > 5 else [])
    estimate = fed(online, stream)
    assert online.health.left_out["repeated"] == 60
    assert online.health.left_out["late"] == 54
    assert np.array_equal(estimate.phi, clean(len(samples)).phi)


@pytest.mark.parametrize("jump", [-3600.0, -2.0, 1e9])
@pytest.mark.full  # some seconds
def test_a_clock_that_is_set_anew_costs_nothing_but_a_pause(online, log, jump):
    samples = list(log)
    truth = make_payload().parameters.mass
    fed(online, samples[:600])
    estimate = fed(online, [Sample(s.t + jump, s.q, s.dq, s.tau) for s in samples[600:1100]])
    assert estimate.t == pytest.approx(samples[1099].t + jump)
    assert online.health.used == 1100
    assert abs(estimate.phi[0] - truth) < 3.0 * estimate.std[0]


def test_a_standing_arm_says_so_and_claims_no_inertia(panda, online):
    pose = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
    tau = panda.with_payload(make_payload().parameters).torque(pose)
    estimate = fed(online, [Sample(0.01 * k, pose, np.zeros(7), tau) for k in range(300)])
    assert not estimate.moving
    assert "not moving: inertia undetermined" in estimate.notes
    assert not estimate.determined[4:].any()
    assert abs(estimate.phi[0] - make_payload().parameters.mass) < 2.0 * estimate.std[0]


# ---------------------------------------------------------------------- an old answer does not look like a new one


def test_an_answer_ages_and_says_why_while_no_sample_can_be_used(online, log):
    samples = list(log)
    before = fed(online, samples[:600])
    assert before.age < 0.02
    assert before.notes == ()
    dead = [(s.t, s.q, s.dq, np.where(np.arange(7) == 2, np.nan, s.tau)) for s in samples[600:900]]
    after = fed(online, dead)
    assert after.t == pytest.approx(samples[899].t)
    assert after.age == pytest.approx(before.age + 1.5, abs=1e-6)
    assert not after.moving  # nobody saw it move
    assert after.notes == ("no sample could be used for 1.5 s (300 left out): torque of joint 3 is not a number",)
    told = after.to_dict()
    assert (told["left_out"], told["left_out_why"]) == (300, {"not finite": 300})
    assert np.array_equal(after.phi, before.phi)
    again = fed(online, samples[900:940])
    assert again.notes == ()
    assert again.age < 0.02


def test_an_answer_is_as_old_as_the_pause_before_it(online, log):
    samples = list(log)[:300]
    before = fed(online, samples)
    later = samples[-1]._replace(t=samples[-1].t + 8.0)
    assert online.update(*later).age == pytest.approx(before.age + 8.0)


@pytest.mark.parametrize("rate", [200.0, 500.0, 1000.0])
def test_a_live_answer_is_at_most_ten_milliseconds_old_though_rows_are_taken_together(panda, online, rate):
    log = simulate(panda, taie2024(), world=World.real_like(panda, seed=1), rate=rate, seed=2).between(0.0, 0.8)
    ages = [online.update(*sample).age for sample in log][int(0.1 * rate) :]
    assert max(ages) <= 0.0101


BAD_STREAMS = {
    "degrees": (lambda t, *x: (t, *np.degrees(x[:2]), x[2]), "position of joint .* is it in degrees"),
    "no torque": (lambda t, q, dq, _: (t, q, dq, np.full(7, np.nan)), "torque of joint 1 is not a number"),
    "no time": (lambda _, *x: (np.nan, *x), "the time is not a number"),
    "one time": (lambda _, *x: (5.0, *x), "the time of the samples does not change"),
    "six joints": (lambda t, *x: (t, *(a[:6] for a in x)), "expected 7 joints, found position"),
    "no lists": (lambda t, *_: (t, None, None, "x"), "expected"),
    "milliseconds": (lambda t, *x: (1e3 * t, *x), "samples come 5 s apart: .* in seconds"),
}


@pytest.mark.parametrize("bad", BAD_STREAMS)
def test_a_stream_of_which_nothing_can_be_used_says_why(online, log, bad):
    change, expected = BAD_STREAMS[bad]
    estimate = fed(online, [change(*sample) for sample in list(log)[:120]])
    (note,) = [note for note in estimate.notes if "moving" not in note]
    assert re.search(expected, note)
    assert note == online.trouble
    assert not estimate.determined.any()


def motion_that_ends(panda, payload, moves=6.0, stands=2.0, rate=200.0):
    """Samples of an arm with a payload that comes to rest smoothly and stands there."""
    t = np.arange(0.0, moves + stands, 1.0 / rate)
    fine = np.arange(-0.01, moves + stands + 0.01, 1e-4)
    fade = np.clip((moves - fine) / 1.5, 0.0, 1.0)
    size = np.sin(0.5 * np.pi * fade**2 * (3.0 - 2.0 * fade)) ** 3
    waves = np.sin(np.outer(fine, np.linspace(1.5, 3.5, 7)) + np.arange(7))
    q = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8]) + 0.35 * size[:, None] * waves
    dq = np.gradient(q, 1e-4, axis=0)
    q, dq, ddq = (
        np.column_stack([np.interp(t, fine, x) for x in each.T]) for each in (q, dq, np.gradient(dq, 1e-4, axis=0))
    )
    loaded = panda.with_payload(payload)
    return [Sample(t[k], q[k], dq[k], loaded.torque(q[k], dq[k], ddq[k])) for k in range(len(t))]


class Client:
    """A Franka that stands still, without an end effector."""

    m_ee, dq, told = 0.0, np.zeros(7), None

    def read_once(self):
        return self

    def set_load(self, *told):
        self.told = told


def test_a_standing_arm_says_so_ages_and_can_be_written(panda, online):
    payload = make_payload().parameters
    samples = motion_that_ends(panda, payload)
    estimates = [online.update(*sample) for sample in samples]
    moving = [e for e in estimates if 1.0 < e.t < 4.5]
    assert max(e.age for e in moving) < 0.02
    assert not any(e.notes for e in moving)
    last = estimates[-1]
    assert any(note.startswith("standing") for note in last.notes)
    assert 1.0 < last.age < 2.5  # since the rows that counted last
    ages = np.array([e.age for e in estimates if e.t > 7.0])
    assert np.ptp(np.diff(ages)) == pytest.approx(0.0, abs=1e-9)
    assert ages[-1] - ages[0] == pytest.approx(samples[-1].t - 7.0, abs=0.011)
    client = Client()
    franka_robot.set_load(client, Load.of(last, panda), panda, write=True, allow_undetermined_inertia=True)
    assert client.told[0] == pytest.approx(payload.mass, abs=0.02)


def test_the_mass_of_a_change_is_what_the_runs_tell_once_its_kind_is_known(panda):
    payload = make_payload().parameters
    with Simulator(
        panda, payloads=[(4.0, payload), (8.0, None)], speed=None, rate=200.0, duration=10.0, seed=1
    ) as source:
        identifier = OnlineIdentifier(panda, method="map-gp")
        events = {}
        for sample in source:
            event = identifier.update(*sample).event
            if event is not None:
                events.setdefault(event.t, {})[event.kind == "change"] = event.mass
        identifier.close()
    (taken, put) = events.values()
    assert taken[False] == pytest.approx(payload.mass, abs=0.15)
    assert put[False] == pytest.approx(-payload.mass, abs=0.05)


@pytest.mark.parametrize("method", [name for name, entry in METHODS.items() if not entry.needs])
def test_any_method_of_the_catalogue_runs_beside_a_robot(panda, log, method):
    identifier = OnlineIdentifier(panda, method=method)
    estimate = fed(identifier, list(log)[:60])
    identifier.update(float("nan"), None, 1, "x")
    json.dumps(estimate.to_dict(), allow_nan=False)
    json.dumps(OnlineIdentifier(panda, method=method).update(0.0, None, None, None).to_dict(), allow_nan=False)
    identifier.close()
    assert estimate.method == method
    assert np.isfinite(estimate.phi).all()
    assert estimate.n_samples > 0


@pytest.mark.parametrize("cut", [7, 30, 300])
@pytest.mark.parametrize("method", [None, "map", "rls-filter"])
@pytest.mark.full  # some seconds
def test_a_saved_state_goes_on_exactly(panda, log, tmp_path, method, cut):
    samples = list(log)[:400]
    identifier = OnlineIdentifier(panda, method=method)
    fed(identifier, samples[:cut])
    path = identifier.save(tmp_path / "state.npz")
    restored = OnlineIdentifier.restore(path, panda, method)
    here, there = fed(identifier, samples[cut:]), fed(restored, samples[cut:])
    for each in (identifier, restored):
        each.close()
    assert np.array_equal(here.phi, there.phi)
    assert np.array_equal(here.covariance, there.covariance)
    assert str(restored.health) == str(identifier.health)


def test_a_saved_state_keeps_its_tare(panda, log, tmp_path):
    tare = simulate(panda, random_motion(panda, seed=5, duration=4.0), rate=100.0)
    identifier = OnlineIdentifier(panda, tare)
    fed(identifier, list(log)[:100])
    restored = OnlineIdentifier.restore(identifier.save(tmp_path / "state.npz"), panda)
    here, there = (fed(each, list(log)[100:300]) for each in (identifier, restored))
    for each in (identifier, restored):
        each.close()
    assert there.relative_to == "tare"
    assert np.array_equal(here.phi, there.phi)


@pytest.mark.parametrize("cut", [605, 626])  # samples: a solution is being found; the run after a change is made
def test_a_copy_of_a_stream_goes_on_exactly(panda, online, log, cut):
    empty = simulate(panda, taie2024(), world=World.real_like(panda, seed=3), rate=200.0, seed=1)
    samples = [*list(empty)[:600], *list(log)[600:700]]
    fed(online, samples[:cut])
    copied = deepcopy(online)
    here, there = ([fed(each, [sample]) for sample in samples[cut:]] for each in (online, copied))
    copied.close()
    assert here[-1].event is not None
    for one, two in zip(here, there, strict=True):
        assert np.array_equal(one.phi, two.phi)
        assert np.array_equal(one.covariance, two.covariance)


def test_a_state_does_not_grow(panda, online, tmp_path):
    long = simulate(panda, taie2024(), rate=50.0)
    sizes = []
    for turn in range(3):  # of six seconds each
        for sample in long:
            online.update(sample.t + 10.0 * turn, *sample[1:])
        sizes.append(online.save(tmp_path / f"{turn}.npz").stat().st_size)
    # a hundred rows that wait to be handed over, 1.4 MB, come and go; those of a turn would be 4 MB
    assert sizes[2] <= sizes[1] + 1_500_000


def test_a_state_is_neither_looked_for_in_a_pipe_nor_written_into_one(panda, online, log, tmp_path):
    """A stream would wait there for ever."""
    path, said = tmp_path / "state.npz", []
    os.mkfifo(path)
    fed(online, list(log)[:50])

    def asked():
        for ask in (lambda: online.save(path), lambda: saved_at(path), lambda: OnlineIdentifier.restore(path, panda)):
            try:
                ask()
            except (OSError, IdentificationError) as error:
                said.append(str(error))

    thread = threading.Thread(target=asked, daemon=True)
    thread.start()
    thread.join(60.0)
    assert len(said) == 3
    assert all("it is no regular file" in text for text in said)


def test_a_state_of_another_arm_or_no_state_is_refused(panda, online, log, tmp_path):
    fed(online, list(log)[:50])
    path = online.save(tmp_path / "state.npz")
    with pytest.raises(IdentificationError, match="another arm"):
        OnlineIdentifier.restore(path, arm("panda", gravity=(0.0, 3.0, -9.0)))
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(IdentificationError, match="no state"):
        OnlineIdentifier.restore(path, panda)
    with pytest.raises(IdentificationError, match="no saved state"):
        OnlineIdentifier.restore(tmp_path / "none.npz", panda)


def retrained(model, change):
    """A hybrid model of which one number is another."""
    if change == "prior":
        means = model.prior.means.copy()
        means[0, 0] += 1e-9
        return replace(model, prior=replace(model.prior, means=means))
    if change == "bag":
        trees, *others = model.calibration.bag.parts
        bag = AveragedMembers((replace(trees, values=trees.values + 1e-9), *others))
        return replace(model, calibration=replace(model.calibration, bag=bag))
    return replace(model, calibration=replace(model.calibration, level=1.001 * model.calibration.level))


@pytest.mark.parametrize("change", ["prior", "bag", "level"])
def test_a_state_of_another_trained_model_is_refused(panda, online, log, tmp_path, change):
    fed(online, list(log)[:50])
    path = online.save(tmp_path / "state.npz")
    model = shipped_model(panda)
    other = retrained(model, change).save(tmp_path / "other.safetensors")
    with pytest.raises(IdentificationError, match=r"saved with .* trained model .*: found .*; give .* or begin anew"):
        OnlineIdentifier.restore(path, panda, other)
    with pytest.raises(IdentificationError, match="found the method map, which has no trained model"):
        OnlineIdentifier.restore(path, panda, "map")


def test_a_state_goes_on_with_its_model_whatever_the_file_is_called_and_says_of_itself(panda, online, log, tmp_path):
    samples = list(log)[:120]
    fed(online, samples[:50])
    model = shipped_model(panda)
    same = replace(model, provenance={**model.provenance, "note": "copied"}).save(tmp_path / "same.safetensors")
    restored = OnlineIdentifier.restore(online.save(tmp_path / "state.npz"), panda, same)
    again = OnlineIdentifier.restore(restored.save(tmp_path / "again.npz"), panda)  # from one that was restored
    phis = [fed(each, samples[50:]).phi for each in (online, restored, again)]
    for each in (restored, again):
        each.close()
    np.testing.assert_array_equal(phis[0], phis[1])
    np.testing.assert_array_equal(phis[0], phis[2])


def test_a_state_says_when_it_was_saved_whatever_the_date_of_its_file(online, log, tmp_path):
    fed(online, list(log)[:50])
    before = time.time()
    path = online.save(tmp_path / "state.npz")
    os.utime(path, (0.0, 0.0))
    assert before <= saved_at(path) <= time.time()


def test_a_state_of_an_earlier_format_is_refused(panda, online, log, tmp_path):
    fed(online, list(log)[:50])
    path = online.save(tmp_path / "state.npz")
    with np.load(path) as data:
        arrays = dict(data)
    text = json.loads(arrays["tree"].tobytes().decode())
    del text["origin"]  # where format 1 had none
    arrays["tree"] = np.frombuffer(json.dumps({**text, "format": 1}).encode(), dtype=np.uint8)
    np.savez(path, **arrays)
    with pytest.raises(IdentificationError, match="another version of armload: begin without it"):
        OnlineIdentifier.restore(path, panda)


def test_a_state_file_makes_nothing_that_is_not_armloads(panda, online, log, tmp_path):
    fed(online, list(log)[:50])
    path = online.save(tmp_path / "state.npz")
    with np.load(path) as data:
        arrays = dict(data)
    text = arrays["tree"].tobytes().decode().replace("armload.online.gate.Health", "subprocess.Popen")
    assert "subprocess" in text
    arrays["tree"] = np.frombuffer(text.encode(), dtype=np.uint8)
    np.savez(path, **arrays)
    with pytest.raises(IdentificationError, match="it holds a subprocess"):
        OnlineIdentifier.restore(path, panda)
