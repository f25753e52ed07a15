"""The result of a comparison: estimates of every method on every run over time, and the tables made of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.errors import IdentificationError
from armload.inertia import NAMES, UNITS
from armload.lab.evaluation import metrics
from armload.lab.report.shown import GROUPS, SHOWN_SCALE, SHOWN_UNITS, Table, parameter_columns, short

SETTLED = 0.05  # the mass has settled when it stays within this fraction of the true mass
_ARRAYS = ("times", "truth", "phi", "std", "samples", "wall", "lengths")


@dataclass(frozen=True, eq=False)
class Comparison:
    """Estimates of M methods on R runs at T times, with all that a table needs to be honest. SI units.

    methods: names of the rows; baselines: those among them that are baselines; averaged: those whose estimate is the
        average of single predictions (learned methods).
    labels: names of the runs. times: (T,) since the start of each run [s]. truth: (R, 10).
    phi, std: (M, R, T, 10), estimates and the methods' own standard deviations (infinite: unknown).
    samples: (M, R, T) used until then. wall: (M, R) computing time [s] of a whole run of `lengths` (R,) samples.
    robot, frame: whose payload, about which frame.
    split, seeds, prior: what was held out, what the runs were drawn with, what the baselines know.
    """

    methods: tuple[str, ...]
    baselines: tuple[str, ...]
    averaged: tuple[str, ...]
    labels: tuple[str, ...]
    times: NDArray[np.float64]
    truth: NDArray[np.float64]
    phi: NDArray[np.float64]
    std: NDArray[np.float64]
    samples: NDArray[np.int_]
    wall: NDArray[np.float64]
    lengths: NDArray[np.int_]
    robot: str
    frame: str
    split: str
    seeds: tuple[int, ...]
    prior: str

    # ------------------------------------------------------------------ numbers

    @property
    def error(self) -> NDArray[np.float64]:
        """Signed errors (M, R, T, 10)."""
        return self.phi - self.truth[:, None]

    @property
    def mae(self) -> NDArray[np.float64]:
        """Mean absolute error over runs (M, T, 10); `mae[:, -1]` is at the end."""
        return metrics.mean_absolute_error(self.phi, self.truth[:, None], axis=1)

    @property
    def spread(self) -> NDArray[np.float64]:
        """Standard deviation of the absolute error over runs (M, T, 10)."""
        return metrics.spread(self.phi, self.truth[:, None], axis=1)

    def coverage(self, level: float = 0.95) -> NDArray[np.float64]:
        """Share of runs whose interval at the end holds the truth (M, 10)."""
        return metrics.coverage(self.phi[:, :, -1], self.std[:, :, -1], self.truth, level, axis=1)

    def half_width(self, level: float = 0.95) -> NDArray[np.float64]:
        """Mean half-width of the intervals at the end (M, 10)."""
        return metrics.half_width(self.std[:, :, -1], level).mean(axis=1)

    @property
    def settling(self) -> NDArray[np.float64]:
        """Time (M, R) [s] from which on the mass stays within 5 % of the true mass of its last estimate."""
        band = SETTLED * np.abs(self.truth[:, 0])
        rows = self.phi[..., 0]
        return np.array([[metrics.settling_time(self.times, x, b) for x, b in zip(m, band, strict=True)] for m in rows])

    @property
    def per_sample(self) -> NDArray[np.float64]:
        """Computing time per sample (M,) [s], median over runs."""
        return np.median(self.wall / self.lengths, axis=1)

    # ------------------------------------------------------------------ tables

    @property
    def conditions(self) -> str:
        """What the numbers rest on, in one line: it stands under every table."""
        runs = "1 run" if len(self.labels) == 1 else f"{len(self.labels)} runs"
        seeds = "no seeds" if not self.seeds else "seeds " + ", ".join(map(str, self.seeds))
        spread = "one run: no spread" if len(self.labels) == 1 else "± is the standard deviation over the runs"
        return (
            f"{self.robot}, about {self.frame}; {runs} up to {self.times[-1]:.2f} s; split: {self.split}; {seeds}; "
            f"{spread}; the baselines know: {self.prior}."
        )

    def summary(self) -> Table:
        """Mean absolute error at the end by group of parameters; settling of the mass; computing time."""
        error = metrics.absolute_error(self.phi[:, :, -1], self.truth)  # (M, R, 10)
        rows = []
        for m, name in enumerate(self.methods):
            cells = [self._with_spread(error[m][:, group].mean(axis=1)) for group in GROUPS.values()]
            settled = f"{short(float(self.settling[m].mean()))}"
            rows.append((name, *cells, settled, short(1e6 * float(self.per_sample[m]))))
        units = [SHOWN_UNITS[group][0] for group in GROUPS.values()]
        heads = [f"{name} [{unit}]" for name, unit in zip(GROUPS, units, strict=True)]
        note = (
            "Mean absolute error at the end, averaged over the parameters of a group; settled: from then on the mass "
            f"stays within {SETTLED:.0%} of the true mass of its last value (mean over runs). " + self.conditions
        )
        columns = ("method", *heads, "settled [s]", "per sample [µs]")
        return self._table("Error at the end", columns, rows, note)

    def table(self, at: int = -1) -> Table:
        """Mean absolute error ± spread of each parameter at times[at]."""
        mae, spread = self.mae[:, at], self.spread[:, at]
        one = len(self.labels) == 1
        rows = [
            (name, *(_cell(e, None if one else s) for e, s in zip(mae[m], spread[m], strict=True)))
            for m, name in enumerate(self.methods)
        ]
        title = f"Mean absolute error of each parameter after {self.times[at]:.2f} s"
        return self._table(title, ("method", *parameter_columns()), rows, self.conditions)

    def estimates(self, run: int = 0) -> Table:
        """Truth and the estimates at the end of one run, in the units of the other tables."""
        rows = [("truth", *(short(SHOWN_SCALE * x) for x in self.truth[run]))]
        rows += [(name, *(short(SHOWN_SCALE * x) for x in self.phi[m, run, -1])) for m, name in enumerate(self.methods)]
        columns = ("method", *parameter_columns())
        return self._table(f"Estimates at the end of {self.labels[run]}", columns, rows, self.conditions, 1)

    def over_time(self, parameter: int = 0, count: int = 6) -> Table:
        """Mean absolute error ± spread of one parameter from the first sample to the end."""
        wanted = np.unique(np.linspace(0, len(self.times) - 1, count).round().astype(int))
        one = len(self.labels) == 1
        mae, spread = self.mae[:, :, parameter], self.spread[:, :, parameter]
        rows = [
            (name, *(_cell(mae[m, k], None if one else spread[m, k]) for k in wanted))
            for m, name in enumerate(self.methods)
        ]
        heads = ["first sample" if self.times[k] == 0.0 else f"{self.times[k]:.2f} s" for k in wanted]
        title = f"Mean absolute error of {NAMES[parameter]} over time [{SHOWN_UNITS[parameter]}]"
        return self._table(title, ("method", *heads), rows, self.conditions)

    def intervals(self, level: float = 0.95) -> Table:
        """How often the methods' own intervals hold the truth, and how wide they are."""
        share, width = self.coverage(level), self.half_width(level)
        rows = [
            (name, *(f"{c:.0%} (±{short(SHOWN_SCALE * w, 2)})" for c, w in zip(share[m], width[m], strict=True)))
            for m, name in enumerate(self.methods)
        ]
        note = f"Share of runs whose {level:.0%} interval holds the truth (± its mean half-width). " + self.conditions
        return self._table(f"{level:.0%} intervals at the end", ("method", *parameter_columns()), rows, note)

    def _table(self, title: str, columns: tuple[str, ...], rows: list, note: str, skipped: int = 0) -> Table:
        marked = tuple(skipped + k for k, name in enumerate(self.methods) if name in self.baselines)
        return Table(title, columns, tuple(rows), note, marked)

    def _with_spread(self, errors: NDArray) -> str:
        return _cell(float(errors.mean()), None if len(errors) == 1 else float(errors.std(ddof=1)))

    def __str__(self) -> str:
        return str(self.summary())

    # ------------------------------------------------------------------ JSON

    def to_dict(self) -> dict[str, Any]:
        """Everything, ready for JSON; numbers that are not finite become null."""
        out: dict[str, Any] = {
            name: list(value) if isinstance(value := getattr(self, name), tuple) else value
            for name in self.__dataclass_fields__
        }
        out |= {name: _listed(getattr(self, name)) for name in _ARRAYS}
        final = {
            name: {"mae": _listed(self.mae[m, -1]), "spread": _listed(self.spread[m, -1])}
            for m, name in enumerate(self.methods)
        }
        return out | {"parameters": list(NAMES), "units": list(UNITS), "final": final}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Comparison:
        """The inverse of `to_dict` (null reads as infinite).

        Raises:
            IdentificationError: something is missing.
        """
        missing = [name for name in cls.__dataclass_fields__ if name not in data]
        if missing:
            raise IdentificationError(f"not a saved comparison: {', '.join(missing)} missing; write it with to_dict()")
        values: dict[str, Any] = {}
        for name in cls.__dataclass_fields__:
            value = data[name]
            if name in _ARRAYS:
                array = np.array(value, dtype=float)  # None → NaN
                array = np.where(np.isnan(array), np.inf, array)
                values[name] = array.astype(int) if name in ("samples", "lengths") else array
            else:
                values[name] = tuple(value) if isinstance(value, list) else value
        return cls(**values)


def _cell(value: float, spread: float | None) -> str:
    """The value in shown units, and the spread to the same decimal."""
    shown = short(SHOWN_SCALE * float(value))
    if spread is None:
        return shown
    decimals = len(shown.partition(".")[2])
    scaled = SHOWN_SCALE * float(spread)
    return f"{shown} ± {scaled:.{decimals}f}" if np.isfinite(scaled) else f"{shown} ± {short(scaled)}"


def _listed(value: NDArray) -> Any:
    if value.dtype.kind != "f":
        return value.tolist()
    out = value.astype(object)
    out[~np.isfinite(value)] = None
    return out.tolist()
