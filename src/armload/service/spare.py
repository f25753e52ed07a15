"""The processes of arms: each started when it is asked for, and one ahead, for the arm whose process ends next."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterable
from typing import Any

from armload.service.settings import ArmSettings

# several threads solve, and glibc would give each a heap of its own: 60 MB of 390 (`benchmarks/soak.py`)
_ENVIRONMENT = {"MALLOC_ARENA_MAX": "1"}


class Spare:
    """A process that has imported, loaded and computed what the first second of an arm's process goes to.

    It serves any arm of the service, so there is one whatever their number.

    Args:
        arms: of the service. wanted: whether there is to be one at all.

    Attributes:
        kinds: what the arms of the service need, each once (`ready`).
    """

    def __init__(self, arms: Iterable[ArmSettings], wanted: bool = True) -> None:
        kinds = {(arm.robot, arm.frame, arm.method) for arm in arms}
        self.kinds = [dict(zip(("robot", "frame", "method"), kind, strict=True)) for kind in kinds]
        self._wanted, self._lock = wanted, threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def take(self) -> subprocess.Popen[bytes]:
        """The spare process, else a new one; it waits for its order."""
        with self._lock:
            process, self._process = self._process, None
        if process is not None and process.poll() is None:
            return process
        return _started()

    def prepare(self) -> None:
        """Start the next one, if there is none."""
        with self._lock:
            if self._wanted and (self._process is None or self._process.poll() is not None):
                self._process = _started()
                order(self._process, {"ready": self.kinds})

    def close(self) -> None:
        """End it."""
        with self._lock:
            process, self._process, self._wanted = self._process, None, False
        if process is not None:
            process.kill()
            process.communicate()


def order(process: subprocess.Popen[bytes], what: dict[str, Any]) -> None:
    """Tell a process what to do; one that has ended will be noticed."""
    assert process.stdin is not None
    with contextlib.suppress(OSError):
        process.stdin.write((json.dumps(what) + "\n").encode())
        process.stdin.flush()


def _started() -> subprocess.Popen[bytes]:
    command = [sys.executable, "-P", "-m", "armload.service.arm_process"]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**_ENVIRONMENT, **os.environ})
