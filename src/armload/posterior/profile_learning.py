"""How a profile is learned: from many logs, each of a session with offsets and friction of its own.

    r = W·phi_0 + Z·(eta + delta_s) + G·g + e,      delta_s ~ N(0, D)

phi_0 is whatever is mounted in all logs, known tools taken off. Given the noise S of each log and D, delta_s is
integrated out joint by joint, as it is each joint's own (`without_drift`), and the sessions' information is added up.
D and S are found by expectation–maximisation with stated priors.

How many features the pose has, and by which factor the noise counts for more because what the features cannot say
repeats, is chosen by logs left out (`foretold`). So the long-run variance is estimated, and capacity follows the data.

Source: Bishop 2006, ch. 3 and 9 (information form, EM).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_effort
from armload.errors import IdentificationError
from armload.posterior.drift import SESSION
from armload.posterior.foretold import REPEATED, Foreteller
from armload.posterior.problem import Problem
from armload.posterior.profile import Profile, SessionRecord, attached_mass, fingerprint, remembered
from armload.posterior.profile_agreement import carried, check_agree
from armload.posterior.profile_session import STATED, check_fits, log_data, poses, record, with_session, without_drift
from armload.posterior.scales import Scales
from armload.recording import Recording, digest_of, marks_of
from armload.regression import Correction, JointFeatures, payload_prior_std
from armload.regression.information import RegressionData, Session
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH
from armload.runtime.one_thread import one_thread

# features of the pose that a profile may have; the first is that of a single tare. A stream's row takes a third of a
# millisecond at the last
CAPACITIES = (128, 256, 384)
# sessions that are learned together, whose own offsets and friction are unknowns of one solution: memory grows with the
# square of their number and faster, 1 GB with 12 of a Panda, 2 with 24, 7 with 48. A stated bound: what is beyond is
# added one after another, as to a profile that there is
AT_ONCE = 24
_FEWEST = 4  # logs below which none is left out: then capacity and noise are those of a tare
_FOLDS = 5  # into which the logs are parted
_STEPS = 5  # of expectation–maximisation, as for a tare


@one_thread()
def learn_profile(
    arm: Arm,
    logs: Sequence[Recording],
    mounted: Sequence[NDArray[np.float64] | None] | None = None,
    *,
    sessions: Sequence[int] | None = None,
    known: Profile | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Profile:
    """Learn an arm from its logs.

    Args:
        arm: the bare arm, with its frame and gravity.
        logs: of any motions, all with the same mounted but for the tools that are known.
        mounted: (10,) the known tool of each log, about the arm's frame; None: there was none.
        sessions: a number for each log, logs of the same number are of one session; None: the logs' clocks tell, those
            without the time of day are sessions of their own.
        known: a profile to go on from: its information grows, its features stay.
        progress: called as progress(done, total) after every log.

    Raises:
        IdentificationError: no log, the same measurements twice, or a log that carries what the others do not; of more
            than `AT_ONCE` sessions also one of another arm.
        ModelError: `known` is of another arm.
    """
    if not logs:
        raise IdentificationError("a profile needs at least one log of the arm: found none")
    check_new(logs, known)
    correction = Correction(arm, rated_effort(arm))
    numbers = list(sessions) if sessions is not None else by_clock(logs)
    tools = list(mounted) if mounted is not None else [None] * len(logs)
    told = 0

    def rows(k: int, features: JointFeatures) -> RegressionData:
        nonlocal told
        data, told = log_data(correction, logs[k], features, Session(numbers[k] + 1, 1.0), tools[k]), told + 1
        if progress is not None:
            progress(told, len(logs))
        return data

    later = list(range(len(logs)))
    if known is not None:
        known.check(arm)
    else:
        features = JointFeatures(arm.n, CAPACITIES[-1] if len(logs) >= _FEWEST else CAPACITIES[0])
        together = _together(logs, numbers)
        parts = [rows(k, features) for k in together]
        known = _learned(correction, parts, [logs[k] for k in together])
        del parts
        later = [k for k in later if k not in set(together)]
        for k in later:
            check_fits(known, arm, logs[k], tools[k])
    for number in dict.fromkeys(numbers[k] for k in later):
        of = [k for k in later if numbers[k] == number]
        data = RegressionData.joined([rows(k, known.features) for k in of])
        known = with_session(known, correction, data, [logs[k] for k in of])
    return known


def _together(logs: Sequence[Recording], numbers: Sequence[int]) -> list[int]:
    """The logs of the sessions that are learned together; of many, the samples themselves decide which."""
    if len(set(numbers)) <= AT_ONCE:
        return list(range(len(logs)))
    first: dict[int, str] = {}
    for number, log in zip(numbers, logs, strict=True):
        digest = digest_of(log)
        first[number] = min(first.get(number, digest), digest)
    kept = set(sorted(first, key=lambda number: first[number])[:AT_ONCE])
    return [k for k, number in enumerate(numbers) if number in kept]


def check_new(logs: Sequence[Recording], known: Profile | None) -> None:
    """See that no log counts twice: what is told again is no more certain.

    Raises:
        IdentificationError: two hold the same measurements, or one and what the profile is learned from.
    """
    seen: dict[str, str] = {}
    for log in logs:
        if known is not None and (learned := known.learned_from(log)) is not None:
            raise IdentificationError(
                f"{log.source} holds measurements of {learned}, which the profile is learned from: leave it out"
            )
        marks = {digest_of(log), *marks_of(log)}
        if same := marks.intersection(seen):
            raise IdentificationError(f"{log.source} holds measurements of {seen[same.pop()]}: name one of them")
        seen |= dict.fromkeys(marks, log.source)


def by_clock(logs: Sequence[Recording]) -> list[int]:
    """A session's number for each log: one for those that follow each other within `SESSION` by the time of day."""
    numbers, ended, last = list(range(len(logs))), -np.inf, 0
    dated = sorted((date, k) for k, log in enumerate(logs) if (date := log.date) is not None)
    for date, k in dated:
        if date - ended < SESSION:
            numbers[k] = numbers[last]
        ended, last = max(ended, date + logs[k].duration), k
    return numbers


@dataclass(frozen=True, eq=False)
class _Fit:
    """Logs solved together with as many features: scales, size of the drift, the sessions' own and its variance."""

    features: JointFeatures
    scales: Scales
    drift: NDArray[np.float64]
    means: dict[int, NDArray[np.float64]]
    variances: dict[int, NDArray[np.float64]]


def _learned(correction: Correction, parts: list[RegressionData], logs: Sequence[Recording]) -> Profile:
    arm, found = correction.arm, []
    for size in CAPACITIES if len(parts) >= _FEWEST else CAPACITIES[:1]:
        features = JointFeatures(arm.n, size)
        data = [part if part.features == features else part.of_features(features) for part in parts]
        fit = _fitted(correction, data)
        found.append((*_left_out(correction, data, fit), fit, data))
    _, repeated, fit, data = max(found, key=lambda one: one[0])
    if len(logs) > 1:
        check_agree(logs, carried(correction, data, fit.scales, fit.drift, repeated))
    A, b = 0.0, 0.0
    for number in fit.means:
        of = [(part, S) for part, S in zip(data, fit.scales.noise, strict=True) if part.session.number == number]
        one = sum(part.A / S[:, None, None] for part, S in of), sum(part.b / S[:, None] for part, S in of)
        one = without_drift(*one, fit.drift)  # type: ignore[arg-type]
        A, b = A + one[0] / repeated, b + one[1] / repeated
    return Profile(
        arm.name,
        fingerprint(arm),
        str(arm.frame),
        arm.n,
        np.asarray(arm.gravity, dtype=float),
        attached_mass(arm),
        fit.features,
        A,  # type: ignore[arg-type]
        b,  # type: ignore[arg-type]
        replace(fit.scales, noise=np.ones((1, arm.n)), drifts=np.zeros((0, 0))),
        fit.drift,
        repeated,
        remembered(_records(correction, fit, data, logs)),
        np.concatenate([poses(log) for log in logs]),
    )


def _fitted(correction: Correction, data: list[RegressionData]) -> _Fit:
    """Scales and drift of the sessions by expectation–maximisation."""
    noise = replace(SMOOTH, novelty=np.inf)  # what repeats is found from logs left out
    problem = Problem(data, payload_prior_std(correction.arm), None, noise, same=True)
    scales, stated, count = problem.scales(None), correction.daily_std**2, len(problem.sessions)
    drift = stated
    for step in range(_STEPS + 1):
        found = problem.posterior(scales)
        means = found.mean[problem.eta.stop :].reshape(count, -1)
        variances = np.diag(found.covariance)[problem.eta.stop :].reshape(count, -1)
        if step < _STEPS:
            drift = (STATED * stated + (means**2 + variances).sum(axis=0)) / (STATED + count)
            scales = replace(problem.improved(scales, found), drifts=np.tile(drift, (count, 1)))
    numbers = [session.number for session in problem.sessions]
    in_order = sorted(range(count), key=lambda i: numbers[i])
    return _Fit(
        data[0].features,
        scales,
        drift,
        {numbers[i]: means[i] for i in in_order},
        {numbers[i]: variances[i] for i in in_order},
    )


def _left_out(correction: Correction, data: list[RegressionData], fit: _Fit) -> tuple[float, float]:
    """Log density of the blocks of logs left out, and the factor on the noise at which it is highest."""
    count, n = len(data), correction.arm.n
    if count < _FEWEST:
        return 0.0, max(1.0, sum(part.blocks.duration for part in data) / SMOOTH.novelty)
    own = [
        without_drift(part.A / S[:, None, None], part.b / S[:, None], fit.drift)
        for part, S in zip(data, fit.scales.noise, strict=True)
    ]
    total, folds = np.zeros(len(REPEATED)), min(_FOLDS, count)
    for fold in range(folds):
        out = range(fold, count, folds)
        kept = RegressionData(correction, GAIN, fit.features, SMOOTH.block)
        kept.A = sum(A for k, (A, _) in enumerate(own) if k not in out)  # type: ignore[assignment]
        kept.b = sum(b for k, (_, b) in enumerate(own) if k not in out)  # type: ignore[assignment]
        for i, repeated in enumerate(REPEATED):
            kept.noise = np.full(n, repeated)
            others = Foreteller(kept, fit.scales, fit.drift)
            total[i] += sum(others.log_density(data[k], fit.scales.noise[k]) for k in out)
    best = int(np.argmax(total))
    return float(total[best]), REPEATED[best]


def _records(
    correction: Correction, fit: _Fit, data: list[RegressionData], logs: Sequence[Recording]
) -> list[SessionRecord]:
    out = []
    for number, mean in fit.means.items():
        of = [k for k, part in enumerate(data) if part.session.number == number]
        C = np.diag(fit.variances[number] + fit.drift)
        S = np.mean([fit.scales.noise[k] for k in of], axis=0)
        lasts = sum(data[k].blocks.duration for k in of)
        out.append(record(correction, mean, C, S, lasts, [logs[k] for k in of], ""))
    return out
