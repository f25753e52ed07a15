"""What an old tare leaves, and what is to be had of it: the same logs, with more and more of the change told.

    python benchmarks/old_tares.py [--arms 24] [--seeds "21,22"]

Pandas of the benchmark's reference population, each with a motion and a payload of its own, a tare of 20 s near the
run's poses and a run of 6 s. The old tare is that of `tare_drift.py`: offsets by ±0.3 (wrist 0.1) N·m and friction by
30 % other than in the run. Each log is answered by the hybrid:

same session    with a tare of the day: nothing has changed
might be old    with that tare, and as much change allowed for as where one has been found (`drift.ALLOWED`)
old             with the old tare, as `identify` does
sizes told      with the old tare, and the true size of each change as its prior: ±0.3 N·m, 30 % of a joint's friction
change told     with the old tare, the change itself taken off its torque
5 s of today    with the first 5 s of the tare of the day in the place of the old one

and by the posterior mean of who knows how these arms are drawn, too (`scales_of`, 512 waves of the pose), and how the
payloads are (their mean and covariance), with the noise that `identify` expects: *every size told*.

The bound is the least error that any estimator can have in the mean if the model of that posterior is true
(`armload.posterior.bound`, Bayesian Cramér–Rao), as the mean magnitude of a Gaussian error, √(2/π) standard deviations.
Noise *as expected* is what `identify` expects at least of real sensors; *as shown* is the variance over blocks of a
quarter of a second of what the true arm leaves of simulated logs. The latter is taken for white, which it is not: it
follows the motion, and an estimator that believes the bound's model does worse (*every size told, noise as shown*).
Also with the arm known to be bare at the tare, and of the payload all but the mass told.

mass: mean absolute error ± its standard error over the arms, and mean half-width [g]. inside: of the masses. Printed,
and written to benchmarks/results/old_tares.json and a table of docs/hybrid_measured.md; ten minutes of one core.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, write, write_table
from tare_drift import before

from armload import Payload, Recording, arm
from armload.arms import rated_effort
from armload.identification.choice import choose
from armload.inertia import Z95
from armload.lab.episodes import Episode, draw_episodes, simulate_episodes
from armload.posterior import bound, scales_of
from armload.posterior.drift import ALLOWED
from armload.posterior.map import PosteriorLeastSquares
from armload.posterior.scales import Scales
from armload.posterior.solve import solve
from armload.regression import Correction, GaussianPrior, JointFeatures, payload_prior_std
from armload.regression.information import SAME, RegressionData, Session
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH, whole_noise
from armload.simulation import Sensors, World

PANDA = arm("panda")
CORRECTION = Correction(PANDA, rated_effort(PANDA))
WAVES = JointFeatures(PANDA.n, 512)  # of the pose: what `scales_of` needs for a bound that is not too low
WORLDS, FIRST_WORLD = 64, 40_000  # that the scales are of, and the seed of the first
NOISE_ARMS, NOISE_SEED = 16, 4100  # that the noise is measured on
REFRESH = 5.0  # [s]
MEAN = np.sqrt(2.0 / np.pi)  # mean magnitude over standard deviation, of a Gaussian error
EVERY = "every size told"


class Logs(NamedTuple):
    """A run, a tare of its session and an old one, and by what that differs.

    truth: phi (10,). session: of the run, against the old tare's, with the true sizes. corrected: the old tare without
    the change.
    """

    run: Recording
    fresh: Recording
    old: Recording
    truth: NDArray[np.float64]
    session: Session
    corrected: Recording


class Drawn(NamedTuple):
    """What is known of how arms and payloads are drawn: scales by the noise, and the payloads."""

    scales: dict[str, Scales]
    payloads: GaussianPrior


def logs_of(arms: int, seed: int) -> Iterator[Logs]:
    """A motion for each arm."""
    episodes = draw_episodes(PANDA, "reference", arms, seed, motions=arms)
    changed = [before(episode, 1.0, 1000 * seed + k) for k, episode in enumerate(episodes)]
    for now, then, e in zip(simulate_episodes(episodes), simulate_episodes(changed), changed, strict=True):
        assert now.tare is not None
        assert then.tare is not None
        yield Logs(now.run, now.tare, then.tare, now.truth.phi, *told(e, then.tare))


def told(episode: Episode, tare: Recording) -> tuple[Session, Recording]:
    """The true sizes of the change as a session of the run, and the tare without the change."""
    now, then = episode.world, episode.tare_world
    assert then is not None
    offset, level = then.offset - now.offset, then.friction.level - now.friction.level
    sizes = np.abs(np.concatenate([offset, level, np.zeros(PANDA.n)])) / CORRECTION.daily_std
    rubs = level * np.tanh(tare.dq / now.friction.width)
    return Session(1, 1.0, tuple(sizes.tolist())), replace(tare, tau=tare.tau - offset - rubs)


def drawn(seed: int) -> Drawn:
    """How arms and payloads are drawn. Friction is about zero, as its mean over the arms is not told to anybody."""
    worlds = [World.real_like(PANDA, FIRST_WORLD + k) for k in range(WORLDS)]
    found = scales_of(PANDA, worlds, Sensors.panda(PANDA), 200.0, WAVES)
    eta = found.eta.copy()
    eta[PANDA.n : 2 * PANDA.n] = np.mean([world.friction.level**2 for world in worlds], axis=0)
    weak = np.tile(payload_prior_std(PANDA) ** 2, 2)
    noise = {"as shown": noise_shown(), "as expected": np.tile(whole_noise(CORRECTION, SMOOTH), (2, 1))}
    several = draw_episodes(PANDA, "reference", 256, 5000 + seed, motions=1)
    return Drawn(
        {name: replace(found, eta=eta, noise=S, payloads=weak) for name, S in noise.items()},
        GaussianPrior.of([e.payload.parameters for e in several]),
    )


def noise_shown() -> NDArray[np.float64]:
    """S of tare and run (2, n): of what the true arm leaves, each block's mean squared, times its length."""
    episodes = draw_episodes(PANDA, "reference", NOISE_ARMS, NOISE_SEED, motions=NOISE_ARMS)
    found = [
        [left(e.world, logs.tare, None), left(e.world, logs.run, e.payload)]
        for e, logs in zip(episodes, simulate_episodes(episodes), strict=True)
        if logs.tare is not None
    ]
    return np.mean(found, axis=0)


def left(world: World, log: Recording, payload: Payload | None) -> NDArray[np.float64]:
    """S (n,) of a log, the arm as it is and its payload being known."""
    true = world.arm(PANDA) if payload is None else world.arm(PANDA).with_payload(payload.parameters)
    data = RegressionData(Correction(true, CORRECTION.effort), GAIN, None, SMOOTH.block)
    data.add(log.t, log.q, log.dq, log.tau - world.disturbance(log.q, log.dq) - world.offset)
    means, times, _ = data.blocks.means()
    return times @ means[:, :, -1] ** 2 / len(times)


def hybrid(tare: Recording, session: Session | None = None) -> PosteriorLeastSquares:
    """The default method of an arm with a tare; a session is believed, and nothing is asked then."""
    made = choose(PANDA, tare).identifier
    assert isinstance(made, PosteriorLeastSquares)
    if session is not None:
        made.session, made.test_tare = session, False
    return made


def informed(
    logs: Logs, tare: Recording, session: Session, scales: Scales, payloads: GaussianPrior
) -> tuple[NDArray[np.float64], float]:
    """phi (10,) of who knows how arms and payloads are drawn, and the standard deviation of its mass."""
    runs = []
    for log, of in ((tare, SAME), (logs.run, session)):
        runs.append(RegressionData(CORRECTION, GAIN, WAVES, SMOOTH.block, of))
        runs[-1].add(log.t, log.q, log.dq, log.tau)
    believed = replace(SMOOTH, overrated=1.0)
    found = solve(runs, payload_prior_std(PANDA), payloads, believed, 1, scales)
    return found.phi, float(np.sqrt(found.covariance[0, 0]))


def answered(logs: Logs, known: Drawn) -> dict[str, list[float]]:
    """Of each way to answer: error and half-width of the mass [g], whether it holds, error of the moments [g·m]."""
    methods = {
        "same session": hybrid(logs.fresh),
        "might be old": hybrid(logs.fresh, Session(1, ALLOWED)),
        "old": hybrid(logs.old),
        "old, sizes told": hybrid(logs.old, logs.session),
        "old, change told": hybrid(logs.corrected),
        "5 s of today": hybrid(logs.fresh.between(logs.fresh.t[0], logs.fresh.t[0] + REFRESH)),
    }
    answers = {}
    for name, method in methods.items():
        estimate = method.run(logs.run)
        answers[name] = estimate.phi, float(estimate.std[0])
    about = known.scales["as expected"], known.payloads
    answers[f"same session, {EVERY}"] = informed(logs, logs.fresh, SAME, *about)
    answers[f"old, {EVERY}"] = informed(logs, logs.old, logs.session, *about)
    about = known.scales["as shown"], known.payloads
    answers[f"old, {EVERY}, noise as shown"] = informed(logs, logs.old, logs.session, *about)
    out = {}
    for name, (phi, std) in answers.items():
        away, half = 1e3 * np.abs(phi - logs.truth), 1e3 * Z95 * std
        out[name] = [float(away[0]), half, float(away[0] <= half), float(away[1:4].mean())]
    return out


def bounded(logs: Logs, known: Drawn) -> dict[str, float]:
    """√(2/π) times the least standard deviations of the mass [g].

    Of phi = m·u, u known, and the information Λ of the logs, the variance of m is 1 / (uᵀ·Λ·u).
    """
    unit, out = logs.truth / logs.truth[0], {}
    for noise, scales in known.scales.items():
        for tare, session in (("same session", SAME), ("old, sizes told", logs.session)):
            about = {"tare": logs.old, "scales": scales, "features": WAVES, "prior": known.payloads, "session": session}
            whole = (logs.run.duration,)
            out[f"{tare}, noise {noise}"] = bound(PANDA, logs.run, **about, times=whole).std[-1, 0]
            if noise == "as shown":
                bare = bound(PANDA, logs.run, **about, times=whole, mounted=np.zeros(10)).covariance[-1]
                information = np.linalg.inv(bare) - np.linalg.inv(known.payloads.covariance)
                out[f"{tare}, noise {noise}, bare, all but the mass told"] = (unit @ information @ unit) ** -0.5
    return {name: 1e3 * MEAN * float(x) for name, x in out.items()}


def mean(values: Any) -> list[float]:
    """Mean and its standard error."""
    values = np.asarray(values, dtype=float)
    return [round(float(values.mean()), 2), round(float(values.std(ddof=1) / np.sqrt(len(values))), 2)]


def table(result: dict[str, Any]) -> str:
    """Answers, then bounds."""
    rows = [
        [
            name,
            "{:.1f} ± {:.1f}".format(*found["mass error [g]"]),
            f"{found['half-width [g]']:.0f}",
            f"{100 * found['inside']:.0f} %",
            "{:.2f} ± {:.2f}".format(*found["first moments [g·m]"]),
        ]
        for name, found in result["answered"].items()
    ]
    rows += [[f"*bound:* {name}", "{:.1f} ± {:.1f}".format(*x), "", "", ""] for name, x in result["bound [g]"].items()]
    return markdown_table(["tare", "mass [g]", "half-width [g]", "inside", "first moments [g·m]"], "lrrrr", rows)


def main() -> None:
    asked = options(__doc__, arms=24, seeds="21,22")
    seeds = [int(x) for x in asked.seeds.split(",")]
    known = drawn(seeds[0])
    answers, bounds = [], []
    for seed in seeds:
        for k, logs in enumerate(logs_of(asked.arms, seed)):
            answers.append(answered(logs, known))
            bounds.append(bounded(logs, known))
            say(f"seed {seed}, arm {k + 1}: " + ", ".join(f"{name} {x[0]:.1f}" for name, x in answers[-1].items()))
    of = {name: np.array([one[name] for one in answers]) for name in answers[0]}
    result = {
        "arms": len(answers),
        "seeds": seeds,
        "noise as shown, √S of the run [N·m·√s]": np.sqrt(known.scales["as shown"].noise[1]).round(4).tolist(),
        "noise as expected, √S [N·m·√s]": np.sqrt(known.scales["as expected"].noise[1]).round(4).tolist(),
        "answered": {
            name: {
                "mass error [g]": mean(x[:, 0]),
                "root mean square [g]": round(float(np.sqrt(np.mean(x[:, 0] ** 2))), 1),
                "half-width [g]": round(float(x[:, 1].mean()), 1),
                "inside": round(float(x[:, 2].mean()), 3),
                "first moments [g·m]": mean(x[:, 3]),
                "more than the old tare as it is answered [g]": mean(x[:, 0] - of["old"][:, 0]),
            }
            for name, x in of.items()
        },
        "bound [g]": {name: mean([one[name] for one in bounds]) for name in bounds[0]},
    }
    write("old_tares", result)
    write_table(ROOT / "docs" / "hybrid_measured.md", "old tares", table(result))


if __name__ == "__main__":
    main()
