"""The answer to "what does the arm hold", as it is printed and as `armload identify --json` gives it."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.estimators import Estimate
from armload.identification import text
from armload.identification.arm_health import ArmHealth
from armload.inertia import HELD, NAMES, InertialParameters, nearest_body
from armload.runtime.version import __version__

_ARRAYS = {
    "phi": (10,),
    "phi_low": (10,),
    "phi_high": (10,),
    "determined": (10,),
    "com": (3,),
    "inertia_com": (3, 3),
    "com_low": (3,),
    "com_high": (3,),
    "inertia_com_low": (3, 3),
    "inertia_com_high": (3, 3),
    "covariance": (10, 10),
    "rests_on_prior": (10,),
}


def is_removal(estimate: Estimate, mass_determined: bool) -> bool:
    """Whether something was taken off, beyond doubt: then no body has these parameters, and none is looked for."""
    return bool(mass_determined and estimate.phi[0] < -HELD * estimate.std[0])


def body_of(estimate: Estimate, mass_determined: bool, exchanged: bool = False) -> NDArray[np.float64]:
    """phi (10,) of the likeliest body in the estimate's metric; the estimate's own where something was taken off.

    exchanged: something else was put on, too.
    """
    if exchanged or is_removal(estimate, mass_determined):
        return estimate.phi
    return nearest_body(estimate.phi, estimate.covariance)


_OF_A_SEGMENT = ("mass", "com", "phi", "phi_low", "phi_high", "determined", "held", "interval")


@dataclass(frozen=True)
class Segment:
    """A part of a log: from start to stop [s] since the log began, and what the arm held meanwhile."""

    start: float
    stop: float
    answer: Identification

    def to_dict(self) -> dict[str, Any]:
        """start, stop, and the answer's main fields, ready for JSON."""
        answer = self.answer.to_dict()
        return {"start": self.start, "stop": self.stop} | {name: answer[name] for name in _OF_A_SEGMENT}


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """What the arm holds, with 95 % intervals; the fields are those of `armload identify --json`.

    method: the method's name; robot, frame: whose payload, about which frame's origin and axes.
    relative_to: "arm" (the bare arm), "tool" (what `--tool` describes, or a description with a hand), "tare" or
        "profile" (what was mounted at the tare, or in the profile's logs).
    n_samples, duration: samples used and the time they span [s].
    phi, phi_low, phi_high: ten parameters (10,) in the paper's order, and their 95 % interval.
    interval: "calibrated" or "approximate"; what is in doubt is never called calibrated.
    determined: for each parameter (10,), whether the log itself says more than was known before.
    mass, com, inertia_com: the same payload about its centre of mass [kg], (3,) [m], (3, 3) [kg·m²], in the frame's
        axes; of a mass of exactly 0 the centre is the origin.
    consistent: whether a body with these parameters can exist.
    held: whether anything is there at all (the mass lies at least three standard deviations above zero).
    com_low, com_high, inertia_com_low, inertia_com_high: their 95 % intervals. Where the mass may be zero, that of the
        centre is a stated bound of 1 m about the origin, and the inertia's what a body can have.
    covariance: (10, 10) of phi: ±1.96 standard deviations are the intervals of phi where they are symmetric, and as
        wide as they are where they are not.
    rests_on_prior: for each parameter (10,), whether its interval comes from what was known before more than from the
        log; always so of what is not determined.
    torque_gain_std: relative standard deviation of the torque's scale that the intervals allow for: assumed on the
        arm's sheet, or as a known weight showed it (`armload profile --mass`); None: the method knows nothing of it.
    same_arm_assumed: whether it is taken for granted that tare or profile are of this arm, as nothing tells where
        friction of gears is in the torque.
    notes: what else the user should know, a sentence each.
    segments: the log's parts, throughout each of which the payload is the same, with their answers; one where it never
        changes. All else is of the last.
    log, date: name of the log's file, and when it was answered (ISO 8601, UTC).
    why: what is special about the method, in a few words; not in the JSON.
    kappa: by how much the physics overrates this log's evidence, of a method that knows; not in the JSON.
    moves: whether no rigid body explains the torques; not in the JSON. another: whether the arm is another one than at
        its tare, or than the profile's; not in the JSON.
    health: the arm itself, as the log shows it, of a method that asks; not in the JSON.
    gravity: (3,) [m/s²] with which it was found, where that is not what was given; not in the JSON.
    doubts: how much speaks against the answer; not in the JSON.
    gain_known: whether a known weight fixed the torque's scale; not in the JSON.
    """

    method: str
    robot: str
    frame: str
    relative_to: str
    n_samples: int
    duration: float
    phi: NDArray[np.float64]
    phi_low: NDArray[np.float64]
    phi_high: NDArray[np.float64]
    interval: str
    determined: NDArray[np.bool_]
    mass: float
    com: NDArray[np.float64]
    inertia_com: NDArray[np.float64]
    consistent: bool
    held: bool
    com_low: NDArray[np.float64]
    com_high: NDArray[np.float64]
    inertia_com_low: NDArray[np.float64]
    inertia_com_high: NDArray[np.float64]
    covariance: NDArray[np.float64]
    rests_on_prior: NDArray[np.bool_]
    torque_gain_std: float | None = None
    same_arm_assumed: bool = False
    notes: tuple[str, ...] = ()
    segments: tuple[Segment, ...] = field(default=(), metadata={"json": False})
    log: str = ""
    date: str = ""
    why: str = field(default="", metadata={"json": False})
    kappa: float | None = field(default=None, metadata={"json": False})
    moves: bool = field(default=False, metadata={"json": False})
    another: bool = field(default=False, metadata={"json": False})
    health: ArmHealth | None = field(default=None, metadata={"json": False})
    gain_known: bool = field(default=False, metadata={"json": False})
    gravity: tuple[float, float, float] | None = field(default=None, metadata={"json": False})
    doubts: int = field(default=0, metadata={"json": False})

    def __post_init__(self) -> None:
        for name, shape in _ARRAYS.items():
            flags = name in ("determined", "rests_on_prior")
            value = np.array(getattr(self, name), dtype=bool if flags else float).reshape(shape)
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def to_dict(self) -> dict[str, Any]:
        """The contract's fields, ready for JSON; every number is finite."""
        out: dict[str, Any] = {}
        for entry in fields(self):
            if entry.metadata.get("json", True):
                value = getattr(self, entry.name)
                out[entry.name] = value.tolist() if isinstance(value, np.ndarray) else value
        about = {"notes": list(self.notes), "parameters": list(NAMES), "version": __version__}
        return out | about | {"segments": [segment.to_dict() for segment in self.segments]}

    @property
    def parameters(self) -> InertialParameters:
        """phi with its frame, ready to move, add, subtract or reorder."""
        return InertialParameters(self.phi, self.frame)

    @property
    def why_not_held(self) -> str:
        """Why `held` is false, in a sentence; "" where it is true."""
        if self.held:
            return ""
        far = self.phi[0] > HELD * np.sqrt(self.covariance[0, 0])  # as it was weighed: only the log tells what is held
        if not self.determined[0] or far:
            return "the log does not tell whether anything is held"
        if self.phi_high[0] < 0:
            return "nothing is held: the mass is below zero"
        return "nothing seems to be held: the mass is within three standard deviations of zero"

    def __str__(self) -> str:
        return text.summary(self)

    def __repr__(self) -> str:
        return f"<Identification: {text.in_short(self)}>"

    def _repr_html_(self) -> str:
        return text.html(self)
