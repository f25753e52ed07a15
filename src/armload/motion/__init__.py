"""Motions: the Fourier excitation, its design and checks, and the files other people's robots read."""

from armload.motion.files import load_motion, save_motion, taie2024
from armload.motion.fourier import FourierMotion, start_and_stop_at_rest
from armload.motion.motion import Motion

__all__ = [
    "FourierMotion",
    "Motion",
    "load_motion",
    "save_motion",
    "start_and_stop_at_rest",
    "taie2024",
]
