"""armload: tell a robot arm what it is holding, from joint position, velocity and torque.

    from armload import identify

    print(identify("run.csv", "panda"))

The names below are imported when they are first used, so that `import armload` is instant.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use
from armload.runtime.version import __version__

if TYPE_CHECKING:
    from armload.arms import ARMS, Arm, arm
    from armload.devices import open_source
    from armload.ensembles import LearnedIdentifier, load_model, save_model
    from armload.errors import ArmloadError
    from armload.estimators import Estimate, FilteredRecursiveLeastSquares, Identifier, RecursiveLeastSquares
    from armload.identification import METHODS, Identification, identify
    from armload.inertia import InertialParameters
    from armload.motion import FourierMotion, Motion, check_motion, taie2024
    from armload.online import OnlineIdentifier
    from armload.payloads import Payload, read_payload, write_payload
    from armload.posterior import HybridIdentifier, PosteriorLeastSquares
    from armload.recording import Recording, Sample, read_recording, write_recording
    from armload.simulation import Sensors, World, simulate

__all__ = [
    "ARMS",
    "METHODS",
    "Arm",
    "ArmloadError",
    "Estimate",
    "FilteredRecursiveLeastSquares",
    "FourierMotion",
    "HybridIdentifier",
    "Identification",
    "Identifier",
    "InertialParameters",
    "LearnedIdentifier",
    "Motion",
    "OnlineIdentifier",
    "Payload",
    "PosteriorLeastSquares",
    "Recording",
    "RecursiveLeastSquares",
    "Sample",
    "Sensors",
    "World",
    "__version__",
    "arm",
    "check_motion",
    "identify",
    "load_model",
    "open_source",
    "read_payload",
    "read_recording",
    "save_model",
    "simulate",
    "taie2024",
    "write_payload",
    "write_recording",
]


def _let_numba_keep_what_it_compiles() -> None:
    """Where neither the package nor the home can be written, as in a container, numba would refuse to compile at all.

    The folder must be the user's own: what numba reads from it, it executes.
    """
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))  # relative where no home is known
    places = [Path(__file__).parent, *([home] if home.is_absolute() else [])]
    if "NUMBA_CACHE_DIR" in os.environ or any(_writable(place) for place in places):
        return
    try:
        folder = Path(tempfile.gettempdir()) / f"armload-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        own = folder.is_dir() and not folder.is_symlink() and found.st_uid == os.getuid() and not found.st_mode & 0o077
        os.environ["NUMBA_CACHE_DIR"] = str(folder if own else tempfile.mkdtemp(prefix="armload-"))
    except OSError:
        return  # nothing can be written anywhere; numba says so


def _writable(folder: Path) -> bool:
    """Whether something can be written there, the folder made first if need be."""
    there = next(place for place in (folder, *folder.parents) if os.path.exists(place))  # no, where it may not be asked
    return os.access(there, os.W_OK)


_let_numba_keep_what_it_compiles()

__getattr__, _ = on_first_use(__name__)


def __dir__() -> list[str]:
    return list(__all__)
