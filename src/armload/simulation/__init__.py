"""Simulation: the arm under a joint controller that does not know the payload, in a world, seen through sensors."""

from armload.simulation.continued import ContinuedRun
from armload.simulation.controller import Command, Gains
from armload.simulation.friction import Friction
from armload.simulation.inverse import simulate_inverse
from armload.simulation.plant import build_model, settled_start
from armload.simulation.residual import SmoothTorque
from armload.simulation.resolution import Resolution
from armload.simulation.runs import Run, simulate, simulate_many
from armload.simulation.sensors import Sensors
from armload.simulation.torque_control import TorqueRun, torque_controlled
from armload.simulation.torque_laws import GravityCompensation, JointImpedance, Law, moderate_stiffness
from armload.simulation.worlds import Drift, World

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
    "moderate_stiffness",
    "settled_start",
    "simulate",
    "simulate_inverse",
    "simulate_many",
    "torque_controlled",
]
