"""Franka arms: reading their state, writing a load, its form."""
