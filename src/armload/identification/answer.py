"""The answer to "what does the arm hold", as it is printed and as `armload identify --json` gives it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from armload.estimators import Estimate
from armload.inertia import HELD, NAMES, UNITS, InertialParameters, nearest_body


def is_removal(estimate: Estimate, mass_determined: bool) -> bool:
    """Whether something was taken off, beyond doubt: then no body has these parameters, and none is looked for."""
    return bool(mass_determined and estimate.phi[0] < -HELD * estimate.std[0])


def body_of(estimate: Estimate, mass_determined: bool) -> np.ndarray:
    """phi (10,) of the likeliest body in the estimate's metric; the estimate's own where something was taken off."""
    return estimate.phi if is_removal(estimate, mass_determined) else nearest_body(estimate.phi, estimate.covariance)


@dataclass(frozen=True, eq=False)
class Identification:
    """What the arm holds, with 95 % intervals; the fields are those of `armload identify --json`.

    method: the method's name; robot, frame: whose payload, about which frame's origin and axes.
    relative_to: "arm" (the bare arm), "tool" (what `--tool` describes) or "tare" (what was mounted at the tare).
    n_samples, duration: samples used and the time they span [s].
    phi, phi_low, phi_high: ten parameters in the paper's order, and their 95 % interval.
    interval: "calibrated" or "approximate".
    determined: for each parameter, whether the log itself says more than was known before.
    mass, com, inertia_com: the same payload about its centre of mass [kg, m, kg·m²], in the frame's axes.
    consistent: whether a body with these parameters can exist.
    held: whether anything is there at all (the mass lies at least three standard deviations above zero).
    why: why this method, in a sentence; notes: what else the user should know. Neither is in the JSON.
    """

    method: str
    robot: str
    frame: str
    relative_to: str
    n_samples: int
    duration: float
    phi: list[float]
    phi_low: list[float]
    phi_high: list[float]
    interval: str
    determined: list[bool]
    mass: float
    com: list[float]
    inertia_com: list[list[float]]
    consistent: bool
    held: bool
    why: str = field(default="", repr=False)
    notes: tuple[str, ...] = field(default=(), repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The contract's fields, ready for JSON; every number is finite."""
        out = asdict(self)
        del out["why"], out["notes"]
        return out

    @property
    def parameters(self) -> InertialParameters:
        """phi with its frame, ready to move, add, subtract or reorder."""
        return InertialParameters(np.array(self.phi), self.frame)

    @property
    def why_not_held(self) -> str:
        """Why `held` is false, in a sentence; "" where it is true."""
        if self.held:
            return ""
        if not self.determined[0]:
            return "the log does not tell whether anything is held"
        if self.phi_high[0] < 0:
            return "nothing is held: the mass is below zero"
        return "nothing seems to be held: the mass is within three standard deviations of zero"

    def __str__(self) -> str:
        lines = [
            f"{self.robot}: payload about {self.frame}, relative to the {self.relative_to}, "
            f"method {self.method}, {self.n_samples} samples, {self.duration:.2f} s"
        ]
        rows = zip(NAMES, self.phi, self.phi_low, self.phi_high, UNITS, self.determined, strict=True)
        for name, value, low, high, unit, known in rows:
            lines.append(
                f"{name:>5} = {value:+.5f} [{low:+.5f}, {high:+.5f}] {unit}" + ("" if known else "  undetermined")
            )
        com = ", ".join(f"{x:+.4f}" for x in self.com)
        lines.append(f" mass {self.mass:.4f} kg, centre of mass ({com}) m, intervals {self.interval}")
        if not self.held:
            lines.append(f" {self.why_not_held}")
        return "\n".join(lines)
