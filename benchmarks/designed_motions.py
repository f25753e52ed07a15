"""What designed motions are worth: errors over time against other motions, on the same arms with the same payloads.

    nice -n 15 python benchmarks/designed_motions.py [--worlds 100] [--jobs 1] [--minutes 600] [--anew] [--enriched]

Every world is another arm that differs from its model as real ones do (`World.real_like`), with another payload of
boxes and its arm's sensors. The candidates run on the same worlds, with the same estimator: the default of `identify`.
Motions shorter than the run are repeated. The tare of most is 20 s of the empty arm on another motion elsewhere; of the
pairs it is 5 s at the place itself. Errors are those of mass, of the three moments and of the six inertias (mean of
their magnitudes); an accuracy is reached when all three are within 10 g, 1.5 g·m, 1e-3 kg·m², and stay so at the times
that are looked at: `TIMES`, or `TIMES_OF_PAIRS` where it is reached early. "bound / given": half-width (95 %) of the
bound over that of the estimator; "centre" is the distance of the centre of mass from the true one after 6 s. Most of
what a world costs is the estimator at those times; a bound is of a motion and is the same in all worlds. What is
measured is kept in benchmarks/results/designed_motions_worlds.json, so that a later run adds to it, whatever has
changed in the code since (--anew: with the code of now only), and where one stops, in out/. Writes
benchmarks/results/designed_motions.json, the tables in docs/motion.md and docs/pictures/designed_motions.png from the
worlds that have all candidates. With --enriched only what
the enriched path says of what the path alone leaves undetermined, by the bound: benchmarks/results/enriched_path.json.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import designed_worlds
import numpy as np
from designed_worlds import compact, motion_hash
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, two_digits, write, write_table

from armload.arms import Arm, arm
from armload.excitation import Constraints, Criterion, PayloadRange, Surroundings, design_motion, enrich
from armload.identification import choose
from armload.inertia import NAMES as NAMES_OF_PHI
from armload.inertia import Z95, InertialParameters
from armload.lab.cells import key_of
from armload.lab.experiment import Task, run_tasks, source_key
from armload.lab.report.style import look, new_figure
from armload.motion import EndlessMotion, FourierMotion, Motion, excitation, load_motion, random_motion, save_motion
from armload.motion.point_to_point import PointToPoint
from armload.payloads import draw_payload
from armload.posterior import bound
from armload.recording import Recording
from armload.regression.rows import REGRESSOR_RATE
from armload.simulation import Run, Sensors, World, simulate_many
from armload.simulation.resolution import COARSE

Candidates = dict[str, tuple[Motion | None, Motion | None]]
TIMES = (1.0, 2.0, 3.0, 6.0)  # [s] of the tables
TIMES_OF_PAIRS = (0.5, 1.0, 1.5, 2.0, 3.0, 6.0)  # [s]
WANTED = np.array([10e-3, 1.5e-3, 1e-3])  # [kg, kg·m, kg·m²]
LASTING = 6.0  # [s] of a loaded run
EMPTY = 5.0  # [s] of a pair's empty run
_RATE = 500.0  # [Hz] of the logs
POSES = {"panda": (0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8), "ur10e": (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)}
RATED = {"panda": 3.0, "ur10e": 6.0}  # [kg] payloads drawn and allowed for: a UR10e cannot hold 12.5 kg at this pose
SHARE = 0.8
_SEED = 70_000  # of payloads and sensors, apart from those the shipped models were trained on
OUT = ROOT / "out" / "designed_motions"
NAMES = {
    "excitation": "taie2024 (UR10e: a random 6 s motion)",
    "random": "random motion, another in each world",
    "wrist": "wrist only, random",
    "poses": "four static poses",
    "place": "pick and place",
    "enriched": "pick and place, enriched (5 mm, 2°)",
    "designed 2 s": "designed, 2 s",
    "designed 3 s": "designed, 3 s",
    "wiggle pair": "all joints ±0.12 rad, after 5 s of it empty",
    "excitation pair": "taie2024 after 5 s of it empty",
    "designed same": "designed, 2 s, after 5 s of it empty",
    "pair": "designed, 2 s, after an empty run of its own, 5 s",
}


def times_of(empty: Motion | None) -> tuple[float, ...]:
    """When a candidate is looked at, by its own empty run [s]."""
    return TIMES if empty is None else TIMES_OF_PAIRS


def allowed(robot: Arm) -> Constraints:
    """What the designs keep to."""
    return Constraints(robot, POSES[robot.name], share=SHARE, payload=PayloadRange(RATED[robot.name]))


@cache
def _elsewhere(name: str) -> Motion:
    return random_motion(arm(name), 4711, duration=20.0, harmonics=10)


def elsewhere(robot: Arm) -> Motion:
    """The tare of 20 s that most candidates share."""
    return _elsewhere(robot.name)


def place(robot: Arm) -> Motion:
    """Pick, lift, carry, lower and the way back, with stops: 6 s."""
    q = np.array(POSES[robot.name])
    low, high, over = q.copy(), q.copy(), q.copy()
    low[1] += 0.15
    low[3] += 0.15 if robot.n == 7 else 0.0
    high[0] -= 0.4
    over[0] -= 0.8
    over[-1] += 0.6
    stops = np.array([q, low, q, high, over, q])
    starts = np.array([0.2, 1.2, 2.3, 3.2, 4.4])
    ends = np.array([1.0, 2.0, 3.0, 4.2, 5.8])
    return PointToPoint(stops, starts, ends, name="pick and place")


def motions_of(robot: Arm) -> Candidates:
    """Loaded run and own empty run of each candidate; None: another in each world, the common tare."""
    pose, n, tare = np.array(POSES[robot.name]), robot.n, elsewhere(robot)
    wrist = random_motion(robot, 3, duration=LASTING, around=pose)
    still = np.arange(n) < n - 3
    fixed = FourierMotion(
        pose, *(np.where(still[:, None], 0.0, x) for x in (wrist.sine, wrist.cosine)), LASTING, "wrist"
    )
    four = pose + np.zeros((5, n))
    four[1, -1], four[2, -2], four[3, -2:] = pose[-1] + 1.2, pose[-2] + 0.8, pose[-2:] - 0.7
    poses = PointToPoint(four, np.arange(4) * 1.5 + 1.0, np.arange(4) * 1.5 + 1.5, name="poses")
    rng = np.random.default_rng(5)
    sine, cosine = rng.normal(size=(2, n, 4))
    wiggle = FourierMotion(pose, sine, cosine, 2.0, "wiggle").smooth()
    wiggle = wiggle.scaled(0.12 / np.abs(wiggle(np.linspace(0, 2, 200))[0] - pose).max(axis=0))
    taie, keep = excitation(robot, 0), allowed(robot)
    (same,) = kept(robot, "designed same", lambda: [design_motion(keep, Criterion(robot, "same"), 2.0).motion])
    return {
        "excitation": (taie, None),
        "random": (None, None),
        "wrist": (fixed, None),
        "poses": (poses, None),
        "place": (place(robot), None),
        "enriched": (
            kept(robot, "enriched", lambda: [enrich(place(robot), _around(robot), Criterion(robot, tare)).motion])[0],
            None,
        ),
        "designed 2 s": (
            kept(robot, "designed 2 s", lambda: [design_motion(keep, Criterion(robot, tare), 2.0).motion])[0],
            None,
        ),
        "designed 3 s": (
            kept(robot, "designed 3 s", lambda: [design_motion(keep, Criterion(robot, tare), 3.0).motion])[0],
            None,
        ),
        "wiggle pair": (wiggle, wiggle),
        "excitation pair": (taie, taie),
        "designed same": (same, same),
        "pair": tuple(kept(robot, "pair", lambda: _pair(robot, keep))),  # type: ignore[dict-item]
    }


def _pair(robot: Arm, keep: Constraints) -> list[Motion]:
    found = design_motion(keep, Criterion(robot, "own"), 2.0, tare_time=5.0)
    assert found.empty is not None
    return [found.motion, found.empty]


def _around(robot: Arm) -> Constraints:
    return Constraints(
        robot,
        POSES[robot.name],
        share=1.0,
        payload=PayloadRange(RATED[robot.name]),
        travel=10.0,
        speed=3.0,
        surroundings=Surroundings(robot),
    )


def kept(robot: Arm, name: str, make: Any) -> list[Motion]:
    """The motions of a candidate, designed once."""
    folder = OUT / "motions"
    folder.mkdir(parents=True, exist_ok=True)
    files = sorted(folder.glob(f"{robot.name} {name} [0-9].json"))
    if not files:
        say(f"designing {name} for {robot.name}")
        for k, motion in enumerate(make()):
            save_motion(folder / f"{robot.name} {name} {k}.json", motion)
        files = sorted(folder.glob(f"{robot.name} {name} [0-9].json"))
    return [load_motion(file) for file in files]


def bounds_of(robot: Arm, run: Motion, empty: Motion | None) -> NDArray[np.float64]:
    """The bound's half-widths (T, 10) of a candidate: those of every world."""
    before = (elsewhere(robot), 20.0) if empty is None else (empty, EMPTY)
    loaded, tare = (followed_for(robot, motion, lasting) for motion, lasting in ((run, LASTING), before))
    return bound(robot, loaded, tare=tare, times=times_of(empty)).half_width


def followed_for(robot: Arm, motion: Motion, lasting: float) -> Recording:
    """A log of so many seconds of an arm that follows a motion exactly, again and again."""
    t = np.linspace(0.0, lasting, round(lasting * REGRESSOR_RATE) + 1)
    q, dq, ddq = EndlessMotion(motion)(t)
    return Recording(t, q, dq, robot.torque(q, dq, ddq), source=motion.name)


def measure(
    names: Sequence[str], robot: Arm, chosen: Candidates, bounds: dict[str, NDArray[np.float64]], seed: int
) -> Iterator[dict[str, Any]]:
    """Of the cells named, ARM CANDIDATE SEED each: errors, half-widths of estimator and bound (T, 10) in one world."""
    world, sensors = World.real_like(robot, seed), Sensors.of(robot)
    held = draw_payload("boxes", _SEED + seed, RATED[robot.name]).parameters
    truth = InertialParameters(held.phi, robot.frame)

    def logged(motion: Motion, payload: InertialParameters | None, lasting: float, noise: int) -> Recording:
        run = Run(EndlessMotion(motion), payload, world, sensors, _SEED + 2 * seed + noise)
        return simulate_many(robot, [run], rate=_RATE, duration=lasting, workers=1, resolution=COARSE)[0]

    common = None
    for cell in names:
        candidate = cell.removeprefix(f"{robot.name} ").removesuffix(f" {seed}")
        run, empty = chosen[candidate]
        motion = run if run is not None else random_motion(robot, 9000 + seed, duration=LASTING)
        if empty is None:
            tare = common = logged(elsewhere(robot), None, 20.0, 0) if common is None else common
        else:
            tare = logged(empty, None, EMPTY, 0)
        found = choose(robot, tare).identifier.at(logged(motion, truth, LASTING, 1), times_of(empty))
        best = bounds[candidate] if candidate in bounds else bounds_of(robot, motion, empty)
        centre = [one.phi[1:4] / max(one.phi[0], 1e-3) - truth.phi[1:4] / truth.mass for one in found]
        yield {
            "mass": truth.mass,
            "times": list(times_of(empty)),
            "errors": np.round([one.phi - truth.phi for one in found], 7).tolist(),
            "centre": np.round(np.linalg.norm(centre, axis=1), 6).tolist(),
            "half_width": np.round([Z95 * one.std for one in found], 7).tolist(),
            "bound": np.round(best, 7).tolist(),
            "arm": robot.name,
            "candidate": candidate,
            "seed": seed,
        }


def summary(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """Of one candidate on one arm."""
    times = TIMES if len(cells[0]["three"]) == len(TIMES) else TIMES_OF_PAIRS
    three = np.array([c["three"] for c in cells])  # (worlds, T, 3)
    within = np.all(three <= WANTED, axis=2)
    stays = np.flip(np.logical_and.accumulate(np.flip(within, axis=1), axis=1), axis=1)
    reached = np.where(stays.any(axis=1), np.array(times)[stays.argmax(axis=1)], np.inf)
    ratio = np.array([c["predicted"] for c in cells])
    return {
        "worlds": len(cells),
        "error": {str(t): three[:, k].mean(axis=0).tolist() for k, t in enumerate(times)},
        "centre": float(np.median([c["centre"] for c in cells])),
        "reached_median_s": _finite(np.quantile(reached, 0.5, method="higher")),
        "reached_90_s": _finite(np.quantile(reached, 0.9, method="higher")),
        "reached_share": float(np.isfinite(reached).mean()),
        "predicted_over_given": [float(np.median(ratio)), *np.quantile(ratio, [0.05, 0.95]).tolist()],
        "within_bound_95": float(np.mean([c["within"] for c in cells]) / ratio.shape[1]),
    }


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def table(rows: dict[str, dict[str, Any]]) -> str:
    """A row for each candidate: errors, time to reach, predicted over given."""
    columns = ["motion", *(f"{t:g} s" for t in TIMES), "median [s]", "90 % [s]", "bound / given"]
    out = []
    for name, row in rows.items():
        errors = [" · ".join(two_digits(1e3 * x) for x in row["error"][str(t)]) for t in TIMES]
        times = [f"{x:g}" if (x := row[key]) is not None else "> 6" for key in ("reached_median_s", "reached_90_s")]
        middle, low, high = row["predicted_over_given"]
        out.append([NAMES[name], *errors, *times, f"{middle:.2f} ({low:.2f}–{high:.2f})"])
    return markdown_table(columns, "l" + "r" * (len(columns) - 1), out)


def draw(found: dict[str, dict[str, Any]], file: Path) -> None:
    """Error over time of the candidates."""
    titles = ("mass [g]", "moments [g·m]", "inertias [10⁻³ kg·m²]")
    with look():
        figure = new_figure(3.0 * len(found))
        axes = figure.subplots(len(found), 3, squeeze=False)
        for row, (name, candidates) in zip(axes, found.items(), strict=True):
            for k, (axis, title) in enumerate(zip(row, titles, strict=True)):
                for number, (candidate, one) in enumerate(candidates.items()):
                    times = [float(t) for t in one["error"]]
                    values = [1e3 * error[k] for error in one["error"].values()]
                    style = "-" if candidate.startswith(("designed", "pair", "enriched")) else ":"
                    axis.plot(times, values, style, color=f"C{number % 10}", label=NAMES[candidate])
                axis.axhline(1e3 * WANTED[k], color="0.6", lw=0.8)
                axis.set(yscale="log", xlabel="time [s]", title=f"{name}: {title}")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=7)
        figure.savefig(file)


def opened(robot: Arm) -> dict[str, Any]:
    """What the path alone leaves undetermined, and the half-widths after the enriched one over those before."""
    tare = elsewhere(robot)
    (path,) = kept(robot, "enriched", lambda: [enrich(place(robot), _around(robot), Criterion(robot, tare)).motion])
    plain, rich = (bound(robot, motion, tare=tare, times=[motion.duration]) for motion in (place(robot), path))
    left = ~plain.determined[-1]
    ratio = rich.half_width[-1][left] / plain.half_width[-1][left]
    return {"undetermined": np.array(NAMES_OF_PHI)[left].tolist(), "ratio": ratio.tolist()}


def enriched_sentence(found: dict[str, Any]) -> str:
    """The same in words."""
    parts = [
        f"{', '.join(one['undetermined'])} on the {name} to {min(one['ratio']):.2f}–{max(one['ratio']):.2f}"
        for name, one in found.items()
    ]
    return (
        "Of what the pick and place of the table below leaves undetermined after 20 s of tare elsewhere,\n"
        "5 mm and 2° narrow "
        f"{' and '.join(parts)} of the bound's half-width before\n(`python benchmarks/designed_motions.py --enriched`)."
    )


def main() -> None:
    """Design, run, table."""
    asked = options(__doc__, worlds=100, jobs=1, arms="panda,ur10e", minutes=600.0, anew=False, enriched=False)
    if asked.enriched:
        widths = {name: opened(arm(name)) for name in asked.arms.split(",")}
        write_table(ROOT / "docs" / "motion.md", "enriched path", enriched_sentence(widths))
        write("enriched_path", {"arms": widths}, None)
        return
    code = source_key(*(ROOT / "src" / "armload" / room for room in ("simulation", "regression", "posterior")))
    tasks, hashes = [], {}
    robots = {name: arm(name) for name in asked.arms.split(",")}
    chosen = {name: motions_of(robot) for name, robot in robots.items()}
    for name, candidates in chosen.items():
        for c, (run, empty) in candidates.items():
            hashes[f"{name} {c}"] = motion_hash((run, LASTING), *([] if empty is None else [(empty, EMPTY)]))
    bounds = {
        name: {c: bounds_of(robot, run, empty) for c, (run, empty) in chosen[name].items() if run is not None}
        for name, robot in robots.items()
    }
    everything = designed_worlds.read()
    worlds = designed_worlds.of_now(everything, hashes, lambda w: not asked.anew or w["code"] == code[:12])
    for seed in range(asked.worlds):
        for name, robot in robots.items():
            missing = [c for c in chosen[name] if f"{name} {c} {seed}" not in worlds]
            keys = {f"{name} {c} {seed}": key_of(code, name, c, hashes[f"{name} {c}"], seed) for c in missing}
            if keys:
                tasks.append(
                    Task(f"{name} {seed}", keys, measure, (robot, chosen[name], bounds[name], seed), "candidate")
                )
    cells = run_tasks(tasks, OUT / "cells", jobs=asked.jobs, until=60 * asked.minutes, say=say)
    worlds |= {name: compact(cell, code, hashes[name.rsplit(" ", 1)[0]]) for name, cell in cells.items()}
    designed_worlds.write(everything | worlds)
    found: dict[str, dict[str, Any]] = {}
    for name in robots:
        mine = {c: {k: w for k in range(asked.worlds) if (w := worlds.get(f"{name} {c} {k}"))} for c in NAMES}
        paired = sorted(set.intersection(*(set(each) for each in mine.values())))
        if paired:
            found[name] = {c: summary([each[k] for k in paired]) for c, each in mine.items()}
    for name, rows in found.items():
        print(table(rows))
        write_table(ROOT / "docs" / "motion.md", f"designed motions {name}", table(rows))
    draw(found, ROOT / "docs" / "pictures" / "designed_motions.png")
    codes = sorted({w["code"] for w in worlds.values()})
    write("designed_motions", {"wanted": WANTED.tolist(), "rated": RATED, "codes": codes, "arms": found}, None)


if __name__ == "__main__":
    main()
