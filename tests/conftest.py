"""Shared fixtures: the arms, and the folder of real logs where there is one."""

import os
from pathlib import Path

import pytest

from armload.arms import ARMS, arm


@pytest.fixture(params=sorted(ARMS))
def any_arm(request):
    """Each arm of the catalogue in turn."""
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
