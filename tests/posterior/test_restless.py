"""A payload that swings or sloshes shows in the torques' restlessness, which a rigid one does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import arm
from armload.identification import identify
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.online import OnlineIdentifier
from armload.posterior import HybridIdentifier
from armload.regression import Correction, JointFeatures
from armload.regression.information import RegressionData
from armload.regression.lag import GAIN
from armload.regression.rows import REGRESSOR_RATE, FilteredRegression


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def sound(panda):
    return list(simulate_episodes(draw_episodes(panda, "reference", 3, seed=300, motions=3)))


def swinging(panda, run, force=3.0, hertz=2.0):
    """The run with what a part adds that swings at the payload frame's origin [N]."""
    along = panda.frame_motion(run.q).jacobian[:, 3:]  # (N, 3, n) linear rows
    wave = np.sin(2.0 * np.pi * hertz * (run.t - run.t[0]))
    return replace(run, tau=run.tau + force * wave[:, None] * along.sum(axis=1))


def test_the_residual_s_power_is_that_of_its_rows(panda, sound):
    log, rng = sound[0].run.between(0.0, 2.0), np.random.default_rng(0)
    correction, features = Correction(panda, panda.limits.effort), JointFeatures(7, 8, 4)
    data = RegressionData(correction, GAIN, features, 0.25)
    data.add(log.t, log.q, log.dq, log.tau)
    x, weights = rng.normal(size=10 + correction.size), rng.normal(size=(7, features.size))
    rows = FilteredRegression(panda, GAIN, correction, features, REGRESSOR_RATE, 0.25).rows(
        log.t, log.q, log.dq, log.tau
    )
    full = np.concatenate([np.broadcast_to(x, (7, len(x))), weights], axis=1)
    left = rows.r - np.einsum("mjk,jk->mj", rows.X, full)
    power = (rows.h[:, None] * rows.weights * left**2).sum(axis=0) / data.blocks.duration
    np.testing.assert_allclose(data.residual_power(x, weights), power, rtol=1e-9)
    joined = RegressionData.joined([data, data])
    np.testing.assert_allclose(joined.residual_power(x, weights), power, rtol=1e-9)


@pytest.mark.full
def test_a_rigid_payload_is_no_more_restless_than_its_tare(panda, sound):
    for log in sound:
        identifier = HybridIdentifier(panda, log.tare)
        identifier.run(log.run)
        assert 0.3 < identifier.stream.restlessness < 1.9
        identifier = HybridIdentifier(panda)
        identifier.run(log.run)
        assert identifier.stream.restlessness == 0.0  # nobody knows how restless the arm is


@pytest.mark.full  # some seconds
def test_a_payload_that_swings_is_said_to(panda, sound):
    log = sound[0]
    answer = identify(swinging(panda, log.run), panda, tare=log.tare)
    assert answer.interval == "approximate"
    assert any("swing, slosh or slip" in note for note in answer.notes)


def test_a_stream_says_while_it_runs_that_what_is_held_swings(panda, sound):
    log = sound[1]
    for run, moves in ((swinging(panda, log.run, force=2.0), True), (log.run, False)):
        online = OnlineIdentifier(panda, log.tare)
        said = [online.update(*sample) for sample in run.between(0.0, 4.0)]
        online.close()
        late = [each for each in said if each.t - run.t[0] >= 2.0 and not each.settling]
        assert any("swing, slosh or slip" in note for each in late for note in each.notes) == moves
        assert any(each.interval == "calibrated" for each in late) != moves
