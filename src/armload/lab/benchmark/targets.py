"""What the hybrid is built to reach, against what is measured: each target with its numbers and a verdict."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload.lab.benchmark.benchmark_tables import Results, with_error
from armload.lab.report.shown import GROUPS, SHOWN_UNITS, Table, short

REACHED, NOT_CLEAR, MISSED = "reached", "not clear", "missed"
_ERRORS = 2.0  # standard errors


@dataclass(frozen=True)
class Target:
    """A wish about two methods on the same episodes: error of `a` at most `factor` times that of `b`.

    strict: by more than two standard errors of the difference.
    """

    population: str
    a: str
    b: str
    times: tuple[float, ...]
    groups: tuple[str, ...]
    factor: float = 1.0
    strict: bool = False

    def verdict(self, excess: float, error: float) -> str:
        """REACHED; MISSED; or NOT_CLEAR, where two standard errors of the excess leave both open.

        >>> wish = Target("reference", "a", "b", (1.0,), ("mass",))
        >>> [wish.verdict(excess, 1.0) for excess in (-0.1, 1.9, 2.1)]
        ['reached', 'not clear', 'missed']
        """
        slack = _ERRORS * error
        if excess <= (-slack if self.strict else 0.0):
            return REACHED
        return NOT_CLEAR if excess <= (0.0 if self.strict else slack) else MISSED

    def __str__(self) -> str:
        word = "clearly below" if self.strict else "at most"
        return f"{self.a} {word} {'' if self.factor == 1.0 else f'{self.factor:g} × '}{self.b}"


_ALL = tuple(GROUPS)
_GP, _CALIBRATED = "map-gp", "rls-filter+tare"
TARGETS = (
    Target("reference", "hybrid", _GP, (1.0, 3.0, 6.0), _ALL),
    Target("reference", "hybrid", _GP, (0.02, 0.1, 0.5), _ALL, 1.2),
    Target("reference", "hybrid", _CALIBRATED, (1.0,), _ALL[:2], 0.25),
    Target("same-place", "hybrid", _CALIBRATED, (1.0,), _ALL[:2], 0.25),
    Target("container", "hybrid", _GP, (0.1, 1.0, 6.0), _ALL, strict=True),
    Target("beyond", "hybrid", _GP, (0.1, 1.0, 6.0), _ALL, strict=True),
    *(
        Target(population, "hybrid", _GP, (1.0, 6.0), _ALL)
        for population in ("untared", "shapes", "odd", "everyday", "same-motion", "same-place", "elsewhere", "tool")
    ),
    Target("same-motion", "hybrid", "difference", (1.0, 6.0), _ALL),
)


def verdicts(results: Results) -> list[dict]:
    """Every target that can be judged: what, where, when, the ratio measured, excess, verdict.

    excess: mean of |error of a| − factor·|error of b|, in SI units, with its standard error.
    """
    out = []
    for target in TARGETS:
        m = results.get(target.population)
        if m is None or target.a not in m.rows or target.b not in m.rows:
            continue
        mean, error = m.paired(target.a, target.b, target.factor)
        ratio = m.ratio(target.a, target.b)
        for time in target.times:
            for group in target.groups:
                t, k = m.index(time), _ALL.index(group)
                verdict = target.verdict(float(mean[t, k]), float(np.nan_to_num(error[t, k], nan=np.inf)))
                out.append(
                    {
                        "target": str(target),
                        "population": target.population,
                        "time": float(m.times[t]),
                        "group": group,
                        "ratio": float(ratio[t, k]),
                        "excess": float(mean[t, k]),
                        "standard_error": float(error[t, k]) if np.isfinite(error[t, k]) else None,
                        "verdict": verdict,
                    }
                )
    return out


def targets_table(results: Results) -> Table:
    """The targets with their numbers; what is missed is marked."""
    rows = []
    for v in verdicts(results):
        error = float("nan") if v["standard_error"] is None else v["standard_error"]
        excess = f"{with_error(v['excess'], error)} {SHOWN_UNITS[GROUPS[v['group']]][0]}"
        rows.append(
            (v["target"], v["population"], f"{v['time']:g} s", v["group"], short(v["ratio"]), excess, v["verdict"])
        )
    columns = ("target", "population", "after", "group", "ratio", "excess", "verdict")
    note = (
        "Excess: mean over the episodes of one error less the stated multiple of the other, ± its standard error. `at "
        "most` is reached if the excess is not above zero and missed if it is two standard errors above; `clearly "
        "below` is reached if it is two below and missed if it is above zero."
    )
    return Table("Targets", columns, tuple(rows), note)
