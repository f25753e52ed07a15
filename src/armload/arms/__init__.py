"""Robot arms: their rigid-body model, and the regressors through which a payload shows in the joint torques."""

from armload.arms.capsules import NearestCapsules
from armload.arms.catalogue import arm, facts_of
from armload.arms.facts import ARMS, ArmFacts, Capsule
from armload.arms.forward import ForwardDerivatives, ForwardDynamics
from armload.arms.kinship import kinship, namesake
from armload.arms.model import LINK_SPREAD, Arm, BodyMotion, Limits
from armload.arms.regressors import MomentumRegressor, full_arm_regressor, momentum_regressor, payload_regressor
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
    "full_arm_regressor",
    "kinship",
    "momentum_regressor",
    "namesake",
    "payload_regressor",
    "poses",
    "rated_effort",
    "rated_mass",
]
