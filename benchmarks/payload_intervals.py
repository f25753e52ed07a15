"""What the hybrid's intervals are worth where its payload prior misleads: wide thin bodies, and light ones.

    python benchmarks/payload_intervals.py [--episodes 2000] [--jobs 2] [--work out/fresh-panda]

A tray or a ring has the mass and the centre of a compact body and several times its inertia. Such bodies are among the
training's, but rare. Here one takes the place of the payload in every episode of `fresh_episodes.py`: torque is linear
in the ten parameters, so that h becomes h + Λ·(phi_wide − phi); the arm, its motion and all errors stay. Compared: the
hybrid; the same log under the weak prior, trusted as far as the hybrid trusts it (`log alone`); what `identify` reports
of the hybrid, with the prior's interval where `determined` says no; each also for the episodes' own payloads, and the
hybrid for those by weight, from one second on: a light payload is easily taken for nothing.

Writes benchmarks/results/payload_intervals.json. Goes on from --work, which fresh_episodes.py shares.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from fresh_episodes import SEED, new_records
from hybrid_ablation import by_tare_and_time
from numpy.typing import NDArray
from script import options, write

from armload import Arm, arm
from armload.inertia import Z95, determined
from armload.lab.training import Records
from armload.payloads import solids
from armload.posterior import HybridModel, shipped_model
from armload.posterior.hybrid import holding, std_under_weak_prior
from armload.regression import payload_prior_std

MASS, SIDE, THICK = (0.3, 2.0), (0.2, 0.4), (0.002, 0.01)  # [kg, m]
OFF, ALONG = 0.01, (0.01, 0.06)  # [m] centre off the flange's axis, and along it
WEIGHTS = (0.03, 0.1, 0.2, 0.4, 1.0, 3.0)  # [kg]
GROUPS = {"mass": [0], "first moments": [1, 2, 3], "inertia": list(range(4, 10)), "its diagonal": [4, 7, 9]}


def wide(seed: int) -> NDArray[np.float64]:
    """phi (10,) of a bar, a tray or a ring across the flange."""
    rng = np.random.default_rng([seed, 99])
    mass, side, thick = (rng.uniform(*x) for x in (MASS, SIDE, THICK))
    at = np.array([*rng.normal(0.0, OFF, size=2), rng.uniform(*ALONG)])
    kind = seed % 3
    if kind == 0:
        return solids.box((side, 0.03, thick), mass=mass, translation=at).phi
    if kind == 1:
        return solids.box((side, rng.uniform(0.5, 1.0) * side, thick), mass=mass, translation=at).phi
    outer, inner = 0.5 * side, 0.45 * side
    full = mass * outer**2 / (outer**2 - inner**2)
    disc = solids.cylinder(outer, thick, mass=full, translation=at)
    return (disc - solids.cylinder(inner, thick, mass=full - mass, translation=at)).phi


def exchanged(records: Records, phi: NDArray[np.float64]) -> Records:
    """The same episodes with other payloads, phi (E, 10) of each episode."""
    _, which = np.unique(records.episode, return_inverse=True)
    truth = phi[which]
    return replace(
        records,
        truth=truth,
        vector=np.asarray(records.vector)
        + np.einsum("nij,nj->ni", np.asarray(records.information), truth - records.truth),
    )


def held(robot: Arm, model: HybridModel, records: Records) -> dict[str, NDArray[np.bool_]]:
    """Which truths (N, 10) lie inside, by what answers."""
    prior, weak = model.prior_for(robot), payload_prior_std(robot)
    out = {name: np.empty((len(records), 10), dtype=bool) for name in ("hybrid", "log alone", "as identify reports")}
    for k in range(len(records)):
        trusted, truth = model.calibration.trusted(records.evidence(k)), records.truth[k]
        found = model.calibration.posterior(trusted, prior)
        covariance = model.calibration.widened(found, trusted, prior)
        half = Z95 * np.sqrt(np.diag(holding(covariance, 0, found.mass_if_any - found.mean[0])))
        out["hybrid"][k] = np.abs(found.mean - truth) <= half
        P = np.linalg.inv(trusted.information + np.diag(weak**-2))
        alone = P @ trusted.vector
        variance = np.diag(P + trusted.of_joints(alone, P)) + (trusted.gain_std * alone) ** 2
        out["log alone"][k] = np.abs(alone - truth) <= Z95 * np.sqrt(variance)
        told = determined(half / Z95, prior.std, std_under_weak_prior(trusted.information, weak), weak)
        before, reach = Z95 * prior.std, np.minimum(half, Z95 * prior.std)
        low = np.where(told, found.mean - half, np.minimum(prior.mean - before, found.mean - reach))
        high = np.where(told, found.mean + half, np.maximum(prior.mean + before, found.mean + reach))
        out["as identify reports"][k] = (low <= truth) & (truth <= high)
    return out


def main() -> None:
    asked = options(__doc__, episodes=2000, jobs=2, work="")
    robot = arm("panda")
    model, records = shipped_model(robot), new_records(robot, asked)
    bodies = np.array([wide(k) for k in range(len(np.unique(records.episode)))])
    cells, weights = [], []
    for name, some in (("wide", exchanged(records, bodies)), ("as drawn", records)):
        inside = held(robot, model, some)
        for named, rows in by_tare_and_time(records):
            for method, found in inside.items():
                shares = {group: round(float(found[rows][:, part].mean()), 4) for group, part in GROUPS.items()}
                line = {"payloads": name, **named, "method": method, "episodes": int(rows.sum())}
                cells.append(line | shares)
                if named["t"] in (0.1, 1.0, 6.0):
                    print(*line.values(), *(f"{group} {100 * x:.1f} %" for group, x in shares.items()), sep="  ")
        if name == "as drawn":
            for low, high in pairwise(WEIGHTS):
                rows = (low <= some.truth[:, 0]) & (some.truth[:, 0] < high) & (records.kind < 2) & (records.t > 0.8)
                shares = {
                    group: round(float(inside["hybrid"][rows][:, part].mean()), 4) for group, part in GROUPS.items()
                }
                weights.append({"kg": [low, high], "episodes": len(np.unique(records.episode[rows]))} | shares)
                print(weights[-1])
    result = {"population": "broad", "seed": SEED, "cells": cells, "weights": weights}
    write("payload_intervals", result, indent=None)


if __name__ == "__main__":
    main()
