"""Recordings: what a robot's joints did, and the files they come in."""

from armload.recording.files import read_recording, write_recording
from armload.recording.recording import CHANNELS, Recording, Sample

__all__ = ["CHANNELS", "Recording", "Sample", "read_recording", "write_recording"]
