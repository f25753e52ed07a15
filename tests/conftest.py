"""Shared fixtures: the arms, and the folder of real logs where there is one."""

import gc
import os
import time
from pathlib import Path

import numpy as np
import pytest

from armload.arms import ARMS, arm
from armload.recording import Recording

# one arm of each family, and those that have a hybrid; the others differ from one of these in figures only
FAMILIES = ("fr3", "gen3", "iiwa14", "panda", "ur10e", "ur5e", "xarm7")
TWO = ("panda", "ur10e")  # of seven joints and of six, of a torque sensor and of motor currents


# Files that workers take first: `make test` gives a worker a file, and the next in this order when that is done. These
# are the longest, the longest first, so that none is left for the end; what they need of compiled code, `make` has made
# before.
FIRST = (
    "lab/test_study.py",  # of the full tests
    "identification/test_recording_plausibility.py",
    "estimators/test_identifier.py",
    "identification/test_identify.py",
    "app/test_cli_identify.py",
    "online/test_online_events.py",
    "devices/test_sources.py",
    "app/test_live.py",
    "online/test_online.py",
    "service/test_reconnecting.py",
    "identification/test_segments.py",
    "posterior/test_hybrid.py",
    "ensembles/test_learners.py",
    "test_docs.py",
    "online/test_log_and_stream.py",
    "app/test_cli_profile.py",
    "survey/test_faults.py",
    "simulation/test_torque_control.py",
    "excitation/test_enrich.py",
    "posterior/test_known.py",
    "identification/test_answer.py",
    "motion/test_motion_check.py",
    "lab/test_benchmark.py",
    "recording/test_recording_bags.py",
    "app/test_cli_columns.py",
    "app/test_cli_motion.py",
    "test_architecture.py",
    "simulation/test_simulate.py",
    "service/test_continued.py",
    "lab/test_dataset.py",
    "excitation/test_design.py",
    "app/test_measure.py",
    "measuring/test_measuring.py",
)
TESTS = Path(__file__).resolve().parent

# All that is imported and found is there to stay: to search it for garbage again and again costs a third.
gc.disable()


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(items):
    place = {TESTS / name: k for k, name in enumerate(FIRST)}
    items.sort(key=lambda item: place.get(item.path, len(FIRST)))  # the rest as they were found


@pytest.fixture(params=FAMILIES)
def any_arm(request):
    """An arm of each family of the catalogue in turn."""
    return arm(request.param)


@pytest.fixture(params=[pytest.param(name, marks=() if name in TWO else pytest.mark.full) for name in FAMILIES])
def some_arm(request):
    """As `any_arm`, but two of them in the quick tests: for what takes a while."""
    return arm(request.param)


@pytest.fixture(params=sorted(ARMS))
def every_arm(request):
    """Each arm of the catalogue in turn: for what is cheap, and what depends on the figures."""
    return arm(request.param)


@pytest.fixture(scope="session")
def panda():
    return arm("panda")


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real logs: ARMLOAD_REAL_DATA, or shared/data beside the checkout."""
    named = os.environ.get("ARMLOAD_REAL_DATA")
    folder = Path(named) if named else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not (folder / "panda_unloaded_1khz.csv").exists():
        pytest.skip(f"real logs not found in {folder}: set ARMLOAD_REAL_DATA to their folder")
    return folder


@pytest.fixture
def far_east(monkeypatch):
    """A machine whose local time is fourteen hours ahead of UTC."""
    monkeypatch.setenv("TZ", "XXX-14")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.fixture
def analytic_log():
    """A factory of exact logs on an analytic motion: analytic_log(arm, payload, …) -> Recording."""

    def make(arm, payload=None, *, duration=6.0, rate=200.0, phase=0.0, extra=None, start=0.0):
        t = start + np.arange(int(duration * rate)) / rate
        joints = np.arange(arm.n)
        pose = np.array([0.2, -0.6, 0.3, -1.8, 0.2, 1.6, 0.4][: arm.n])
        w, a = 2.0 + 0.35 * joints, 0.5 - 0.02 * joints
        angle = t[:, None] * w + joints + phase
        q, dq, ddq = pose + a * np.sin(angle), a * w * np.cos(angle), -a * w**2 * np.sin(angle)
        tau = (arm if payload is None else arm.with_payload(payload)).torque(q, dq, ddq)
        return Recording(t, q, dq, tau if extra is None else tau + extra(q, dq))

    return make
