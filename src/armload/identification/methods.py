"""The catalogue: every way armload has of identifying a payload.

    METHODS["rls"].make(arm, tare)      # an Identifier, whatever the method

`armload methods` prints it, `identify(method=...)` takes its names, docs/methods.md shows it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.estimators import (
    ConsistentLeastSquares,
    DifferenceLeastSquares,
    ExtendedKalmanFilter,
    FilteredRecursiveLeastSquares,
    Identifier,
    JointLeastSquares,
    LogCholeskyLeastSquares,
    MomentumLeastSquares,
    OrdinaryLeastSquares,
    PolynomialLeastSquares,
    RecursiveLeastSquares,
    RecursiveTotalLeastSquares,
    Tared,
    WeightedLeastSquares,
)
from armload.posterior import PosteriorLeastSquares, Profile, SmoothPosteriorLeastSquares
from armload.recording import Recording
from armload.regression import JointFeatures

TARES = ("own equation", "virtual calibration", "same motion", "none")
NEEDS = ("", "tare", "training", "motion")


@dataclass(frozen=True)
class Method:
    """One estimator of the catalogue.

    name: what tables and the command line call it. title: what it is, in a few words. when: when to use it.
    source: primary literature.
    tare: what it makes of a tare: "own equation" (a log of any motion enters its equations), "virtual calibration"
        (what it says of the tare is subtracted, `Tared`), "same motion" (a tare along the run's own motion), "none".
    prior: whether it starts from a prior on the payload.
    needs: what it cannot work without, beside a log: "", "tare", "training" (a trained model's file) or "motion" (the
        commanded motion).
    build: makes the identifier; call `make`. profile: whether it can use a profile of the arm.
    """

    name: str
    title: str
    when: str
    source: str
    tare: str
    prior: bool
    build: Callable[..., Identifier] = field(repr=False)
    needs: str = ""
    profile: bool = False

    def __post_init__(self) -> None:
        if self.tare not in TARES or self.needs not in NEEDS:
            raise IdentificationError(
                f"{self.name}: tare {self.tare!r} and needs {self.needs!r}: expected {TARES} and {NEEDS}"
            )

    def make(
        self,
        arm: Arm,
        tare: Recording | None = None,
        profile: Profile | None = None,
        features: JointFeatures | None = None,
    ) -> Identifier:
        """The method for an arm, relative to a tare or a profile where one is given.

        features: of the arm's smooth mismatch, of a method that can use a profile; others have none.

        Raises:
            IdentificationError: it needs what was not given, or cannot use the tare or profile that was.
        """
        if profile is not None and not self.profile:
            able = ", ".join(method.name for method in _CATALOGUE if method.profile)
            raise IdentificationError(
                f"the method {self.name} cannot use a profile: leave --profile out, or use one of {able}"
            )
        if self.needs == "tare" and tare is None:
            raise IdentificationError(
                f"the method {self.name} needs a tare and none was given: record an earlier log of the same arm"
                + (" on the same motion" if self.tare == "same motion" else "")
                + " and name it (--tare), or use the method map"
            )
        if tare is not None and self.tare == "none":
            raise IdentificationError(
                f"the method {self.name} cannot use a tare: leave the tare out, or use the method map"
            )
        more: dict[str, Any] = {} if profile is None else {"profile": profile}
        if features is not None and self.profile:
            more["features"] = features
        return self.build(arm, tare, **more)


def calibrated(kind: Callable[[Arm], Identifier]) -> Callable[[Arm, Recording | None], Identifier]:
    """Builds a method that knows nothing of tares; with one, its virtual calibration is subtracted."""
    return lambda arm, tare: kind(arm) if tare is None else Tared(kind(arm), tare)


def _trained(name: str) -> Callable[[Arm, Recording | None], Identifier]:
    def refuse(*_: object) -> Identifier:
        raise IdentificationError(
            f"the method {name} is a trained model: name its file instead, as `armload train --kind {name}` wrote it"
        )

    return refuse


def _hybrid(
    arm: Arm, tare: Recording | None, profile: Profile | None = None, features: JointFeatures | None = None
) -> Identifier:
    from armload.posterior import HybridIdentifier

    return HybridIdentifier(arm, tare, profile=profile, features=features)


def _commanded(*_: object) -> Identifier:
    raise IdentificationError(
        "the method commanded needs the motion that was commanded, which a log does not hold: in Python, "
        "CommandedLeastSquares(arm, motion); from a log alone use polynomial"
    )


# In the order of recommendation. A new estimator gets its row here, and nothing else but its own module and tests.
_CATALOGUE = (
    Method(
        "hybrid",
        "map-gp with a learned payload prior and calibrated intervals",
        "any motion, any payload, with or without a tare, on an arm with a trained model: the default there",
        "this project; Rahimi & Recht, NIPS 2007; Lei et al., JASA 2018; Breiman, Machine Learning 1996",
        tare="own equation",
        prior=True,
        build=_hybrid,
        profile=True,
    ),
    Method(
        "map-gp",
        "MAP least squares with the arm's rigid and its smooth mismatch as unknowns",
        "any motion, any payload, any arm, with or without a tare: the default where no hybrid is trained",
        "Khalil, Gautier & Lemoine, ICRA 2007; Rahimi & Recht, NIPS 2007; Bishop 2006, ch. 3 and 9",
        tare="own equation",
        prior=True,
        build=SmoothPosteriorLeastSquares,
        profile=True,
    ),
    Method(
        "map",
        "MAP least squares with only the arm's rigid mismatch as an unknown",
        "as map-gp at a third of its cost, with wider and less accurate intervals",
        "Khalil, Gautier & Lemoine, ICRA 2007; Bishop 2006, ch. 3",
        tare="own equation",
        prior=True,
        build=PosteriorLeastSquares,
    ),
    Method(
        "difference",
        "torque difference with a tare along the same motion, on the filtered regression",
        "a motion also run without the payload, without any prior (the default takes the same difference by itself)",
        "Atkeson, An & Hollerbach, IJRR 1986; Hsu et al., ICRA 1987",
        tare="same motion",
        prior=False,
        build=DifferenceLeastSquares,
        needs="tare",
    ),
    Method(
        "joint",
        "joint identification of arm and payload: all base parameters, without priors",
        "an arm whose description cannot be trusted at all, with a long tare that moves every joint widely",
        "Khalil, Gautier & Lemoine, ICRA 2007; Gautier, J. Robotic Systems 1991",
        tare="own equation",
        prior=False,
        build=JointLeastSquares,
        needs="tare",
    ),
    Method(
        "log-cholesky",
        "weighted least squares in log-Cholesky coordinates, always physically consistent",
        "a physically consistent answer without a prior, with intervals that respect the consistency",
        "Rucker & Wensing, RA-L 2022",
        tare="virtual calibration",
        prior=False,
        build=LogCholeskyLeastSquares,
    ),
    Method(
        "lmi",
        "weighted least squares subject to physical consistency, a semidefinite program",
        "as log-cholesky, but with a global optimum, or regularised towards a reference body (Python)",
        "Sousa & Cortesão, IJRR 2014; Wensing, Kim & Slotine, RA-L 2018; Lee, Wensing & Park, T-RO 2020",
        tare="virtual calibration",
        prior=False,
        build=ConsistentLeastSquares,
    ),
    Method(
        "wls",
        "weighted least squares on the acceleration-free filtered regression",
        "a plain estimate without any prior, on an arm whose joints fit the model differently well",
        "Gautier & Poignet, Control Engineering Practice 2001; Hsu et al., ICRA 1987",
        tare="virtual calibration",
        prior=False,
        build=calibrated(WeightedLeastSquares),
    ),
    Method(
        "ols",
        "ordinary least squares on the same rows",
        "exact for an exact arm and the easiest to understand: the reference for all other methods",
        "Atkeson, An & Hollerbach, IJRR 1986; Hsu et al., ICRA 1987",
        tare="virtual calibration",
        prior=False,
        build=calibrated(OrdinaryLeastSquares),
    ),
    Method(
        "momentum",
        "least squares on the change of momentum over windows of 0.1 s",
        "as ols, without a filter between sensor and estimate",
        "De Luca et al., IROS 2006; Gautier, ICRA 1997",
        tare="virtual calibration",
        prior=False,
        build=calibrated(MomentumLeastSquares),
    ),
    Method(
        "polynomial",
        "least squares with the acceleration of a local polynomial in the measured positions",
        "logs with poor velocity: only positions and torque are used; replaces commanded on a log",
        "Savitzky & Golay, Analytical Chemistry 1964; Atkeson, An & Hollerbach, IJRR 1986",
        tare="virtual calibration",
        prior=False,
        build=calibrated(PolynomialLeastSquares),
    ),
    Method(
        "commanded",
        "least squares with the commanded acceleration of the known trajectory",
        "you know the motion at every sample, and the controller tracks it well",
        "Atkeson, An & Hollerbach, IJRR 1986; Swevers et al., IEEE TRA 1997",
        tare="virtual calibration",
        prior=False,
        build=_commanded,
        needs="motion",
    ),
    Method(
        "ekf",
        "extended Kalman filter on the forward dynamics: joint state, payload and friction",
        "you also want a filtered joint state, at a few hundred hertz; torque on the link side",
        "Bucy & Joseph 1968; Bell & Cathey, IEEE TAC 1993; Gautier & Poignet, Control Engineering Practice 2001",
        tare="virtual calibration",
        prior=True,
        build=calibrated(ExtendedKalmanFilter),
    ),
    Method(
        "rls-filter",
        "recursive least squares behind a momentum observer, signals lagged alike",
        "to compare with published results (the benchmark of the paper); best with a tare",
        "Kurdas et al., ICRA 2022",
        tare="virtual calibration",
        prior=False,
        build=calibrated(FilteredRecursiveLeastSquares),
    ),
    Method(
        "rtls",
        "recursive total least squares: errors in the regressor are modelled",
        "differentiated velocity without a filter: as rls, without the bias from its noisy acceleration",
        "Kubus, Kröger & Wahl, IROS 2008; Golub & Van Loan, SIAM J. Numer. Anal. 1980",
        tare="virtual calibration",
        prior=False,
        build=calibrated(RecursiveTotalLeastSquares),
    ),
    Method(
        "rls",
        "recursive least squares on differentiated velocity",
        "the plain benchmark: for logs with little noise, or to see the effect of noise",
        "Atkeson, An & Hollerbach, IJRR 1986",
        tare="virtual calibration",
        prior=False,
        build=calibrated(RecursiveLeastSquares),
    ),
    Method(
        "tree",
        "bagged decision trees of the paper",
        "one arm, one motion and one family of payloads, all known at training; answers from the first sample",
        "Taie et al., RA-L 2024; Breiman 1996",
        tare="none",
        prior=True,
        build=_trained("tree"),
        needs="training",
    ),
    Method(
        "network",
        "bagged neural networks of the paper",
        "as tree, but smoother between the training payloads and slower to train",
        "Taie et al., RA-L 2024; Breiman 1996",
        tare="none",
        prior=True,
        build=_trained("network"),
        needs="training",
    ),
    Method(
        "mixed",
        "trees and networks in one bag, the paper's future work",
        "as tree, to average both kinds",
        "Taie et al., RA-L 2024, section VI",
        tare="none",
        prior=True,
        build=_trained("mixed"),
        needs="training",
    ),
)
# The catalogue: every method by its name, in the order of recommendation.
METHODS: dict[str, Method] = {method.name: method for method in _CATALOGUE}
