"""Inertias of light things near the flange and far from it: do their intervals hold, and what does narrowing them do?

    python benchmarks/light_and_far.py [--logs 6] [--seed 78]

Logs of 6 s of each arm with a tare (`wrong_cases.py`, nothing wrong). Light things take the payload's place, of 1.5 to
6 % of the arm's rating: boxes, shapes and tools of one density, so that lengths go with the cube root of the mass;
*near*, as they are; *far*, 5 to 12 cm farther along the flange's axis and 3 cm (1 sigma) off it, as on a stalk.

in full     the inertia's c as it was calibrated
by mass     times (m/m_0)^(2/3)
by both     times max((m/m_0)^(2/3), r²/r_0²), as it is (`Calibration.narrowing`)

inside      share of the inertias inside their 95 % intervals, of all and of those that are said to be determined [%]
width       mean half-width over mean error, of both

Written to benchmarks/results/light_and_far.json and a table of docs/hybrid_measured.md; three minutes of one core.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_cases import CASES, Wrong

from armload import Arm, arm
from armload.arms import rated_mass
from armload.inertia import Z95, InertialParameters, determined
from armload.payloads import draw_payload
from armload.posterior import HybridIdentifier
from armload.posterior.calibration import Calibration
from armload.posterior.hybrid import answer, std_under_weak_prior
from armload.posterior.payload_prior import MixturePosterior, MixturePrior
from armload.regression import payload_prior_std

ROBOTS = ("panda", "fr3", "gen3", "iiwa14", "ur5e", "ur10e")
SHARES = (0.015, 0.06)  # of the arm's rating
FAMILIES = ("boxes", "shapes", "tools")
OF_EACH = 2  # payloads of each family, near and far
PLACES = ("near", "far")


@dataclass(frozen=True, eq=False)
class ByMass(Calibration):
    """As if the lever did not count."""

    def narrowing(self, found: MixturePosterior, prior: MixturePrior) -> float:
        """(m/m_0)^(2/3)."""
        at_origin = found.mean.copy()
        at_origin[1:4] = 0.0
        covariance = found.covariance.copy()
        covariance[1:4, 1:4] = 0.0
        return super().narrowing(found._replace(mean=at_origin, covariance=covariance), prior)


def thing(family: str, number: int, mass: float, beyond: NDArray[np.float64]) -> NDArray[np.float64]:
    """phi (10,) of a thing of this mass, of the density that its family has, its centre moved."""
    drawn = draw_payload(family, number, 3.0).parameters
    share = mass / drawn.mass
    length = share ** (1.0 / 3.0)
    com, inertia = length * drawn.com + beyond, share * length**2 * drawn.inertia_com
    return InertialParameters.from_com(mass, com, inertia).phi


def judged(robot: Arm, log: Wrong, rng: np.random.Generator) -> Iterator[tuple[str, str, NDArray, NDArray, NDArray]]:
    """Place, what is done, and of the six inertias errors, half-widths, and which are determined."""
    weak, rating = payload_prior_std(robot), rated_mass(robot)
    identifier = HybridIdentifier(robot, log.tare)
    prior, calibration = identifier.model.prior_for(robot), identifier.model.calibration
    about = {key: getattr(calibration, key) for key in calibration.__dataclass_fields__}
    ways = {"in full": Calibration(**about | {"light": 0.0}), "by mass": ByMass(**about), "by both": calibration}
    identifier.run(log.run)
    own = identifier.evidence()
    for place in PLACES:
        for family in FAMILIES:
            for number in rng.integers(1 << 30, size=OF_EACH):
                mass = rating * float(np.exp(rng.uniform(*np.log(SHARES))))
                beyond = np.array([*rng.normal(0.0, 0.03, size=2), rng.uniform(0.05, 0.12)]) * (place == "far")
                phi = thing(family, int(number), mass, beyond)
                vector = own.vector + own.information @ (phi - log.truth)
                for way, used in ways.items():
                    trusted = used.trusted(replace(own, vector=vector))
                    found = answer(trusted, used, prior, False)
                    std = np.sqrt(np.diag(found.covariance))
                    told = determined(std, prior.std, std_under_weak_prior(trusted.information, weak), weak)
                    yield place, way, np.abs(found.phi - phi)[4:], Z95 * std[4:], told[4:]


def cell(some: list[tuple[NDArray, NDArray, NDArray]]) -> dict[str, Any]:
    """Shares and widths, of all and of what is determined."""
    error, half, told = (np.array([one[k] for one in some]) for k in range(3))
    out: dict[str, Any] = {"things": len(some), "determined": float(told.mean())}
    for name, which in (("all", np.ones_like(told)), ("told", told)):
        out[name] = {
            "inside": float((error <= half)[which].mean()) if which.any() else None,
            "width": float(half[which].mean() / error[which].mean()) if which.any() else None,
        }
    return out


def table(found: dict[str, dict[str, dict[str, Any]]]) -> str:
    """A row for each arm and place."""
    ways = ("in full", "by mass", "by both")
    rows = []
    for name, places in found.items():
        for place in PLACES:
            cells = [places[f"{place}, {way}"] for way in ways]

            def both(what: str, form: str, unit: float, cells: list[dict[str, Any]] = cells) -> list[str]:
                return [" · ".join(form.format(unit * c[of][what]) for of in ("all", "told")) for c in cells]

            told = f"{100 * cells[0]['determined']:.0f}"
            rows.append([f"`{name}`", place, told, *both("inside", "{:.0f}", 100.0), *both("width", "{:.1f}", 1.0)])
    heads = [f"{what} {way}" for what in ("inside [%]", "width") for way in ways]
    return markdown_table(["arm", "where", "determined [%]", *heads], "llrrrrrrr", rows)


def main() -> None:
    asked = options(__doc__, logs=6, seed=78)
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for name in ROBOTS:
        robot, rng = arm(name), np.random.default_rng([asked.seed, 1])
        some = defaultdict(list)
        for log in CASES["nothing"](name, asked.logs, asked.seed):
            for place, way, *numbers in judged(robot, log, rng):
                some[f"{place}, {way}"].append(tuple(numbers))
        found[name] = {what: cell(cells) for what, cells in some.items()}
        say(f"{name}: {asked.logs} logs")
    write("light_and_far", {"logs": asked.logs, "seed": asked.seed, "arms": found})
    write_table(ROOT / "docs" / "hybrid_measured.md", "light and far", table(found))
    say(table(found))


if __name__ == "__main__":
    main()
