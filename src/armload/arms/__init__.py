"""Robot arms: their rigid-body model, and the regressors through which a payload shows in the joint torques."""

from armload.arms.catalogue import ARMS, arm
from armload.arms.forward import ForwardDerivatives, ForwardDynamics
from armload.arms.kinship import kinship, namesake
from armload.arms.model import LINK_SPREAD, Arm, BodyMotion, Limits
from armload.arms.regressors import MomentumRegressor, full_arm_regressor, momentum_regressor, payload_regressor
from armload.arms.strength import poses, rated_effort

__all__ = [
    "ARMS",
    "LINK_SPREAD",
    "Arm",
    "BodyMotion",
    "ForwardDerivatives",
    "ForwardDynamics",
    "Limits",
    "MomentumRegressor",
    "arm",
    "full_arm_regressor",
    "kinship",
    "momentum_regressor",
    "namesake",
    "payload_regressor",
    "poses",
    "rated_effort",
]
