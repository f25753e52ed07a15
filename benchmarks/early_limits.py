"""Changes that are often missed: what the samples tell of them at best, and what is noticed.

    python benchmarks/early_limits.py [--streams 96] [--real 64] [--seed 90000]

The streams *within the first 2 s* of events.py, and the first change of each of *the real UR10e, tared*. Just before
the change the posterior of arm and payload is kept. The samples after it are weighed by that posterior under two
hypotheses: the payload is what it was, or another body has been added, phi → phi + delta, delta ~ N(0, s²·R·Rᵀ) as in
`online/modes.py`. delta joins the unknowns of the linear Gaussian model, so that with its information Λ and vector h
the log evidence is exact:

    ln p(rows | another) − ln p(rows | the same) = ½·hᵀ·(Λ + (s²·R·Rᵀ)⁻¹)⁻¹·h − ½·ln|1 + s²·Rᵀ·Λ·R|

That the moment of the change is known makes it more than any filter can find. An event is sure at odds of 999 : 1; a
change within the last T seconds is expected with T/5 s in the first seconds of a stream, which asks for 9.1 after 0.5 s
and 8.3 after 1 s, and with T/100 s on motor currents, which asks for 12.2 and 11.5.

noticed   changes with an event within a second
told      those whose log evidence is above that 0.5 and 1 s after the change: *at best* with noise as the posterior
          expects it, *as loud* with twice its variance, as a stream begins with (`LEVEL`)
nothing   of the real logs: the same of their samples without the payload's torque, that is, where nothing changed

Written to benchmarks/results/early_limits.json and two tables of docs/online_measured.md; 25 minutes of one core. A
part with no streams (`--streams 0`) stays as it is in the results.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from event_scenes import Scene, Stream, streamed, torque_of
from numpy.typing import NDArray
from script import RESULTS, ROOT, markdown_table, options, say, write, write_table

from armload.identification import choose
from armload.online import OnlineIdentifier
from armload.online.thresholds import EARLY_RARE, LEVEL, RARE, SURE
from armload.posterior import PosteriorLeastSquares
from armload.posterior.sequential import SequentialPosterior
from armload.recording import GAP, Recording
from armload.regression import payload_prior_std
from armload.regression.prior import BODY_SIZES, body_root

PAGE = ROOT / "docs" / "online_measured.md"
LOOKED = (0.5, 1.0)  # [s] after the change
JUST = 0.02  # [s] before it, when the posterior is kept: a sample more than the row that shows it


def asked_for(rare: float) -> list[float]:
    """The least log evidence at `LOOKED` of a change that is expected once in so many seconds."""
    return [float(np.log(SURE / (1.0 - SURE)) - np.log(t / rare / (1.0 - t / rare))) for t in LOOKED]


ASKED, ASKED_MOTOR = asked_for(EARLY_RARE), asked_for(RARE)


class Change(NamedTuple):
    """mass: that is taken up [kg]. at: [s] of the stream. noticed: whether within a second. evidence, louder: the log
    evidence at `LOOKED`, with noise as expected and `LEVEL` times its variance; None: nothing was known yet.
    """

    mass: float
    at: float
    noticed: bool
    evidence: list[float] | None
    louder: list[float] | None


def noticed(stream: Stream) -> bool:
    """Whether an event is said within a second of the first change."""
    began, event, identifier = stream.changes[0].start, None, OnlineIdentifier(stream.robot, stream.tare)
    for sample in stream.log:
        event = identifier.update(*sample).event
        if sample.t > began + 1.5 or (event is not None and began <= event.t < began + 1.0):
            break
    identifier.close()
    return event is not None and began <= event.t < began + 1.0


def with_delta(state: SequentialPosterior, mean: NDArray, covariance: NDArray) -> SequentialPosterior:
    """The posterior of all but delta, of which nothing is known; phi ~ N(mean, covariance) is one of the others.

    In a run after a change the payload before it is one of a tare: what is mounted on top of it is delta.
    """
    n, R, Z = state.slope.shape
    C = np.array([_whole(c) for c in state.C])
    slope = np.zeros((n, R, Z))
    for j, order in enumerate(state.order):
        slope[j][:, order] = state.slope[j]
        for late in state.late[j, : state.waiting[0]]:
            u = np.zeros(Z)
            u[order] = late[R:]
            C[j] -= np.outer(late[:R], late[:R])
            slope[j] += np.outer(late[:R], u)
    S, own = state.shared_slope, state.shared_own
    shared = np.block(
        [[covariance, -covariance @ S.T], [-S @ covariance, _whole(state.shared_C) + S @ covariance @ S.T]]
    )
    slope = np.concatenate([np.zeros((n, R, 10)), slope], axis=2)
    nothing = np.zeros((len(shared), 10)), np.zeros((10, 10)), np.zeros(10)
    joints, means = (C, state.own.copy(), slope), np.r_[mean, own - S @ mean]
    return SequentialPosterior(*joints, shared, means, *nothing, state.noise.copy(), state.tares + 1, state.drifts)


def _whole(lower: NDArray) -> NDArray:
    return np.tril(lower) + np.tril(lower, -1).T


def log_evidence(state: SequentialPosterior, root: NDArray, louder: float) -> float:
    """That delta is a body of one of the sizes, each as likely, over that there is none."""
    A, c = root.T @ state.information @ root / louder, root.T @ state.vector / louder
    found = []
    for size in BODY_SIZES:
        M = np.eye(10) + size**2 * A
        found.append(0.5 * size**2 * c @ np.linalg.solve(M, c) - 0.5 * np.linalg.slogdet(M)[1])
    return float(np.logaddexp.reduce(found) - np.log(len(found)))


def told(stream: Stream) -> list[list[float]] | None:
    """The log evidence at `LOOKED` after the change, with either noise; None: the posterior had not begun."""
    run, began = choose(stream.robot, stream.tare, live=True).identifier, stream.changes[0].start
    assert isinstance(run, PosteriorLeastSquares)
    root = float(payload_prior_std(stream.robot)[0]) * body_root()
    state, row_t, found = None, np.inf, [[], []]
    for sample in stream.log:
        if sample.t < began - JUST:
            run.update(sample)
            continue
        if state is None:
            if run.stream.state is None:
                break
            state = with_delta(run.stream.state, *run.stream.answer())
        row = run.stream.look(*sample)
        if row is not None:
            if 0.0 < row.t - row_t <= GAP:
                state.take(row._replace(h=row.t - row_t))
            row_t = row.t
        if sample.t >= began + LOOKED[len(found[0])]:
            for louder, values in zip((1.0, LEVEL), found, strict=True):
                values.append(log_evidence(state, root, louder))
            if len(found[0]) == len(LOOKED):
                break
    run.close()
    return None if state is None else found


def measured(stream: Stream) -> Change:
    """The first change of a stream, in numbers."""
    one, (evidence, louder) = stream.changes[0], told(stream) or (None, None)
    return Change(float(one.phi[0]), float(one.start), noticed(stream), evidence, louder)


def without(stream: Stream) -> Stream:
    """The same samples without what the changes add."""
    log = stream.log
    tau = log.tau - torque_of(stream.robot, log, stream)
    return replace(stream, log=Recording(log.t, log.q, log.dq, tau))


def shares(found: list[list[float] | None], asked: list[float]) -> str:
    """How many of these log evidences are above what is asked, after each of `LOOKED`."""
    return " · ".join(str(sum(one is not None and one[k] > least for one in found)) for k, least in enumerate(asked))


def table(changes: list[Change]) -> str:
    """A row for each class of mass, before and after the first half second."""
    rows = []
    for when, early in (("the first half second", True), ("half a second to 2 s", False)):
        for name, low, high in (("0.2 to 0.5 kg", 0.0, 0.5), ("0.5 kg and more", 0.5, np.inf)):
            some = [x for x in changes if (x.at < 0.5) == early and low <= x.mass < high]
            best, loud = shares([x.evidence for x in some], ASKED), shares([x.louder for x in some], ASKED)
            rows.append([when, name, str(len(some)), str(sum(x.noticed for x in some)), best, loud])
    heads = ["changes", "noticed", "told at best after 0.5 · 1 s", "told as loud after 0.5 · 1 s"]
    return markdown_table(["in", "mass", *heads], "llrrrr", rows)


def real_table(logs: dict[str, list[tuple[Change, list[list[float]] | None]]]) -> str:
    """A row for each log of the real arm and each class of mass."""
    rows = []
    for name, found in logs.items():
        for said, low, high in (("0.2 to 0.5 kg", 0.0, 0.5), ("0.5 to 1 kg", 0.5, 1.0), ("1 kg and more", 1.0, np.inf)):
            some = [pair for pair in found if low <= pair[0].mass < high]
            cells = [
                shares(values, ASKED_MOTOR)
                for values in (
                    [x.evidence for x, _ in some],
                    [x.louder for x, _ in some],
                    [None if nothing is None else nothing[0] for _, nothing in some],
                    [None if nothing is None else nothing[1] for _, nothing in some],
                )
            ]
            rows.append([name, said, str(len(some)), str(sum(x.noticed for x, _ in some)), *cells])
    heads = ["changes", "noticed", "told at best after 0.5 · 1 s", "as loud", "told of nothing at best", "as loud"]
    return markdown_table(["log", "mass", *heads], "llrrrrrr", rows)


def main() -> None:
    asked = options(__doc__, streams=96, real=64, seed=90000)
    kept = json.loads((RESULTS / "early_limits.json").read_text()) if (RESULTS / "early_limits.json").is_file() else {}
    out = {"seed": asked.seed, "asked": ASKED, "asked on motor currents": ASKED_MOTOR}
    out |= {part: kept[part] for part in ("changes", "real") if part in kept}
    if asked.streams:
        changes = []
        for k in range(asked.streams):
            changes.append(measured(streamed(Scene("early", asked.seed + k))))
            say(f"{k + 1} of {asked.streams}: {changes[-1]}")
        out["changes"] = [change._asdict() for change in changes]
        write_table(PAGE, "early", table(changes))
    if asked.real:
        logs: dict[str, list[tuple[Change, list[list[float]] | None]]] = {"empty": [], "loaded": []}
        for k in range(asked.real):
            stream = streamed(Scene("real_motor", asked.seed + k))
            pair = measured(stream), told(without(stream))
            logs["loaded" if stream.base else "empty"].append(pair)
            say(f"{k + 1} of {asked.real}: {pair}")
        out["real"] = {
            name: [{**one._asdict(), "nothing": nothing} for one, nothing in found] for name, found in logs.items()
        }
        write_table(PAGE, "motor-limits", real_table(logs))
    write("early_limits", out, indent=None)


if __name__ == "__main__":
    main()
