"""Kinova Gen3: the form of a payload."""
