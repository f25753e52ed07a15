"""Robot arms: their rigid-body model, and the regressors through which a payload shows in the joint torques."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.arms.capsules import NearestCapsules
    from armload.arms.catalogue import arm
    from armload.arms.facts import ARMS, ArmFacts, Capsule
    from armload.arms.forward import ForwardDerivatives, ForwardDynamics
    from armload.arms.limits import Limits
    from armload.arms.matching import facts_of, flange_named, from_frame, link_fingerprint, names_among, prefixed_frame
    from armload.arms.model import LINK_SPREAD, Arm
    from armload.arms.regressors import (
        MomentumRegressor,
        full_arm_regressor,
        leaning_torque,
        momentum_regressor,
        payload_regressor,
    )
    from armload.arms.rigid_body import BodyMotion
    from armload.arms.strength import FRICTION_WIDTH, PAYLOAD_REACH, poses, rated_effort, rated_mass

__all__ = [
    "ARMS",
    "FRICTION_WIDTH",
    "LINK_SPREAD",
    "PAYLOAD_REACH",
    "Arm",
    "ArmFacts",
    "BodyMotion",
    "Capsule",
    "ForwardDerivatives",
    "ForwardDynamics",
    "Limits",
    "MomentumRegressor",
    "NearestCapsules",
    "arm",
    "facts_of",
    "flange_named",
    "from_frame",
    "full_arm_regressor",
    "leaning_torque",
    "link_fingerprint",
    "momentum_regressor",
    "names_among",
    "payload_regressor",
    "poses",
    "prefixed_frame",
    "rated_effort",
    "rated_mass",
]

__getattr__, __dir__ = on_first_use(__name__)
