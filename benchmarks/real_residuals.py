"""Where real arms differ from simulated ones: what one model leaves of real logs, and of simulated logs like them.

    ARMLOAD_REAL_DATA=FOLDER python benchmarks/real_residuals.py [--worlds 12] [--only "Panda;KUKA"]

Each real log's motion is simulated on arms of `World.real_like` and of `World.beyond`, seen by the sensors of the arm's
sheet at the log's mean rate, and all are fitted alike: the rigid part of `map-gp` alone, and with its smooth features.
Fits are made of every other two seconds, `held out` is of the rest. All of each joint, in thousandths of its effort
limit where no unit is named; what is compared is the mean over the joints, medians and 5 to 95 % over the worlds.

noise: white, from second differences. rigid, smooth: rms left of the seconds held out. time: at which the
autocorrelation of what the rigid fit leaves falls to 1/e [s]; slow: share of its power below 1 Hz. explained: share of
its variance that the features explain in the seconds held out. coulomb, viscous [per rad/s], offset: of the rigid fit.
load: share of the torque that a joint loses [%]; behind the gears of a fit of its own that expects up to 8 %, and of
the joints that bear a quarter of what the one that bears most does. stribeck: mean of what the rigid fit leaves against
the motion at 0.02–0.08 rad/s over that at 0.2–0.6. reversal: by how much more than the fitted tanh the torque steps
from 0.1 s before to 0.1 s after a reversal. rest: rms left of joints at rest. asymmetry: half the difference of what
the rigid fit leaves in the two directions.

Two logs are there once more, real and simulated, with velocities as positions and velocities tell them together
(`armload.recording.steadied`): noise of the velocities is in what the fits leave, as momentum of the arm.

The KUKA is an LWR 4+ most likely, of which no description is built in: it is fitted as an iiwa14, whose links are free
within their spread, and the simulated arms are iiwas. No sample of a log is used for anything else. Logs that are named
replace their own among the results. Writes benchmarks/results/real_residuals.json, the tables of docs/real_arms.md and
docs/pictures/real_residuals.svg.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from real_logs import data
from script import RESULTS, ROOT, markdown_table, options, say, write, write_table

from armload import Arm, InertialParameters, Recording, arm, read_recording
from armload.arms import rated_effort
from armload.inertia import nearest_consistent
from armload.motion import Motion
from armload.posterior.problem import Problem
from armload.recording import steadied
from armload.regression import Correction, FilteredRegression, JointFeatures, solution_prior_std
from armload.regression.information import RegressionData
from armload.regression.lag import GAIN
from armload.regression.noise import RIGID, SMOOTH
from armload.regression.rows import REGRESSOR_RATE, Rows
from armload.simulation import Run, Sensors, World, simulate_many
from armload.simulation.resolution import COARSE

LOGS = {
    "Panda": ("panda_unloaded_1khz.csv", "panda"),
    "UR10e": ("ur10e_unloaded.csv", "ur10e"),
    "UR10e, 2.805 kg": ("ur10e_loaded_2805g.csv", "ur10e"),
    "UR10": ("ur10_ros2_bag.db3", "ur10"),
    "KUKA": ("kuka_lwr_100hz.csv", "iiwa14"),
    "Panda, steadied": ("panda_unloaded_1khz.csv", "panda"),
    "KUKA, steadied": ("kuka_lwr_100hz.csv", "iiwa14"),
}
STEADIED = ", steadied"
MOST_LOST = 0.08  # of the torque, 1 sigma, where the fit is to tell what joints behind their gears lose
BEARS = 0.25  # of the largest mean torque of a joint: of one that tells it
KNOTS = 0.12  # [s] of the spline through a log's positions: slower than its noise, faster than its motion
PART = 2.0  # [s] of each part that is fitted, or held out
EVEN = 50.0  # [Hz] at which correlation and spectrum are taken
GAP = 0.2  # [s] without samples
SLOW, FAST = (0.02, 0.08), (0.2, 0.6)  # [rad/s]
REST = 0.005  # [rad/s] of a joint at rest
AROUND = 0.1  # [s] before and after a reversal
FIRST_SEED = 5_000


@dataclass(frozen=True, eq=False)
class Followed(Motion):
    """The motion of a log: a quintic spline through its positions."""

    log: Recording
    name: str = "followed"

    def __post_init__(self) -> None:
        from scipy.interpolate import make_lsq_spline

        t = self.log.t - self.log.t[0]
        even = np.arange(0.0, t[-1], 0.02)
        q = np.stack([np.interp(even, t, x) for x in self.log.q.T], axis=1)  # gaps are crossed
        inner = np.arange(KNOTS, even[-1] - KNOTS, KNOTS)
        knots = np.r_[[even[0]] * 6, inner, [even[-1]] * 6]
        object.__setattr__(self, "spline", make_lsq_spline(even, q, knots, k=5))
        object.__setattr__(self, "end", even[-1])

    @property
    def n(self) -> int:
        return self.log.n

    @property
    def duration(self) -> float:
        return self.end  # type: ignore[attr-defined]

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        return self.spline(t, order)  # type: ignore[attr-defined]


class Fit(NamedTuple):
    """What a fit leaves of all rows (M, n) [N·m], with its unknowns: phi (10,), eta (p,)."""

    left: NDArray[np.float64]
    phi: NDArray[np.float64]
    eta: NDArray[np.float64]


def made(robot: Arm, log: Recording, features: JointFeatures) -> tuple[Correction, Rows]:
    """The rows of a log."""
    correction = Correction(robot, rated_effort(robot))
    regression = FilteredRegression(robot, GAIN, correction, features, REGRESSOR_RATE)
    return correction, regression.rows(log.t, log.q, log.dq, log.tau)


def fitted(correction: Correction, rows: Rows, smooth: bool, taken: NDArray[np.bool_]) -> Fit:
    """MAP fit of payload, arm and, if asked, smooth features to the rows taken."""
    n = correction.arm.n
    features, noise = (JointFeatures(n), SMOOTH) if smooth else (JointFeatures(n, 0, 0), RIGID)
    size = 10 + correction.size + features.size
    data_of = RegressionData(correction, GAIN, features, noise.block)
    data_of.take(Rows(*(x[taken] for x in rows._replace(X=rows.X[:, :, :size]))))
    problem = Problem([data_of], solution_prior_std(correction.arm), None, noise)
    scales = problem.scales(None)
    for _ in range(5):
        scales = problem.improved(scales, problem.posterior(scales))
    found = problem.posterior(scales)
    shared = 10 + correction.size
    left = rows.r - rows.X[:, :, :shared] @ found.mean
    if smooth:
        left = left - np.einsum("mjr,jr->mj", rows.X[:, :, shared:], found.weights)
    return Fit(left, found.mean[:10], found.mean[10:])


def rms(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Over the rows; nan of none."""
    return np.sqrt(np.mean(x**2, axis=0)) if len(x) else np.full(x.shape[1], np.nan)


def measures(robot: Arm, log: Recording) -> dict[str, NDArray[np.float64]]:
    """All that is compared, of each joint (n,)."""
    correction, rows = made(robot, log, JointFeatures(robot.n))
    n, unit = robot.n, 1e3 / correction.effort
    part = ((rows.t - rows.t[0]) // PART).astype(int)
    settled = rows.t - rows.t[0] > 0.5
    taken = settled & (part % 2 == 0)
    held = settled & (part % 2 == 1)
    rigid, smooth = (fitted(correction, rows, how, taken) for how in (False, True))
    whole = fitted(correction, rows, False, settled)
    dq = np.stack([np.interp(rows.t, log.t, x) for x in log.dq.T], axis=1)
    e, speed = whole.left, np.abs(dq)
    out = {
        "noise": unit * np.std(np.diff(log.tau, 2, axis=0), axis=0) / np.sqrt(6.0),
        "rigid": unit * rms(rigid.left[held]),
        "smooth": unit * rms(smooth.left[held]),
        "explained": 100.0 * (1.0 - (rms(smooth.left[held]) / rms(rigid.left[held])) ** 2),
        "coulomb": unit * np.abs(correction.coulomb(whole.eta)),
        "viscous": unit * np.abs(whole.eta[2 * n : 3 * n]),
        "offset": unit * np.abs(correction.offset(whole.eta)),
    }
    out["load"] = 100.0 * (whole.eta[correction.load] if robot.motor_torque else lost(robot, log, settled))
    out["time"], out["slow"] = slowness(rows.t, e)
    against = e * np.sign(dq)
    names = ("stribeck", "asymmetry", "reversal", "rest")
    out |= {name: np.full(n, np.nan) for name in names}
    for j in range(n):
        slow, fast = ((speed[:, j] > low) & (speed[:, j] < high) & settled for low, high in (SLOW, FAST))
        if slow.sum() > 20 and fast.sum() > 20:
            out["stribeck"][j] = unit[j] * (against[slow, j].mean() - against[fast, j].mean())
        up, down = (settled & (sign * dq[:, j] > FAST[0]) for sign in (1, -1))
        if up.sum() > 20 and down.sum() > 20:
            out["asymmetry"][j] = unit[j] * 0.5 * abs(e[up, j].mean() + e[down, j].mean())
        out["reversal"][j] = unit[j] * reversal(rows.t, dq[:, j], e[:, j])
        still = settled & (speed[:, j] < REST)
        if still.sum() > 50:
            out["rest"][j] = unit[j] * np.sqrt(np.mean(e[still, j] ** 2))
    return out


def lost(robot: Arm, log: Recording, settled: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Share of the torque that joints lose behind their gears (n,); nan of joints that bear little."""
    correction, rows = made(replace(robot, gear_loss=MOST_LOST), log, JointFeatures(robot.n))
    share = fitted(correction, rows, False, settled).eta[correction.load]
    bears = np.abs(log.tau).mean(axis=0)
    return np.where(bears > BEARS * bears.max(), share, np.nan)


def slowness(t: NDArray, e: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Correlation time (n,) [s] and share of the power below 1 Hz (n,) [%] of a residual."""
    even = np.arange(t[0] + 0.5, t[-1], 1.0 / EVEN)
    x = np.stack([np.interp(even, t, column) for column in e.T], axis=1)
    x = x - x.mean(axis=0)
    power = np.abs(np.fft.rfft(x, 2 * len(x), axis=0)) ** 2
    correlation = np.fft.irfft(power, axis=0)[: len(x)]
    correlation /= correlation[0]
    frequency = np.fft.rfftfreq(2 * len(x), 1.0 / EVEN)
    time = np.array([np.argmax(column < np.exp(-1.0)) for column in correlation.T]) / EVEN
    return time, 100.0 * power[frequency < 1.0].sum(axis=0) / power.sum(axis=0)


def reversal(t: NDArray, dq: NDArray, e: NDArray) -> float:
    """Mean step of the residual in the new direction of motion, over the reversals of one joint; nan of none."""
    smooth = np.interp(t, t, dq)
    turns = np.flatnonzero((smooth[1:] * smooth[:-1] < 0.0) & (np.diff(t) < GAP))
    steps = []
    for k in turns:
        now = t[k]
        if now - AROUND < t[0] or now + AROUND > t[-1]:
            continue
        before, after = (np.interp(now + s * AROUND, t, dq) for s in (-1, 1))
        if before * after < 0.0 and min(abs(before), abs(after)) > SLOW[0]:
            steps.append(np.sign(after) * (np.interp(now + AROUND, t, e) - np.interp(now - AROUND, t, e)))
    return float(np.mean(steps)) if steps else np.nan


def alike(robot: Arm, log: Recording, worlds: str, count: int, payload: InertialParameters | None) -> list[Recording]:
    """The log's motion on simulated arms, without the samples of its gaps."""
    motion, sensors = Followed(log), Sensors.of(robot)
    rate = 1.0 / float(np.median(np.diff(log.t)))
    runs = [
        Run(motion, payload, getattr(World, worlds)(robot, FIRST_SEED + k), sensors, FIRST_SEED + k)
        for k in range(count)
    ]
    gaps = np.flatnonzero(np.diff(log.t) > GAP)
    out = []
    for seen in simulate_many(robot, runs, rate=rate, workers=1, resolution=COARSE):
        keep = np.ones(len(seen), dtype=bool)
        for k in gaps:
            keep &= (seen.t < log.t[k] - log.t[0]) | (seen.t > log.t[k + 1] - log.t[0])
        out.append(seen.select(keep))
    return out


def compared(name: str, count: int) -> dict[str, Any]:
    """One real log beside its simulated ones."""
    file, which = LOGS[name]
    robot = arm(which)
    log = read_recording(data() / file, robot)
    as_read: Callable[[Recording], Recording] = steadied if name.endswith(STEADIED) else lambda log: log
    real = measures(robot, as_read(log))
    correction, rows = made(robot, log, JointFeatures(robot.n))
    phi = fitted(correction, rows, False, np.ones(len(rows.t), dtype=bool)).phi
    held = InertialParameters(nearest_consistent(phi)) if "kg" in name else None
    out: dict[str, Any] = {"real": {key: listed(x) for key, x in real.items()}}
    for worlds in ("real_like", "beyond"):
        several = [measures(robot, as_read(x)) for x in alike(robot, log, worlds, count, held)]
        out[worlds] = {key: [listed(x[key]) for x in several] for key in real}
        say(f"{name}: {worlds} done")
    return out


def listed(x: NDArray[np.float64]) -> list[float | None]:
    """For JSON, which has no nan."""
    return [round(float(v), 3) if np.isfinite(v) else None for v in x]


def mean(values: Any) -> NDArray[np.float64]:
    """Over the joints, those without a number left out; nan of none."""
    x = np.atleast_2d(np.asarray(values, dtype=float))
    known = np.isfinite(x)
    count = known.sum(axis=1)
    return np.where(count > 0, np.where(known, x, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)


def table(logs: dict[str, Any]) -> str:
    """Real and simulated, a row for each measure and log."""
    rows = []
    for name, entry in logs.items():
        for key in entry["real"]:
            real = float(mean(entry["real"][key])[0])
            if not np.isfinite(real):
                continue
            cells = [name, key, f"{real:.3g}"]
            verdict = []
            for worlds in ("real_like", "beyond"):
                several = mean(entry[worlds][key])
                several = several[np.isfinite(several)]
                if not len(several):
                    cells.append("")
                    continue
                low, middle, high = np.percentile(several, [5, 50, 95])
                cells.append(f"{middle:.3g} ({low:.3g} … {high:.3g})")
                verdict.append("below" if real > high else "above" if real < low else "")
            rows.append([*cells, *verdict, *[""] * (2 - len(verdict))])
    columns = ("log", "measure", "real", "like the measured", "beyond them", "simulated lies", "beyond lies")
    return markdown_table(columns, "llrrrll", rows)


def picture(logs: dict[str, Any]) -> None:
    """Real over simulated, measure by measure: docs/pictures/real_residuals.svg."""
    import matplotlib.pyplot as plt

    keys = ("noise", "rigid", "smooth", "coulomb", "viscous", "offset", "load", "time", "stribeck", "reversal", "rest")
    figure, axes = plt.subplots(1, len(logs), figsize=(14, 4.2), sharey=True, layout="constrained")
    for axis, (name, entry) in zip(axes, logs.items(), strict=True):
        for row, key in enumerate(keys):
            if key not in entry["real"]:
                continue
            real = abs(float(mean(entry["real"][key])[0]))
            for worlds, colour, shift in (("real_like", "C0", -0.15), ("beyond", "C1", 0.15)):
                several = np.abs(mean(entry[worlds][key]))
                several = several[np.isfinite(several)]
                if not (np.isfinite(real) and len(several)):
                    continue
                low, middle, high = np.percentile(several / real, [5, 50, 95])
                axis.plot([low, high], [row + shift] * 2, color=colour, lw=2.5)
                axis.plot(middle, row + shift, "o", color=colour, ms=4)
        axis.axvline(1.0, color="k", lw=1)
        axis.set(xscale="log", xlim=(0.03, 30.0), title=name)
        axis.grid(axis="x", alpha=0.3)
    axes[0].set_yticks(range(len(keys)), keys)
    axes[0].invert_yaxis()
    figure.supxlabel("simulated over real, 5 to 95 % of the worlds (blue: like the measured arms, orange: beyond them)")
    figure.savefig(ROOT / "docs" / "pictures" / "real_residuals.svg", metadata={"Date": None})


def main() -> None:
    asked = options(__doc__, worlds=12, only="")
    file, chosen = RESULTS / "real_residuals.json", asked.only.split(";") if asked.only else list(LOGS)
    found = json.loads(file.read_text(encoding="utf-8"))["logs"] if asked.only else {}
    found |= {name: compared(name, asked.worlds) for name in chosen}
    logs = {name: found[name] for name in LOGS if name in found}
    write("real_residuals", {"worlds": asked.worlds, "unit": "1e-3 effort limits", "logs": logs}, None)
    write_table(ROOT / "docs" / "real_arms.md", "real residuals", table(logs))
    picture(logs)


if __name__ == "__main__":
    main()
