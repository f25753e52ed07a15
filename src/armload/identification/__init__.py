"""One log in, one answer out: plausibility, choice of method, answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.identification.answer import Identification
    from armload.identification.arm_health import ArmHealth
    from armload.identification.choice import DEFAULT, Choice, choose, default_for
    from armload.identification.compensated import check_gravity_was_missing
    from armload.identification.identify_log import check_usable, identify
    from armload.identification.left_out import LEFT_OUT
    from armload.identification.methods import METHODS, Method
    from armload.identification.mounted_tool import plausible_tool, with_tool
    from armload.identification.one_payload import known_of, plausible_known
    from armload.identification.plausibility import check_plausible

__all__ = [
    "DEFAULT",
    "LEFT_OUT",
    "METHODS",
    "ArmHealth",
    "Choice",
    "Identification",
    "Method",
    "check_gravity_was_missing",
    "check_plausible",
    "check_usable",
    "choose",
    "default_for",
    "identify",
    "known_of",
    "plausible_known",
    "plausible_tool",
    "with_tool",
]

__getattr__, __dir__ = on_first_use(__name__)
