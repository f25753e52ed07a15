"""Motions: the Fourier excitation, its design and checks, and the files other people's robots read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.motion.check import MotionCheck, check_joints, check_motion, rated_load
    from armload.motion.course import Course
    from armload.motion.endless import EndlessMotion
    from armload.motion.export import export_motion
    from armload.motion.fingerprint import MotionFingerprint
    from armload.motion.fourier import FourierMotion, start_and_stop_at_rest
    from armload.motion.joined import JoinedMotion
    from armload.motion.motion import Motion
    from armload.motion.motion_file import load_motion, save_motion, taie2024
    from armload.motion.path import PathMotion
    from armload.motion.random_fourier import excitation, random_motion
    from armload.motion.spline import SplineMotion
    from armload.motion.straight import StraightMotion

__all__ = [
    "Course",
    "EndlessMotion",
    "FourierMotion",
    "JoinedMotion",
    "Motion",
    "MotionCheck",
    "MotionFingerprint",
    "PathMotion",
    "SplineMotion",
    "StraightMotion",
    "check_joints",
    "check_motion",
    "excitation",
    "export_motion",
    "load_motion",
    "random_motion",
    "rated_load",
    "save_motion",
    "start_and_stop_at_rest",
    "taie2024",
]

__getattr__, __dir__ = on_first_use(__name__)
