"""The same recordings through every method: who is how far off, from when on, and against which baselines."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.estimators import Estimate, Identifier, Tared
from armload.identification import METHODS
from armload.inertia import InertialParameters, parameters_only
from armload.lab.evaluation.baselines import PriorLeastSquares, TrainingMean
from armload.lab.evaluation.comparison import Comparison
from armload.recording import Recording
from armload.regression import GaussianPrior

# A method is an identifier, or how to make one that knows the run's tare.
Method = Identifier | Callable[[Recording | None], Identifier]
WITH_TARE = ", with tare"
_POINTS = 49  # default number of times: one per 125 ms of a 6 s motion
_STEP = 0.125  # [s] estimates are collected at least so often, unless the times are even


@dataclass(frozen=True, eq=False)
class EvaluationRun:
    """A recording whose payload is known.

    recording: of the robot's joints.
    truth: the payload, about the arm's payload frame; with a tare, what was added since.
    label: how tables call the run.
    tare: an earlier log of the same arm without the payload, if the methods may use one.
    seed: what the run was drawn with, if it was simulated.
    """

    recording: Recording
    truth: InertialParameters
    label: str = "run"
    tare: Recording | None = None
    seed: int | None = None


def compare(
    identifiers: Mapping[str, Method],
    runs: Sequence[EvaluationRun],
    times: ArrayLike | None = None,
    *,
    training: GaussianPrior | Iterable[InertialParameters] | None = None,
    split: str = "not stated",
    progress: Callable[[str], None] | None = None,
) -> Comparison:
    """Feed the same runs through every method and collect the estimates over time.

    Two baselines are always among the rows (`evaluation.baselines`), made from `training` unless `identifiers` holds
    them: the mean of the training payloads, and least squares with them as prior.

    A run's tare reaches a method that is given as a function (recording or None → identifier), such as
    `lambda tare: PosteriorLeastSquares(arm, tare)`. For a method given as an identifier, its own estimate of the tare
    is subtracted (`Tared`) and the covariances add.

    Args:
        identifiers: methods by name, in the order of the rows.
        runs: the recordings with their truths.
        times: (T,) since the start of each recording [s] at which estimates are compared; what counts is the
            nearest estimate, at most half the finest step (or 1/16 s) away. Default: 49 even ones up to
            the shortest duration.
        training: the payloads that the learned methods were trained on, or the prior made of them; None, where
            nothing was trained: nothing held, within half the rated payload.
        split: what was held out from training, in words; stands in every table.
        progress: called with a few words on what is being done.

    Raises:
        IdentificationError: nothing to compare, times that no recording has, a truth about another frame, or what is no
            method.
        InertiaError: a truth that is no `InertialParameters`, such as a whole payload.
        ArmloadError: what a method says when it refuses a recording.
    """
    if not isinstance(identifiers, Mapping):
        raise IdentificationError(f"the methods are {identifiers!r}: expected them by name, such as {{'mine': method}}")
    if not identifiers or not runs:
        raise IdentificationError("nothing to compare: expected at least one method and one run")
    shortest = min(run.recording.duration for run in runs)
    times = np.linspace(0.0, shortest, _POINTS) if times is None else np.unique(np.asarray(times, dtype=float))
    if times.ndim != 1 or times.size == 0 or not (times[0] >= 0.0 and times[-1] <= shortest + 1e-9):
        raise IdentificationError(
            f"the times asked for do not lie in the recordings: expected seconds from 0 to {shortest:.3f}"
        )
    arm = _arm(identifiers, runs)
    for run in runs:
        if parameters_only(run.truth).frame not in (None, arm.frame):
            raise IdentificationError(
                f"the truth of {run.label!r} is about {run.truth.frame!r}, the estimates about {arm.frame!r}: "
                "move it with arm.in_frame(truth)"
            )
    prior = _prior(arm, training)
    methods, baselines = _with_baselines(identifiers, arm, prior)
    shape = (len(methods), len(runs), len(times), 10)
    phi, std = np.empty(shape), np.empty(shape)
    samples, wall = np.empty(shape[:3], dtype=int), np.empty(shape[:2])
    averaged = set()
    for m, (name, method) in enumerate(methods.items()):
        for r, run in enumerate(runs):
            if progress is not None:
                progress(f"{name}: {run.label}")
            identifier = _prepare(name, method, run.tare)
            if _is_average(method if isinstance(method, Identifier) else identifier):
                averaged.add(name)
            _warm_up(identifier, run.recording)
            started = time.perf_counter()
            estimates = _at(identifier, run.recording, times)
            wall[m, r] = time.perf_counter() - started
            phi[m, r] = [e.phi for e in estimates]
            std[m, r] = [e.std for e in estimates]
            samples[m, r] = [e.n_samples for e in estimates]
    seeds = tuple(sorted({run.seed for run in runs if run.seed is not None}))
    return Comparison(
        methods=tuple(methods),
        baselines=baselines,
        averaged=tuple(name for name in methods if name in averaged),
        labels=tuple(run.label for run in runs),
        times=times,
        truth=np.array([run.truth.phi for run in runs]),
        phi=phi,
        std=std,
        samples=samples,
        wall=wall,
        lengths=np.array([len(run.recording) for run in runs]),
        robot=arm.name,
        frame=str(arm.frame),
        split=split,
        seeds=seeds,
        prior=prior.source,
    )


def catalogued(arm: Arm, *names: str) -> dict[str, Method]:
    """Methods of the catalogue by name: NAME ignores a run's tare, `NAME, with tare` uses it as the method does.

    Raises:
        IdentificationError: no method is called so.
    """

    def one(name: str) -> Method:
        method = METHODS.get(name.removesuffix(WITH_TARE))
        if method is None:
            raise IdentificationError(
                f"unknown method {name!r}: expected one of {', '.join(METHODS)}, or one{WITH_TARE}"
            )
        return partial(method.make, arm) if name.endswith(WITH_TARE) else lambda _: method.make(arm)

    return {name: one(name) for name in names}


def _arm(identifiers: Mapping[str, Method], runs: Sequence[EvaluationRun]) -> Arm:
    found = [
        (method if isinstance(method, Identifier) else _prepare(name, method, runs[0].tare)).arm
        for name, method in identifiers.items()
    ]
    if any((a.name, a.frame) != (found[0].name, found[0].frame) for a in found):
        raise IdentificationError("the methods are not all of the same arm and frame: their errors cannot be compared")
    return found[0]


def _prior(arm: Arm, training: GaussianPrior | Iterable[InertialParameters] | None) -> GaussianPrior:
    if training is None:
        return GaussianPrior.weak(arm)
    return training if isinstance(training, GaussianPrior) else GaussianPrior.of(training)


def _with_baselines(
    identifiers: Mapping[str, Method], arm: Arm, prior: GaussianPrior
) -> tuple[dict[str, Method], tuple[str, ...]]:
    """All methods, the two baselines last, and the names of the baselines."""
    given = {name for name, m in identifiers.items() if isinstance(m, TrainingMean | PriorLeastSquares)}
    methods = {name: m for name, m in identifiers.items() if name not in given}
    own = {
        TrainingMean: lambda _: TrainingMean(arm, prior.mean, prior.covariance),
        PriorLeastSquares: lambda tare: PriorLeastSquares(arm, prior.mean, prior.covariance, tare),
    }
    baselines = []
    for kind, make in own.items():
        there = [name for name in given if isinstance(identifiers[name], kind)]
        for name in there:
            methods[name] = identifiers[name]
        if not there:
            if kind.name in methods:
                raise IdentificationError(f"{kind.name!r} is the name of a baseline: call the method something else")
            methods[kind.name] = make
        baselines += there or [kind.name]
    return methods, tuple(baselines)


def _prepare(name: str, method: Method, tare: Recording | None) -> Identifier:
    """The identifier for a run, made to take account of the run's tare."""
    if isinstance(method, Identifier):
        return method if tare is None or isinstance(method, TrainingMean) else Tared(method, tare)
    made = None if isinstance(method, type) or not callable(method) else method(tare)
    if not isinstance(made, Identifier):
        raise IdentificationError(
            f"the method {name!r} is {method!r}: expected an Identifier, such as RecursiveLeastSquares(arm), or a "
            "function that makes one of a run's tare, such as lambda tare: HybridIdentifier(arm, tare)"
        )
    return made


def _warm_up(identifier: Identifier, recording: Recording) -> None:
    """Two samples, so that nothing is compiled while the clock runs; the trace starts with a reset."""
    identifier.reset()
    for _, sample in zip(range(2), recording, strict=False):
        identifier.update(sample)


def _at(identifier: Identifier, recording: Recording, times: NDArray) -> list[Estimate]:
    """The estimate nearest to each time, from one pass over the recording."""
    steps = np.diff(np.unique([0.0, *times]))
    even = len(steps) > 0 and np.allclose(steps, steps[0])
    rate = (len(recording) - 1) / recording.duration
    every = max(1, round((steps[0] if even else min([*steps, _STEP])) * rate))
    estimates = identifier.trace(recording, every)
    last = len(recording) - 1
    rows = [*range(0, last, every), last]
    if len(estimates) != len(rows):
        raise IdentificationError(
            f"{identifier.name} gave {len(estimates)} estimates where {len(rows)} were asked for: expected one of each"
        )
    t = recording.t[rows] - recording.t[0]
    return [estimates[int(np.argmin(np.abs(t - wanted)))] for wanted in times]


def _is_average(identifier: Identifier) -> bool:
    from armload.ensembles import LearnedIdentifier

    return isinstance(identifier, LearnedIdentifier) and not identifier.single
