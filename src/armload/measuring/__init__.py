"""A whole measurement: what will move is said and checked, runs are made and recorded, and the answer is given."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.measuring.basis import Basis
    from armload.measuring.plan import Leg, Plan, Room, plan_of
    from armload.measuring.procedure import Measurement, Procedure

__all__ = ["Basis", "Leg", "Measurement", "Plan", "Procedure", "Room", "plan_of"]

__getattr__, __dir__ = on_first_use(__name__)
