"""Simulation: the arm under a joint controller that does not know the payload, in a world, seen through sensors."""

from armload.simulate.controller import Command, Gains
from armload.simulate.plant import build_model, settled_start
from armload.simulate.runs import Run, simulate, simulate_many
from armload.simulate.sensors import Sensors
from armload.simulate.worlds import SmoothTorque, World

__all__ = [
    "Command",
    "Gains",
    "Run",
    "Sensors",
    "SmoothTorque",
    "World",
    "build_model",
    "settled_start",
    "simulate",
    "simulate_many",
]
