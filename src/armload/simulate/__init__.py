"""Simulation: the arm under a joint controller that does not know the payload, in a world, seen through sensors."""

from armload.simulate.continued import ContinuedRun
from armload.simulate.controller import Command, Gains
from armload.simulate.friction import Friction
from armload.simulate.plant import build_model, settled_start
from armload.simulate.ratings import is_panda, rated_mass
from armload.simulate.residual import SmoothTorque
from armload.simulate.resolution import Resolution
from armload.simulate.runs import Run, simulate, simulate_many
from armload.simulate.sensors import Sensors
from armload.simulate.torque_control import TorqueRun, torque_controlled
from armload.simulate.torque_laws import GravityCompensation, JointImpedance, Law, moderate_stiffness
from armload.simulate.worlds import Drift, World

__all__ = [
    "Command",
    "ContinuedRun",
    "Drift",
    "Friction",
    "Gains",
    "GravityCompensation",
    "JointImpedance",
    "Law",
    "Resolution",
    "Run",
    "Sensors",
    "SmoothTorque",
    "TorqueRun",
    "World",
    "build_model",
    "is_panda",
    "moderate_stiffness",
    "rated_mass",
    "settled_start",
    "simulate",
    "simulate_many",
    "torque_controlled",
]
