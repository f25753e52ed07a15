"""The catalogue: every way armload has of identifying a payload, and what of the related work it leaves out.

    METHODS["rls"].make(arm, tare)      # an Identifier, whatever the method

`armload methods` prints it, `identify(method=...)` takes its names, docs/methods.md shows it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from armload.arms import Arm
from armload.errors import IdentificationError, ModelError
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
from armload.posterior import PosteriorLeastSquares, SmoothPosteriorLeastSquares
from armload.recording import Recording

TARES = ("own equation", "virtual calibration", "same motion", "none")
NEEDS = ("", "tare", "training", "motion")


@dataclass(frozen=True)
class Method:
    """One estimator of the catalogue.

    name: what tables and the command line call it. title: what it is, in a few words. when: when to use it.
    source: primary literature.
    tare: what it makes of a tare: "own equation" (a log of any motion enters its equations), "virtual calibration"
        (what it says of the tare is subtracted, `Tared`), "same motion" (a tare along the run's own motion), "none".
    prior: whether it starts from a prior on the payload; "determined" then asks how far the log has narrowed it.
    needs: what it cannot work without, beside a log: "", "tare", "training" (a trained model's file) or "motion" (the
        commanded motion).
    build: makes the identifier; call `make`.
    """

    name: str
    title: str
    when: str
    source: str
    tare: str
    prior: bool
    build: Callable[[Arm, Recording | None], Identifier] = field(repr=False)
    needs: str = ""

    def __post_init__(self) -> None:
        if self.tare not in TARES or self.needs not in NEEDS:
            raise ValueError(f"{self.name}: tare {self.tare!r} and needs {self.needs!r}: expected {TARES} and {NEEDS}")

    def make(self, arm: Arm, tare: Recording | None = None) -> Identifier:
        """The method for an arm, relative to a tare where one is given.

        Raises:
            IdentificationError: it needs what was not given, or cannot use the tare that was.
        """
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
        return self.build(arm, tare)


def calibrated(kind: Callable[[Arm], Identifier]) -> Callable[[Arm, Recording | None], Identifier]:
    """Builds a method that knows nothing of tares; with one, its virtual calibration is subtracted."""
    return lambda arm, tare: kind(arm) if tare is None else Tared(kind(arm), tare)


def _with_tare(kind: Callable[[Arm, Recording], Identifier]) -> Callable[[Arm, Recording | None], Identifier]:
    def build(arm: Arm, tare: Recording | None) -> Identifier:
        assert tare is not None  # `Method.make` has asked for it
        return kind(arm, tare)

    return build


def _trained(name: str) -> Callable[[Arm, Recording | None], Identifier]:
    def refuse(*_: object) -> Identifier:
        raise IdentificationError(
            f"the method {name} is a trained model: name its file instead, as `armload train --kind {name}` wrote it"
        )

    return refuse


def _hybrid(arm: Arm, tare: Recording | None) -> Identifier:
    from armload.posterior import HybridIdentifier

    return HybridIdentifier(arm, tare)


def _commanded(*_: object) -> Identifier:
    raise IdentificationError(
        "the method commanded needs the motion the controller was told, which a log does not hold: in Python, "
        "CommandedLeastSquares(arm, motion); from a log alone use polynomial"
    )


# In the order of recommendation. A new estimator gets its row here, and nothing else but its own module and tests.
_CATALOGUE = (
    Method(
        "hybrid",
        "map-gp with a learned payload prior and learned error bars",
        "any motion, any payload, with or without a tare, on an arm with a trained model: the default there",
        "this project; Rahimi & Recht, NIPS 2007; Lei et al., JASA 2018; Breiman, Machine Learning 1996",
        tare="own equation",
        prior=True,
        build=_hybrid,
    ),
    Method(
        "map-gp",
        "MAP least squares with the arm's rigid and its smooth mismatch as unknowns",
        "any motion, any payload, any arm, with or without a tare: the default where no hybrid is trained",
        "Khalil, Gautier & Lemoine, ICRA 2007; Rahimi & Recht, NIPS 2007; Bishop 2006, ch. 3 and 9",
        tare="own equation",
        prior=True,
        build=SmoothPosteriorLeastSquares,
    ),
    Method(
        "map",
        "MAP least squares with the arm's rigid mismatch alone as an unknown",
        "as map-gp at a third of its cost, with wider and rougher error bars",
        "Khalil, Gautier & Lemoine, ICRA 2007; Bishop 2006, ch. 3",
        tare="own equation",
        prior=True,
        build=PosteriorLeastSquares,
    ),
    Method(
        "difference",
        "torque difference with a tare along the same motion, on the filtered regression",
        "a repeated motion that was also run without the payload: then the most accurate of all",
        "Atkeson, An & Hollerbach, IJRR 1986; Hsu et al., ICRA 1987",
        tare="same motion",
        prior=False,
        build=_with_tare(DifferenceLeastSquares),
        needs="tare",
    ),
    Method(
        "joint",
        "joint identification of arm and payload: all base parameters, without priors",
        "an arm whose description cannot be trusted at all, with a long tare that moves every joint widely",
        "Khalil, Gautier & Lemoine, ICRA 2007; Gautier, J. Robotic Systems 1991",
        tare="own equation",
        prior=False,
        build=_with_tare(JointLeastSquares),
        needs="tare",
    ),
    Method(
        "log-cholesky",
        "weighted least squares in a chart of the bodies that can exist",
        "a body is wanted without a prior, with error bars that know its inertia cannot be negative",
        "Rucker & Wensing, RA-L 2022",
        tare="virtual calibration",
        prior=False,
        build=LogCholeskyLeastSquares,
    ),
    Method(
        "lmi",
        "weighted least squares subject to physical consistency, a semidefinite program",
        "as log-cholesky, where the optimum must be the global one, or a reference body shall pull (Python)",
        "Sousa & Cortesão, IJRR 2014; Wensing, Kim & Slotine, RA-L 2018; Lee, Wensing & Park, T-RO 2020",
        tare="virtual calibration",
        prior=False,
        build=ConsistentLeastSquares,
    ),
    Method(
        "wls",
        "weighted least squares on the acceleration-free filtered regression",
        "a plain estimate without any prior, on an arm whose joints differ in how well their torque fits the model",
        "Gautier & Poignet, Control Engineering Practice 2001; Hsu et al., ICRA 1987",
        tare="virtual calibration",
        prior=False,
        build=calibrated(WeightedLeastSquares),
    ),
    Method(
        "ols",
        "ordinary least squares on the same rows",
        "exact for an exact arm and the easiest to reason about: the yardstick of every other row",
        "Atkeson, An & Hollerbach, IJRR 1986; Hsu et al., ICRA 1987",
        tare="virtual calibration",
        prior=False,
        build=calibrated(OrdinaryLeastSquares),
    ),
    Method(
        "momentum",
        "least squares on the change of momentum over windows of 0.1 s",
        "as ols, where no filter may stand between sensor and estimate",
        "De Luca et al., IROS 2006; Gautier, ICRA 1997",
        tare="virtual calibration",
        prior=False,
        build=calibrated(MomentumLeastSquares),
    ),
    Method(
        "polynomial",
        "least squares with the acceleration of a local polynomial in the measured positions",
        "logs whose velocity is poor or missing its scale: only positions and torque enter; stands in for commanded",
        "Savitzky & Golay, Analytical Chemistry 1964; Atkeson, An & Hollerbach, IJRR 1986",
        tare="virtual calibration",
        prior=False,
        build=calibrated(PolynomialLeastSquares),
    ),
    Method(
        "commanded",
        "least squares with the commanded acceleration of the known trajectory",
        "you know the motion to the sample and the controller tracks it well",
        "Atkeson, An & Hollerbach, IJRR 1986; Swevers et al., IEEE TRA 1997",
        tare="virtual calibration",
        prior=False,
        build=_commanded,
        needs="motion",
    ),
    Method(
        "ekf",
        "extended Kalman filter on the forward dynamics: joint state, payload and friction",
        "a filtered joint state is wanted as well, at a few hundred hertz; torque on the link side",
        "Bucy & Joseph 1968; Bell & Cathey, IEEE TAC 1993; Gautier & Poignet, Control Engineering Practice 2001",
        tare="virtual calibration",
        prior=True,
        build=calibrated(ExtendedKalmanFilter),
    ),
    Method(
        "rls-filter",
        "recursive least squares behind a momentum observer, signals lagged alike",
        "the benchmark of the paper: to compare with published results, best with a tare",
        "Kurdas et al., ICRA 2022",
        tare="virtual calibration",
        prior=False,
        build=calibrated(FilteredRecursiveLeastSquares),
    ),
    Method(
        "rtls",
        "recursive total least squares: the regressor's errors are allowed for",
        "differentiated velocity and no filter: what rls would give if its acceleration were not noisy",
        "Kubus, Kröger & Wahl, IROS 2008; Golub & Van Loan, SIAM J. Numer. Anal. 1980",
        tare="virtual calibration",
        prior=False,
        build=calibrated(RecursiveTotalLeastSquares),
    ),
    Method(
        "rls",
        "recursive least squares on differentiated velocity",
        "the plain benchmark: where logs are nearly free of noise, or to see what noise costs",
        "Atkeson, An & Hollerbach, IJRR 1986",
        tare="virtual calibration",
        prior=False,
        build=calibrated(RecursiveLeastSquares),
    ),
    Method(
        "tree",
        "bagged decision trees of the paper",
        "one arm, one motion, one family of payloads, all known when it is trained; an answer from the first sample",
        "Taie et al., RA-L 2024; Breiman 1996",
        tare="none",
        prior=True,
        build=_trained("tree"),
        needs="training",
    ),
    Method(
        "network",
        "bagged neural networks of the paper",
        "as tree, smoother between the payloads it was trained on, slower to train",
        "Taie et al., RA-L 2024; Breiman 1996",
        tare="none",
        prior=True,
        build=_trained("network"),
        needs="training",
    ),
    Method(
        "mixed",
        "trees and networks in one bag, the paper's future work",
        "as tree, where neither kind alone is trusted",
        "Taie et al., RA-L 2024, section VI",
        tare="none",
        prior=True,
        build=_trained("mixed"),
        needs="training",
    ),
)
METHODS: dict[str, Method] = {method.name: method for method in _CATALOGUE}
DEFAULT = "hybrid"
_ELSEWHERE = "map-gp"


def default_for(arm: Arm) -> str:
    """The name of the most trustworthy method for an arm: the hybrid where one is shipped, map-gp elsewhere."""
    from armload.posterior import HybridModel

    shipped = HybridModel.shipped(arm)
    if shipped is None:
        return _ELSEWHERE
    try:
        HybridModel.load(shipped).prior_for(arm)
    except ModelError:  # an arm of that name with other links
        return _ELSEWHERE
    return DEFAULT


# What the paper's related work names (its reference numbers) and armload does not build, with the reason.
LEFT_OUT: dict[str, str] = {
    "vision: geometry, colour or depth images [8]": "needs a camera and a density; a log of the joints holds neither",
    "exploration: pushing, poking, tilting an object [8]": (
        "needs contact experiments before the object is grasped, not a log of a grasped one"
    ),
    "vision and force/torque sensor together [9]": "needs both sensors",
    "wrist force/torque sensor with an IMU [15]": (
        "needs a sensor between flange and payload; where there is one, its wrench is the better measurement"
    ),
    "quaternion-based filtering [14]": (
        "estimates orientation and acceleration from an IMU; joint encoders know the orientation already"
    ),
    "chaotic sparrow search with Kent map, Student's t and Lévy flight [19]": (
        "a global search for a problem that is linear here and has its one optimum in closed form"
    ),
    "offline techniques of dynamic identification compared in [10]": (
        "that comparison finds only least squares and machine-learning regression fit to work online"
    ),
    "unsupervised classification of payload changes from torque [20]": (
        "tells that a payload changed, not its ten parameters; `held` answers that question"
    ),
}
