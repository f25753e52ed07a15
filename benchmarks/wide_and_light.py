"""What the families added to the payload prior, and the narrower inertias of light ones, change for each shipped arm.

    python benchmarks/wide_and_light.py [--episodes 48] [--seed 7700] [--work out/wide-and-light]

Episodes of `broad` of each arm that no training saw are simulated; other payloads take the place of their own, as in
payload_intervals.py: two of each family that training draws from and two wide ones, of ratings between 1/30 of the
arm's and all of it, evenly in the logarithm. Each is answered as the model was before (its components up to `anything`,
one c for all masses) and as it is. From one second on; what a log does not determine does not count.

inside     share of the inertias inside: of the training's families, of wide bodies
width      mean half-width over mean error, of the same two
error      mean error after over before: mass · first moments · inertia of the training's families · of wide bodies
needed     share of c within which 95 % of the inertias lie where up to so much of the rated mass is found: of all, of
           wide bodies (as it is, before c is narrowed)

Writes benchmarks/results/wide_and_light.json and a table of docs/hybrid_measured.md. Goes on from --work; ten minutes
of one core.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, write, write_table

from armload import Arm, arm
from armload.arms import rated_mass
from armload.inertia import Z95, determined
from armload.lab.episodes import draw_episodes
from armload.lab.training import Records, measure_episodes
from armload.payloads import draw_payload
from armload.posterior import Calibration, Evidence, MixturePrior, shipped_model
from armload.posterior.hybrid import std_under_weak_prior
from armload.posterior.model_file import SHIPPED
from armload.regression import payload_prior_std

KINDS = 2 * ("boxes", "shapes", "tools", "container", "wide")
SMALLEST = 1.0 / 30.0  # of what the arm is rated for
TIMES = (0.1, 1.0, 6.0)  # [s]
FOUND = (0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 3.0)  # of the rated mass
GROUPS = (slice(0, 1), slice(1, 4), slice(4, 10))


class Answered(NamedTuple):
    """Error, half-width and whether determined (10,), the mass found [kg], and which share of c would do (10,)."""

    error: NDArray[np.float64]
    half: NDArray[np.float64]
    told: NDArray[np.bool_]
    mass: float
    share: NDArray[np.float64]


def before(prior: MixturePrior) -> MixturePrior:
    """The prior as it was trained: what was added stands behind `anything`."""
    count = prior.families.index("anything") + 1
    w = prior.weights[:count]
    return MixturePrior(w / w.sum(), prior.means[:count], prior.covariances[:count], prior.families[:count])


def records_of(robot: Arm, name: str, asked: Any, times: Sequence[float] = TIMES) -> Records:
    """Evidence of the arm's episodes after so many seconds each, from --work, where it has this name, or new."""
    path = Path(asked.work) / f"{name}-{asked.episodes}-{asked.seed}.npz" if asked.work else None
    if path is not None and path.is_file():
        return Records.load(path)
    drawn = draw_episodes(robot, "broad", asked.episodes, asked.seed, motions=max(6, asked.episodes // 3))
    records = measure_episodes(drawn, times=times)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        records.save(path)
    return records


def answered(
    prior: MixturePrior, calibration: Calibration, log: Evidence, truth: NDArray[np.float64], weak: NDArray[np.float64]
) -> Answered:
    """One payload in one log, under one prior and calibration."""
    trusted = calibration.trusted(log)
    found = calibration.posterior(trusted, prior)
    std = np.sqrt(np.diag(calibration.widened(found, trusted, prior)))
    told = determined(std, prior.std, std_under_weak_prior(trusted.information, weak), weak)
    scales = (trusted.gain_std * found.mean) ** 2 + np.diag(trusted.of_joints(found.mean, found.covariance))
    beyond = np.maximum((found.mean - truth) ** 2 - Z95**2 * scales, 0.0)
    share = np.sqrt(beyond / np.diag(found.covariance)) / calibration.width(trusted.t, trusted.kind)
    return Answered(np.abs(found.mean - truth), Z95 * std, told, float(found.mean[0]), share)


def measured(name: str, asked: Any) -> dict[str, Any]:
    """All of one arm."""
    robot = arm(name)
    model, rated, weak = shipped_model(robot), rated_mass(robot), payload_prior_std(robot)
    records, rng = records_of(robot, name, asked), np.random.default_rng([asked.seed, 7])
    now, then = model.prior, before(model.prior)
    plain = replace(model.calibration, light=0.0)
    rows: list[list[Answered]] = [[], []]
    wide = []
    for k in range(len(records)):
        log = records.evidence(k)
        for kind in KINDS:
            rating = rated * float(np.exp(rng.uniform(np.log(SMALLEST), 0.0)))
            truth = draw_payload(kind, int(rng.integers(1 << 30)), rating).parameters.phi
            if log.t < 0.5:
                continue
            other = replace(log, vector=log.vector + log.information @ (truth - records.truth[k]))
            rows[0].append(answered(then, plain, other, truth, weak))
            rows[1].append(answered(now, model.calibration, other, truth, weak))
            wide.append(kind == "wide")
    is_wide = np.array(wide)
    out: dict[str, Any] = {"arm": name, "payloads": len(wide)}
    errors = []
    for what, some in zip(("before", "after"), rows, strict=True):
        error, half = (np.array([getattr(row, part) for row in some]) for part in ("error", "half"))
        told = np.array([row.told for row in some], dtype=bool)
        cells = {}
        for label, which in (("compact", ~is_wide), ("wide", is_wide)):
            e, h, counts = (x[which][:, 4:] for x in (error, half, told))
            cells[label] = {
                "determined": round(float(counts.mean()), 3),
                "inside": round(float((e <= h)[counts].mean()), 3),
                "width": round(float(h[counts].mean() / e[counts].mean()), 2),
            }
        inside = (error <= half)[~is_wide]
        cells["mass and moments inside"] = [round(float(inside[:, part].mean()), 3) for part in GROUPS[:2]]
        out[what] = cells
        parts = [float(error[~is_wide][:, part].mean()) for part in GROUPS]
        errors.append([*parts, float(error[is_wide][:, 4:].mean())])
    out["error"] = [round(b / a, 3) for a, b in zip(*errors, strict=True)]
    mass, share = np.array([row.mass for row in rows[1]]) / rated, np.array([row.share for row in rows[1]])[:, 4:]
    out["needed"] = []
    for low, high in pairwise(FOUND):
        here = (mass < high) & ((mass >= low) if low else True)
        both = [share[here & which] for which in (np.ones_like(is_wide), is_wide)]
        out["needed"].append([round(float(np.quantile(x, 0.95)), 2) if len(x) >= 10 else None for x in both])
    return out


def table(found: list[dict[str, Any]]) -> str:
    """A row for each arm."""
    rows = []
    for one in found:
        shares = [f"{100 * one[w]['compact']['inside']:.0f} · {100 * one[w]['wide']['inside']:.0f}" for w in WHEN]
        widths = [f"{one[w]['compact']['width']:.1f} · {one[w]['wide']['width']:.1f}" for w in WHEN]
        rows.append([f"`{one['arm']}`", *shares, *widths, " · ".join(f"{x:.2f}" for x in one["error"])])
    heads = ["inside [%] before", "after", "half-width over error before", "after", "error, after over before"]
    return markdown_table(["arm", *heads], "lrrrrr", rows)


WHEN = ("before", "after")


def main() -> None:
    asked = options(__doc__, episodes=48, seed=7700, work="")
    found = []
    for name in SHIPPED:
        found.append(measured(name, asked))
        say(str(found[-1]))
    facts = {"episodes": asked.episodes, "seed": asked.seed, "found in": list(FOUND), "arms": found}
    write("wide_and_light", facts)
    write_table(ROOT / "docs" / "hybrid_measured.md", "wide and light", table(found))


if __name__ == "__main__":
    main()
