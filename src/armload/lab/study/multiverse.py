"""Every claim under every reading of the paper that its text allows.

A reading settles what the paper leaves open: how inputs and outputs are scaled, when the training of the networks
stops, how rows are split, whether the ensembles of the experiment were trained in one stage or two, and of the rival
least squares the rate, the derivative, the forgetting and the calibration. `USUAL` is the reading of the other pages.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.inertia import NAMES
from armload.lab.study.numbers import EXACT, PAPER_EPOCHS, READING, Cell, Cells, cap
from armload.lab.study.plan import CAP
from armload.lab.study.readings import DEFAULT_STOP
from armload.lab.study.rivals import DERIVATIVES, RATES
from armload.lab.study.spec import REAL

LEVEL, DRAWS = 0.95, 2000  # of the intervals; of the bootstrap


class Reading(NamedTuple):
    """What the text leaves open; stages 0: mass and first moments from one stage, inertia from two, which the paper
    found better. tuned: the rival's settings are those of `rivals.tune`."""

    scale: str = "raw"
    stop: int = PAPER_EPOCHS
    split: str = "row"
    stages: int = 0
    rate: int = RATES[0]
    derivative: str = DERIVATIVES[0]
    tuned: bool = False
    calibrated: bool = False


USUAL = Reading()
AXES: dict[str, tuple[str, tuple[Any, ...]]] = {
    "the scaling": ("scale", ("raw", "standard")),
    "the stopping": ("stop", (PAPER_EPOCHS, CAP, DEFAULT_STOP)),
    "the split": ("split", ("row", "payload")),
    "the stages": ("stages", (0, 1, 2)),
    "the rate": ("rate", RATES),
    "the derivative": ("derivative", DERIVATIVES),
    "the tuning": ("tuned", (False, True)),
    "the calibration": ("calibrated", (False, True)),
}


class Compared(NamedTuple):
    """Errors of two methods on the same payloads or arms (U,) each."""

    better: NDArray[np.float64]
    worse: NDArray[np.float64]

    @property
    def log_ratio(self) -> float:
        """ln of the ratio of the mean errors; below zero, the better one is better."""
        return float(np.log(_floored(self.better.mean()) / _floored(self.worse.mean())))


class Improvement(NamedTuple):
    """By how many percent the error is lower, with its interval (None: a single unit), over so many units."""

    value: float
    low: float | None
    high: float | None
    units: int


class Multiverse:
    """The cells, ready to answer what a claim comes to under a reading."""

    def __init__(self, cells: Cells) -> None:
        self._cells: dict[tuple, dict[int, Cell]] = {}  # of ensembles, by what a reading names, then by seed
        self._rivals: dict[tuple, Cell] = {}
        self._kept: dict[tuple, NDArray[np.float64] | None] = {}
        for cell in cells.values():
            spec = cell["spec"]
            if spec["kind"] == "rival":
                key = tuple(spec[name] for name in ("derivative", "rate", "sensors", "calibrated", "tuned"))
                self._rivals[key] = cell
            elif spec["kind"] in ("tree", "network") and spec["sensors"] == "ideal":
                many = spec.get("ablation") == READING
                if many or spec.get("ablation") in (None, "scale"):
                    key = (spec["kind"], spec["stages"], spec["scale"], spec["split"], cap(cell), many)
                    self._cells.setdefault(key, {})[spec["seed"]] = cell
        self._longest = max((key[4] for key in self._cells if key[4] is not None), default=PAPER_EPOCHS)

    def axes(self, claim: Mapping[str, Any]) -> dict[str, tuple[Any, ...]]:
        """The axes that matter to a percentage: field of `Reading` → its values."""
        learners = claim["better"] + claim["worse"]
        names = ["the scaling", "the split"] + ["the stopping"] * ("network" in learners)
        if claim["on"] == "real":
            names += ["the stages", "the rate", "the tuning", "the calibration"]
            names += ["the derivative"] * (claim["worse"] == "rls")
        return {AXES[name][0]: AXES[name][1] for name in AXES if name in names}

    def readings(self, claim: Mapping[str, Any]) -> Iterator[Reading]:
        """Every combination of the axes that matter to a percentage."""
        axes = self.axes(claim) | ({"stages": (1, 2)} if claim["on"] == "real" else {})
        for values in product(*axes.values()):
            yield USUAL._replace(**dict(zip(axes, values, strict=True)))

    def compared(self, claim: Mapping[str, Any], reading: Reading = USUAL, seed: int | None = None) -> Compared | None:
        """The errors behind a percentage; None: a cell is missing. seed: of the cells with several; None: what is best.

        Cells with a row for every payload, or with many arms, go before those without.
        """
        column = NAMES.index(claim["parameter"])
        if claim["on"] == "held_out":
            found = [self._ensemble(*_kind(claim[side]), reading, "held_out", seed) for side in ("better", "worse")]
        else:
            stages = reading.stages or (1 if column < 4 else 2)
            found = [self._ensemble(claim["better"], stages, reading, REAL, seed), self._rival(claim["worse"], reading)]
        if found[0] is None or found[1] is None:
            return None
        if claim["on"] == "held_out" and len(found[0]) != len(found[1]):  # one has no row for each payload
            found = [errors.mean(axis=0, keepdims=True) for errors in found if errors is not None]
        units = min(len(errors) for errors in found if errors is not None)  # the first arms are the same
        return Compared(*(errors[:units, column] for errors in found if errors is not None))

    def improvement(self, claim: Mapping[str, Any], reading: Reading = USUAL) -> Improvement | None:
        """A percentage of the paper in our numbers, under a reading."""
        pair = self.compared(claim, reading)
        if pair is None:
            return None
        bounds = interval(pair)
        if bounds is not None:
            shifts = [0.0, *self._seed_shifts(claim, reading)]
            bounds = min(bounds[0], pair.log_ratio + min(shifts)), max(bounds[1], pair.log_ratio + max(shifts))
        low, high = (None, None) if bounds is None else (percent(bounds[1]), percent(bounds[0]))
        return Improvement(percent(pair.log_ratio), low, high, len(pair.better))

    def log_ratio(self, claim: Mapping[str, Any], reading: Reading) -> float | None:
        """ln of the ratio of the two errors under a reading, without an interval."""
        pair = self.compared(claim, reading)
        return None if pair is None else pair.log_ratio

    def _seed_shifts(self, claim: Mapping[str, Any], reading: Reading) -> list[float]:
        """By how much other seeds move the log of the ratio, from the cells that were trained with several."""
        at = reading._replace(stop=CAP)
        pairs = [self.compared(claim, at, seed) for seed in (0, 1, 2)]
        if pairs[0] is None:
            return []
        return [pair.log_ratio - pairs[0].log_ratio for pair in pairs[1:] if pair is not None]

    def _ensemble(
        self, kind: str, stages: int, reading: Reading, protocol: str, seed: int | None
    ) -> NDArray[np.float64] | None:
        stop = min(reading.stop, self._longest) if kind == "network" else None  # a quick study has small caps only
        key = (kind, stages, reading.scale, reading.split, stop)
        if (*key, protocol, seed) not in self._kept:
            self._kept[(*key, protocol, seed)] = self._errors(key, protocol, seed)
        return self._kept[(*key, protocol, seed)]

    def _errors(self, key: tuple, protocol: str, seed: int | None) -> NDArray[np.float64] | None:
        if seed is None and (many := self._cells.get((*key, True), {}).get(0)) is not None:
            part = many["protocols"][protocol]
            return np.array(part["payloads" if protocol == "held_out" else "running"], dtype=float)
        by_seed = self._cells.get((*key, False), {})
        group = list(by_seed.values()) if seed is None else [by_seed[seed]] if seed in by_seed else []
        parts = [cell["protocols"].get(protocol) for cell in group]
        if not parts or any(part is None for part in parts):
            return None
        if protocol == "held_out":
            return np.mean([part["single"] for part in parts if part], axis=0)[None]
        return np.mean([part["running"] for part in parts if part], axis=0)

    def _rival(self, method: str, reading: Reading) -> NDArray[np.float64] | None:
        derivative = "filter" if method == "rls-filter" else reading.derivative
        cell = self._rivals.get((derivative, reading.rate, "panda", reading.calibrated, reading.tuned))
        return None if cell is None else np.array(cell["protocols"][REAL]["second_half"], dtype=float)


def interval(pair: Compared) -> tuple[float, float] | None:
    """Bounds of ln(mean better / mean worse): 95 % of a bootstrap over payloads or arms, drawn for both alike.

    None for a single unit. Percentile interval (Efron & Tibshirani 1993, chapter 13).
    """
    units = len(pair.better)
    if units < 2:
        return None
    weight = np.random.default_rng(units).multinomial(units, np.full(units, 1.0 / units), DRAWS)
    drawn = np.log(_floored(weight @ pair.better / units) / _floored(weight @ pair.worse / units))
    low, high = np.quantile(drawn, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    return float(low), float(high)


def percent(log_ratio: float) -> float:
    """100·(1 − e^x): by how many percent an error is lower whose ratio to the other has the logarithm x."""
    return 100.0 * (1.0 - float(np.exp(log_ratio)))


def _kind(name: str) -> tuple[str, int]:
    kind, _, stages = name.partition("-")
    return kind, int(stages)


def _floored(error: Any) -> Any:
    return np.maximum(error, EXACT)
