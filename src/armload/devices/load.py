"""A `Load`: a payload for a controller or a simulator, and which of its parameters were measured."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armload.devices import load_remarks as remarks_on
from armload.errors import SinkError
from armload.inertia import NAMES, InertialParameters, held, is_consistent, to_order

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.identification import Identification
    from armload.online import OnlineEstimate

_KNOWN = (True,) * 10
_NONE = 1e-6  # of a frame's turn and place: rounding
_RELATIVE = {"before": "empty arm before"}  # what reads otherwise than it is called
_MISFIT = 3.0  # standard deviations between what is left and the nearest body, beyond which too much was taken off


@dataclass(frozen=True, eq=False)
class Load:
    """A payload on its way to a controller or a simulator.

    What was measured, minus the hand it was measured with, is again a load:

    >>> from armload.payloads import franka_hand, test_payload
    >>> measured = Load(test_payload().parameters + franka_hand().parameters)
    >>> part = measured - franka_hand().parameters
    >>> round(part.parameters.mass, 3)
    1.48

    Args:
        parameters: phi about the origin and in the axes of its frame.
        determined: for each of the ten, whether it was measured; all of them for a payload that is known.
        robot: name of the arm it was identified on.
        relative_to: "arm" (everything on the flange), "tool", "tare" or "before" (what was added), None: not
            known.
        std: standard deviation of phi (10,), where it was measured; that of `covariance`, where there is one.
        remarks: what else its reader should know, a line each.
        covariance: (10, 10) of phi, where it was measured and more is known of its errors than how large each is.
    """

    parameters: InertialParameters
    determined: tuple[bool, ...] = field(default=_KNOWN, repr=False)
    robot: str | None = None
    relative_to: str | None = None
    std: NDArray[np.float64] | None = field(default=None, repr=False)
    remarks: tuple[str, ...] = field(default=(), repr=False)
    covariance: NDArray[np.float64] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        determined = tuple(bool(x) for x in self.determined)
        if len(determined) != 10:
            raise SinkError(f"determined has {len(determined)} entries: expected 10, one for each parameter")
        object.__setattr__(self, "determined", determined)
        if self.covariance is not None:
            object.__setattr__(self, "std", np.sqrt(np.diag(self.covariance)))

    @classmethod
    def of(cls, result: Load | Identification | OnlineEstimate, arm: Arm | None = None) -> Load:
        """The load that was identified, in a log or, on `arm`, on a live robot; a load is returned as it is."""
        from armload.online import OnlineEstimate

        if isinstance(result, Load):
            return result
        if isinstance(result, OnlineEstimate):
            known, robot = tuple(bool(x) for x in result.determined), None if arm is None else arm.name
            remarks = remarks_on.doubted(result.interval) + remarks_on.leaning(known, result.rests_on_prior.tolist())
            remarks += remarks_on.loose_of(result.parameters, result.covariance, known)
            return cls(result.parameters, known, robot, result.relative_to, None, remarks, result.covariance)
        known, resting = tuple(result.determined.tolist()), result.rests_on_prior.tolist()
        widths = np.diag(result.inertia_com_high - result.inertia_com_low)
        remarks = (
            remarks_on.doubted(result.interval)
            + remarks_on.of_a_part(result.segments)
            + remarks_on.leaning(known, resting)
        )
        remarks += remarks_on.loose(np.diag(result.inertia_com), widths, known)
        return cls(result.parameters, known, result.robot, result.relative_to, None, remarks, result.covariance)

    @property
    def frame(self) -> str | None:
        """The frame the parameters are about."""
        return self.parameters.frame

    @property
    def consistent(self) -> bool:
        """Whether a body with these parameters can exist."""
        return is_consistent(self.parameters.phi)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the parameters that were not measured."""
        return tuple(name for name, known in zip(NAMES, self.determined, strict=True) if not known)

    @property
    def seems_nothing(self) -> bool:
        """Whether its mass was measured and may be none; a payload that is known is what it is."""
        return self.std is not None and self.determined[0] and not held(self.parameters.mass, self.std[0], True)

    @property
    def lacks(self) -> str | None:
        """What is not in the load, in words, and so cannot be taken off it; None: it holds everything, as far as known.

        >>> Load(InertialParameters.zero(), relative_to="tare").lacks
        'relative to the tare: what was mounted then is not in it'
        """
        if self.relative_to in (None, "arm"):
            return None
        what = "the tool" if self.relative_to == "tool" else "what was mounted then"
        return f"relative to the {_RELATIVE.get(self.relative_to, self.relative_to)}: {what} is not in it"

    def __sub__(self, other: InertialParameters | Load) -> Load:
        since = self.relative_to in ("tare", "profile", "before")  # what was mounted then is not in it, as before
        part = other if isinstance(other, Load) else Load(other)
        left = self._changed(self.parameters - part.parameters, part, self.relative_to if since else "tool")
        if self.lacks is not None and left._is_no_body():
            raise SinkError(
                f"what is left has a mass of {left.parameters.mass:.4g} kg and is no body: {self.lacks}; do not take "
                "it off again"
            )
        return left

    def __add__(self, other: InertialParameters | Load) -> Load:
        part = other if isinstance(other, Load) else Load(other)
        return self._changed(self.parameters + part.parameters, part, "arm")

    def about(self, frame: str | None, arm: Arm | None = None) -> Load:
        """The same load about another frame fixed to the arm's last moving link; see `about`.

        What was not measured stays so: a parameter counts as measured where all are that it is computed from. Without a
        covariance its deviation is that of errors which are independent about the old frame.
        """
        moved = about(self.parameters, frame, arm)
        if arm is None or frame is None or self.frame in (None, frame):
            return replace(self, parameters=moved)
        from armload.arms import from_frame  # with Pinocchio: only for who needs it

        T = from_frame(replace(arm, frame=frame, attached=None), str(self.frame))
        known = tuple(all(np.array(self.determined)[np.abs(row) > _NONE]) for row in T)
        std = None if self.std is None else np.sqrt(T**2 @ self.std**2)
        covariance = None if self.covariance is None else T @ self.covariance @ T.T
        turned = bool(np.any(np.abs(T[1:4, 1:4] - np.eye(3)) > _NONE))
        remarks = tuple(remarks_on.of_axes(remark, str(self.frame)) if turned else remark for remark in self.remarks)
        return replace(self, parameters=moved, determined=known, std=std, covariance=covariance, remarks=remarks)

    def as_body(self) -> Load:
        """The nearest load that a body can have, in units of its standard deviations; itself where it is one.

        Raises:
            SinkError: its mass is not above zero.
        """
        if self.parameters.mass <= 0:
            raise SinkError(
                f"the payload has a mass of {self.parameters.mass:.4g} kg: expected a mass above 0; check what was "
                "taken off, and what it was measured relative to"
            )
        if self.consistent:
            return self
        return self.with_parameters(InertialParameters(self._nearest(), self.frame))

    def without_inertia(self) -> Load:
        """The same for who does not ask for an inertia: nothing is said of that."""
        determined = tuple(known or name[0] == "I" for known, name in zip(self.determined, NAMES, strict=True))
        remarks = (remarks_on.without_moments(remark) for remark in self.remarks)
        return replace(self, determined=determined, remarks=tuple(remark for remark in remarks if remark))

    def description(self) -> tuple[str, ...]:
        """Lines to write above the numbers: whose load, about which frame, and what was not measured."""
        what = f"payload of {self.robot}" if self.robot else "payload"
        if self.frame:
            what += f" about {self.frame}"
        if self.relative_to:
            what += f", relative to the {_RELATIVE.get(self.relative_to, self.relative_to)}"
        lines = [what, *[remarks_on.NOTHING_HELD] * self.seems_nothing]
        if self.undetermined:
            lines.append(f"not determined by the log: {', '.join(self.undetermined)}; known beforehand, not measured")
        return tuple(_of_a_comment(line) for line in (*lines, *self.remarks))

    def _nearest(self) -> NDArray[np.float64]:
        from armload.inertia import nearest_consistent

        information = None if self.std is None else np.diag(1.0 / np.maximum(self.std, 1e-9) ** 2)
        return nearest_consistent(self.parameters.phi, information)

    def _is_no_body(self) -> bool:
        """Whether no body with a mass has these parameters, nor any within the error bars."""
        if self.parameters.mass <= 0 or self.consistent or self.std is None:
            return self.parameters.mass <= 0 or not self.consistent
        away = (self._nearest() - self.parameters.phi) / np.maximum(self.std, 1e-9)
        return float(np.linalg.norm(away)) > _MISFIT

    def _changed(self, parameters: InertialParameters, part: Load, relative_to: str | None) -> Load:
        """With a part more or less, whose errors are independent of its own."""
        both = replace(
            self,
            determined=tuple(a and b for a, b in zip(self.determined, part.determined, strict=True)),
            std=_beside(self.std, part.std),
            covariance=_together(self, part),
            remarks=remarks_on.beside(self.remarks, part.remarks),
        )
        return replace(both.with_parameters(parameters), relative_to=relative_to if self.relative_to else None)

    def with_parameters(self, parameters: InertialParameters) -> Load:
        """Other parameters, as uncertain as before: of smaller moments that may be more than they are."""
        remarks = self.remarks
        if self.covariance is not None and parameters.mass > 0:
            remarks = tuple(remark for remark in remarks if not remark.startswith(remarks_on.HARDLY_KNOWN))
            remarks += remarks_on.loose_of(parameters, self.covariance, self.determined)
        return replace(self, parameters=parameters, remarks=remarks)


def _beside(one: NDArray[np.float64] | None, other: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Both deviations together; None: nothing is measured."""
    if one is None or other is None:
        return other if one is None else one
    return np.hypot(one, other)


def _together(one: Load, other: Load) -> NDArray[np.float64] | None:
    """The covariance (10, 10) of both together; None: nothing is measured, or only how large each error is."""
    if one.std is None or other.std is None:
        return other.covariance if one.std is None else one.covariance
    return None if one.covariance is None or other.covariance is None else one.covariance + other.covariance


def about(parameters: InertialParameters, frame: str | None, arm: Arm | None = None) -> InertialParameters:
    """Parameters about another frame of the arm's last moving link; parameters without a named frame take the name.

    Args:
        parameters: about their own frame.
        frame: the frame wanted; None: as they are.
        arm: the arm whose description holds both frames; needed where they differ.

    Raises:
        SinkError: the frames differ and no arm is given.
        ArmError: the arm has no such frame, or joints lie between the two.
    """
    if frame is None or parameters.frame == frame:
        return parameters
    if parameters.frame is None:
        return InertialParameters(parameters.phi, frame)
    if arm is None:
        raise SinkError(
            f"the parameters are about {parameters.frame!r} and wanted about {frame!r}: name the robot whose "
            "description holds both frames"
        )
    return replace(arm, frame=frame, attached=None).in_frame(parameters)


def numbers_of(parameters: InertialParameters, order: str) -> list[float]:
    """The numbers in another program's order, to 14 decimals: 1.48 then reads 1.48, and 0 reads 0."""
    return [round(float(x), 14) + 0.0 for x in to_order(parameters, order)]


def counted_numbers(parameters: InertialParameters, order: str) -> list[float]:
    """The same for a controller, which may be told that nothing is held: zeros, though that has no centre of mass."""
    if parameters.phi.any():
        return numbers_of(parameters, order)
    return [0.0] * len(to_order(InertialParameters(np.eye(10)[0]), order))


def _of_a_comment(text: str) -> str:
    r"""A text as one line that ends no comment: XML's ends with two hyphens, Java reads \\u000a as a line's end.

    >>> print(_of_a_comment("a---b\n\\u000ac"))
    a- - -b /u000ac
    """
    shown = "".join(c if c.isprintable() else " " for c in text)
    return " ".join(re.sub("-(?=-)", "- ", shown).replace("\\", "/").split())
