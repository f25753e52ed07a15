"""The ten inertial parameters: what they mean, their orders, frames and algebra, and what makes them physical.

No other room packs, reorders, moves or projects the 10-vector.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.inertia.about_com import com_interval, inertia_com_std, largest_inertia_com
    from armload.inertia.consistency import (
        from_log_cholesky,
        is_consistent,
        log_cholesky,
        log_cholesky_curvature,
        log_cholesky_jacobian,
        pseudo_inertia,
        pseudo_inertia_to_phi,
    )
    from armload.inertia.determinacy import (
        DROPPED,
        HELD,
        LIGHTEST_HELD,
        SHRINK,
        Z95,
        determined,
        held,
        held_probability,
    )
    from armload.inertia.digits import decimals
    from armload.inertia.inexact import Inexact
    from armload.inertia.orders import ORDERS, from_order, to_order
    from armload.inertia.parameters import (
        NAMES,
        UNITS,
        InertialParameters,
        com_to_phi,
        frame_change_matrix,
        inertia_matrix,
        parameters_only,
        phi_to_com,
        skew,
        vech,
    )
    from armload.inertia.projection import distance_to_body, near_consistent, nearest_body, nearest_consistent

__all__ = [
    "DROPPED",
    "HELD",
    "LIGHTEST_HELD",
    "NAMES",
    "ORDERS",
    "SHRINK",
    "UNITS",
    "Z95",
    "InertialParameters",
    "Inexact",
    "com_interval",
    "com_to_phi",
    "decimals",
    "determined",
    "distance_to_body",
    "frame_change_matrix",
    "from_log_cholesky",
    "from_order",
    "held",
    "held_probability",
    "inertia_com_std",
    "inertia_matrix",
    "is_consistent",
    "largest_inertia_com",
    "log_cholesky",
    "log_cholesky_curvature",
    "log_cholesky_jacobian",
    "near_consistent",
    "nearest_body",
    "nearest_consistent",
    "parameters_only",
    "phi_to_com",
    "pseudo_inertia",
    "pseudo_inertia_to_phi",
    "skew",
    "to_order",
    "vech",
]

__getattr__, __dir__ = on_first_use(__name__)
