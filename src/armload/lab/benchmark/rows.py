"""Who takes part: methods of the catalogue with or without the tare, two baselines, and the bound."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.estimators import Identifier
from armload.identification import METHODS
from armload.lab.benchmark.populations import Population
from armload.lab.cells import key_of
from armload.lab.episodes import EpisodeLogs, Recipe, draw_episodes, simulate_episodes
from armload.lab.evaluation import PriorLeastSquares, TrainingMean
from armload.recording import Recording
from armload.regression import GaussianPrior

BASELINES = (TrainingMean.name, PriorLeastSquares.name)
BOUND = "bound"
TARED = "+tare"
_ON_REQUEST = ("ekf", "lmi", "log-cholesky", "polynomial")  # slow, or nearly the same as another row
_WITHOUT_TOO = ("rls-filter", "rls")  # the field's benchmark: shown with and without its calibration
_LEFT_OUT = {
    "training": "needs a model trained for one motion, which no episode here runs",
    "motion": "needs the commanded motion, which a log does not hold",
}
_TRAINED = ("population", "episodes", "seed")  # what of a model's training the page repeats
_PROBE = Recipe(duration=2.0, same_motion=1.0)
_PROBE_SEED, _PROBE_RATE, _PROBE_TIMES = 5, 100.0, (0.1, 1.0, 2.0)
_DIGITS = 5  # of an answer that count as the same


@dataclass(frozen=True)
class Row:
    """A row of the benchmark's tables.

    name: as in the tables; `+tare` marks a method that subtracts its estimate of the tare (virtual calibration); the
        name without it marks the method without that. method: its name in the catalogue; "" for a baseline. tared:
        whether it is given the tare, where there is one.
    """

    name: str
    method: str
    tared: bool

    def make(self, arm: Arm, tare: Recording | None, prior: GaussianPrior) -> Identifier:
        """The identifier for one episode; `prior` is what the baselines know."""
        if self.name == TrainingMean.name:
            return TrainingMean(arm, prior.mean, prior.covariance)
        if self.name == PriorLeastSquares.name:
            return PriorLeastSquares(arm, prior.mean, prior.covariance, tare)
        return METHODS[self.method].make(arm, tare if self.tared else None)


def default_names() -> list[str]:
    """The rows measured unless others are asked for: the whole catalogue but what is slow, left out or trained."""
    names = []
    for name, method in METHODS.items():
        if name in _ON_REQUEST or method.needs in _LEFT_OUT:
            continue
        calibrated = method.tare == "virtual calibration"
        names += [name + TARED] if calibrated else [name]
        names += [name] if name in _WITHOUT_TOO else []
    return names


def left_out() -> dict[str, str]:
    """Methods of the catalogue that cannot take part, with the reason."""
    return {name: _LEFT_OUT[method.needs] for name, method in METHODS.items() if method.needs in _LEFT_OUT}


def rows_for(population: Population, names: Iterable[str]) -> list[Row]:
    """The rows of a population: those asked for that can run on its logs, then the baselines and the bound.

    Raises:
        IdentificationError: a name that is not in the catalogue, or a method that cannot take part.
    """
    rows = {row.name: row for name in names if (row := _row(name, population)) is not None}
    return [*rows.values(), *(Row(name, "", True) for name in (*BASELINES, BOUND))]


def _row(name: str, population: Population) -> Row | None:
    method = METHODS.get(name.removesuffix(TARED))
    if method is None:
        near = difflib.get_close_matches(name, [*METHODS, *default_names()], 1)
        raise IdentificationError(
            f"the catalogue has no method {name!r}: expected some of {', '.join(default_names())}"
            + (f"; did you mean {near[0]!r}?" if near else "")
        )
    if method.needs in _LEFT_OUT:
        raise IdentificationError(f"the method {method.name} cannot take part: it {_LEFT_OUT[method.needs]}")
    if method.tare != "virtual calibration":
        if name.endswith(TARED):
            raise IdentificationError(f"{name!r}: the method {method.name} has no calibration; name it without {TARED}")
        needed = method.needs == "tare" and not population.has_tare
        other = method.tare == "same motion" and not population.same_motion
        return None if needed or other else Row(name, name, method.tare != "none")
    tared = name.endswith(TARED) and population.has_tare
    return Row(method.name + (TARED if tared else ""), method.name, tared)


def fingerprint(row: Row, arm: Arm, prior: GaussianPrior) -> str:
    """SHA-256 of what a row answers on a log made for this purpose, to five digits: changes when its numbers would."""
    logs = _probe(arm)
    if row.name == BOUND:
        answers = [bound_std(arm, logs, prior, _PROBE_TIMES)]
    else:
        found = row.make(arm, logs.tare, prior).at(logs.run, _PROBE_TIMES)
        answers = [x for estimate in found for x in (estimate.phi, estimate.std)]
    shown = [[f"{float(x):.{_DIGITS - 1}e}" for x in np.ravel(answer)] for answer in answers]
    return key_of(row.name, shown)


@lru_cache(maxsize=2)
def _probe(arm: Arm) -> EpisodeLogs:
    return next(simulate_episodes(draw_episodes(arm, _PROBE, 1, _PROBE_SEED), rate=_PROBE_RATE))


def bound_std(arm: Arm, logs: EpisodeLogs, prior: GaussianPrior, times: Sequence[float]) -> np.ndarray:
    """Standard deviations (T, 10) of the Bayesian Cramér–Rao bound with the baselines' prior."""
    from armload.posterior import bound

    stops = np.minimum(times, logs.run.duration)
    return bound(arm, logs.run, tare=logs.tare, prior=prior, times=stops.tolist()).std


def trained_on(identifier: Any) -> str:
    """What a trained method says it was trained on, "" for one that was not."""
    training = getattr(getattr(identifier, "model", None), "training", None)
    return "" if training is None else ", ".join(f"{name} {getattr(training, name)}" for name in _TRAINED)
