"""Live robots, simulators and files as one stream of samples.

Everything that needs a vendor's client, ROS or the simulator is imported when it is opened.
"""

from armload.sources.detached import Detached
from armload.sources.franka import FrankaSource
from armload.sources.open import open_source
from armload.sources.recorder import Recorded, Recorder
from armload.sources.replay import Replay
from armload.sources.ring import Ring, RingReader
from armload.sources.ros2 import Ros2Source
from armload.sources.ros2_connection import Ros2Connection
from armload.sources.simulator import Simulator
from armload.sources.source import Source
from armload.sources.ur import URSource

__all__ = [
    "Detached",
    "FrankaSource",
    "Recorded",
    "Recorder",
    "Replay",
    "Ring",
    "RingReader",
    "Ros2Connection",
    "Ros2Source",
    "Simulator",
    "Source",
    "URSource",
    "open_source",
]
