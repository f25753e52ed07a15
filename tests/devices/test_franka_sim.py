"""`armload measure` moves an FR3 that is not ours: franka-sim speaks the protocol and judges the motion by itself.

Needs pylibfranka, and franka-sim in an environment of its own, whose Python ARMLOAD_FRANKA_SIM_PYTHON names. franka-sim
fetches its model of the arm when it first starts; without a network FR3_MJCF names a file.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from armload.arms import arm
from armload.excitation import Constraints, Criterion, PayloadRange, design_motion
from armload.motion import save_motion
from armload.recording import read_recording

pytestmark = pytest.mark.full
PYTHON = os.environ.get("ARMLOAD_FRANKA_SIM_PYTHON", "")
SERVER = Path(__file__).resolve().parent / "servers" / "franka_sim_robot.py"
ADDRESS = "127.0.7.90"
HOME = [0.0, 0.0, 0.0, -1.57079, 0.0, 1.57079, 0.7853]  # where franka-sim's arm stands when it starts
HEARS_CTRL_C = ("env", "--default-signal=INT")
PATIENCE = 300.0  # [s]


@pytest.fixture(scope="module")
def motion():
    """A motion about where the arm stands, for a kilogram."""
    fr3 = arm("fr3")
    limits = Constraints(fr3, np.array(HOME), payload=PayloadRange(1.0), share=0.5, speed=0.5)
    return design_motion(limits, Criterion(fr3, "same"), 2.0, starts=1).motion


@pytest.fixture
def measure(motion, tmp_path):
    """`armload measure` against franka-sim, and what franka-sim says."""
    pytest.importorskip("pylibfranka", reason="the maker's client has no wheel for this Python")
    if not PYTHON:
        pytest.skip("no franka-sim: ARMLOAD_FRANKA_SIM_PYTHON names the Python that has it")
    save_motion(tmp_path / "m.json", motion)
    log, begun = tmp_path / "server.log", []
    with log.open("w", encoding="utf-8") as out:
        server = subprocess.Popen([PYTHON, str(SERVER), ADDRESS], stdout=out, stderr=out)
    try:
        until = time.monotonic() + PATIENCE
        while "simulation loop" not in log.read_text(encoding="utf-8"):
            if server.poll() is not None or time.monotonic() > until:
                pytest.skip(f"franka-sim does not start: {log.read_text(encoding='utf-8')[-300:]}")
            time.sleep(0.2)

        def run(*more):
            words = ["measure", f"fr3://{ADDRESS}", "--robot", "fr3", "--method", "map", "--off-path", "0.3"]
            words += ["--motion", str(tmp_path / "m.json"), "--dir", str(tmp_path / "logs"), "--grip", "true"]
            process = subprocess.Popen(
                [*HEARS_CTRL_C, sys.executable, "-m", "armload", *words, *more],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
            begun.append(process)
            return process

        yield run, log, tmp_path / "logs"
    finally:
        for process in (*begun, server):
            process.kill()
            process.wait()
        for process in begun:
            process.stdout.close()
            process.stderr.close()


def seen(folder, name):
    """What was recorded of a run."""
    return read_recording(folder / name, arm("fr3"))


def fastest(path):
    """The largest joint speed [rad/s] of the last row that is complete."""
    rows = path.read_text(encoding="utf-8").splitlines()[:-1] if path.exists() else []
    return max(abs(float(x)) for x in rows[-1].split(",")[8:15]) if len(rows) > 1 else 0.0


def test_without_consent_nothing_moves_and_with_it_both_runs_are_within_what_franka_sim_allows(measure, motion):
    run, log, folder = measure
    refused = run()
    _, err = refused.communicate(timeout=PATIENCE)
    assert refused.returncode == 2
    assert "nothing was moved" in err
    assert "Received Move command" not in log.read_text(encoding="utf-8")
    allowed = run("--move")
    _, err = allowed.communicate(timeout=PATIENCE)
    assert allowed.returncode == 2  # franka-sim knows no weight: it says the last torque commanded, which was none
    assert "tau is zero in all joints" in err
    said = log.read_text(encoding="utf-8")
    assert said.count("Sent Move success response") == 2
    assert "violation" not in said
    q = motion.position(np.linspace(0.0, motion.duration, 1001))
    for name in ("empty.csv", "loaded.csv"):
        found = seen(folder, name)
        np.testing.assert_allclose(found.q.min(axis=0), q.min(axis=0), atol=0.03)
        np.testing.assert_allclose(found.q.max(axis=0), q.max(axis=0), atol=0.03)
        np.testing.assert_allclose(found.q[-1], HOME, atol=0.03)


def test_ctrl_c_brings_the_arm_to_rest_on_its_path_and_the_record_is_readable(measure):
    run, log, folder = measure
    process = run("--move")
    until = time.monotonic() + PATIENCE
    while fastest(folder / "empty.csv") < 0.2:
        assert process.poll() is None
        assert time.monotonic() < until
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "violation" not in log.read_text(encoding="utf-8")
    found = seen(folder, "empty.csv")
    assert np.abs(found.dq).max() >= 0.2  # it moved
    assert np.abs(found.dq[-1]).max() < 0.05
