"""What is known of a payload, on a stream: taken while it is held, and of nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from armload import Recording, arm
from armload.devices import Simulator
from armload.errors import IdentificationError
from armload.inertia import InertialParameters
from armload.motion import random_motion
from armload.online import OnlineIdentifier
from armload.posterior import Known
from armload.simulation import Sensors, World

MASS, COM = 1.2, (0.01, -0.02, 0.07)


def body(mass):
    return InertialParameters.from_com(mass, COM, mass * np.diag([1.5e-3, 1.7e-3, 8e-4]))


@pytest.fixture(scope="module")
def log():
    """Nothing, then the payload that is known from 3 s on, nothing from 6 s on, another payload from 9 s on."""
    panda = arm("panda")
    held = [(0.0, None), (3.0, body(MASS)), (6.0, None), (9.0, body(0.5))]
    how = {"world": World.real_like(panda, 4), "sensors": Sensors.panda(panda), "rate": 100.0}
    source = Simulator(panda, random_motion(panda, 4), held, speed=None, duration=12.0, seed=4, **how)
    return Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]


def said(log, known):
    identifier = OnlineIdentifier(arm("panda"), known=known)
    estimates = [identifier.update(*sample) for sample in log]
    identifier.close()
    return estimates


@pytest.mark.full  # some seconds
def test_a_weighed_mass_is_taken_while_it_may_be_held_and_claimed_of_nothing_else(log):
    known = Known.of((MASS, 2e-3), (COM, 2e-3), if_held=True)
    plain, told = said(log.between(0.0, 6.0), None), said(log, known)
    for t, estimate in zip(log.t, told, strict=True):
        if not 3.0 <= t < 7.0:  # what was put down is noticed by then
            assert abs(estimate.phi[0] - MASS) > 0.01 or estimate.std[0] > 0.01
    at = {t: np.searchsorted(log.t, t) - 1 for t in (2.9, 5.9, 8.9, 12.0)}
    empty, held, down, other = (told[k] for k in at.values())
    assert not empty.held
    assert not down.held
    assert abs(down.phi[0]) < 0.1
    assert held.held
    assert held.phi[0] == pytest.approx(MASS, abs=5e-3)
    assert held.std[0] < 0.5 * plain[at[5.9]].std[0]
    assert held.phi[1:4] / held.phi[0] == pytest.approx(COM, abs=4e-3)
    assert np.all(held.std[1:4] < plain[at[5.9]].std[1:4])
    assert other.held
    assert other.phi[0] == pytest.approx(0.5, abs=0.1)
    assert any("the mass given" in note for note in other.notes)
    assert not any("given" in note for note in (*empty.notes, *held.notes, *down.notes))


def test_what_is_known_now_counts_on_a_stream_that_is_taken_up_again(log, tmp_path):
    first = OnlineIdentifier(arm("panda"), method="map", known=Known.of((MASS, 2e-3), None, if_held=True))
    for sample in log.between(3.0, 4.0):
        first.update(*sample)
    first.save(tmp_path / "state.npz")
    first.close()
    known = Known.of((MASS + 5e-3, 1e-4), None, if_held=True)
    again = OnlineIdentifier.restore(tmp_path / "state.npz", arm("panda"), method="map", known=known)
    for sample in log.between(4.0, 5.9):
        estimate = again.update(*sample)
    again.close()
    assert estimate.phi[0] == pytest.approx(MASS + 5e-3, abs=1e-3)


def test_what_is_known_now_counts_for_the_run_that_begins_as_a_stream_is_taken_up_again(log, tmp_path):
    first = OnlineIdentifier(arm("panda"), method="map-gp")
    for sample in log.between(0.0, 5.9):
        if first.update(*sample).settling:
            break
    first.save(tmp_path / "state.npz")
    first.close()
    known = Known.of((MASS, 1e-4), None, if_held=True)
    again = OnlineIdentifier.restore(tmp_path / "state.npz", arm("panda"), method="map-gp", known=known)
    estimates = [again.update(*x) for x in log.between(sample.t + 1e-6, 5.9)]
    again.close()
    assert estimates[0].settling
    assert not estimates[-1].settling
    assert estimates[-1].phi[0] == pytest.approx(MASS, abs=1e-3)


def test_a_method_that_cannot_use_it_says_so():
    with pytest.raises(IdentificationError, match="cannot use what is known"):
        OnlineIdentifier(arm("panda"), method="rls-filter", known=Known.of((1.0, 0.1), None, if_held=True))
