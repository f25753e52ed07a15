"""Whether an arm holds things loosely, from the rows of many logs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import linregress

from armload.survey.looseness import FALSE_ALARMS, FEWEST_PARTS, LAST_PARTS, looseness
from armload.survey.rows import PLAY


def rows(rng, count, play=0.0, own=0.0, std=2e-3):
    """Parts with masses of 0 to 2 kg, along all axes: what slides gives 2·m·play, what the arm does wrong gives own."""
    made = []
    for _ in range(count):
        mass = float(rng.uniform(0.0, 2.0))
        values = {f"play_{axis}": 2.0 * mass * play + own + std * float(rng.normal()) for axis in PLAY}
        made.append({"mass": mass, **values, **{f"play_{axis}_std": std for axis in PLAY}})
    return made


def test_the_play_and_its_error_are_those_of_a_line_through_the_parts():
    made = rows(np.random.default_rng(1), 30, play=0.003, own=0.004)
    found = looseness(made)
    line = linregress([r["mass"] for r in made], [r[f"play_{found.axis}"] for r in made])
    assert (found.play, found.std) == pytest.approx((line.slope / 2.0, line.stderr / 2.0), rel=1e-9)
    assert found.statistic == pytest.approx(line.slope / line.stderr)
    assert found.found
    assert found.play == pytest.approx(0.003, abs=4.0 * found.std)


def test_sound_arms_are_called_loose_as_seldom_as_is_stated():
    rng, count = np.random.default_rng(2), 400
    alarms = sum(looseness(rows(rng, 20, own=0.004)).found for _ in range(count))
    assert alarms <= 5 + FALSE_ALARMS * count  # 0.4 are expected; 6 have a chance of 1e-6


def test_how_far_the_standard_deviations_are_off_does_not_matter():
    made = rows(np.random.default_rng(3), 30, play=0.003)
    other = [{name: x * (7.0 if name.endswith("_std") else 1.0) for name, x in row.items()} for row in made]
    assert looseness(other).statistic == pytest.approx(looseness(made).statistic)


def test_an_arm_that_was_put_right_is_sound_again_and_few_parts_say_nothing():
    rng = np.random.default_rng(4)
    loose, mended = rows(rng, 60, play=0.004), rows(rng, LAST_PARTS)
    assert looseness(loose).found
    assert not looseness([*loose, *mended]).found
    assert looseness(loose[: FEWEST_PARTS - 1]) is None
    assert looseness([row | {"mass": 1.0} for row in loose]) is None  # all of one mass
    assert looseness([row | {f"play_{axis}_std": None for axis in PLAY} for row in loose]) is None
