"""Programs of the ROS 2 environment beside a test: that of ARMLOAD_ROS_PYTHON, or of `make .venv-ros/.stamp`."""

import os
import signal
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# what was started in the background of a shell is deaf to Ctrl-C, and so are its children
HEARS_CTRL_C = ("env", "--default-signal=INT")


@pytest.fixture(scope="session")
def ros_python():
    named = os.environ.get("ARMLOAD_ROS_PYTHON")
    python = Path(named) if named else ROOT / ".venv-ros" / "bin" / "python"
    if not python.exists():
        pytest.skip(f"no ROS 2: {python} does not exist; make .venv-ros/.stamp, or set ARMLOAD_ROS_PYTHON")
    look = "import rclpy, armload.arms, sensor_msgs.msg, geometry_msgs.msg, trajectory_msgs.msg"
    done = subprocess.run([python, "-c", look], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"no ROS 2 in {python}: {done.stderr.strip().splitlines()[-1]}")
    return str(python)


@pytest.fixture
def ros(ros_python, tmp_path):
    """Starts programs of the ROS 2 environment, on a network of this test only, and ends them as Ctrl-C does."""
    packages = str(ROOT / "ros2" / "armload_ros")
    env = os.environ | {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_LOG_DIR": str(tmp_path / "log"),
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join(filter(None, [packages, os.environ.get("PYTHONPATH")])),
    }
    count = iter(range(100))

    @contextmanager
    def start(*words, orders=False):
        where = tmp_path / f"process{next(count)}"
        with where.with_suffix(".out").open("w") as out, where.with_suffix(".err").open("w") as err:
            command = [*HEARS_CTRL_C, ros_python, *map(str, words)]
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE if orders else None, stdout=out, stderr=err, env=env, text=True
            )
        # what stands after the last end of a line is a line half written
        process.printed_lines = lambda: where.with_suffix(".out").read_text().split("\n")[:-1]
        process.noted = lambda: where.with_suffix(".err").read_text()
        try:
            yield process
        finally:
            if process.stdin is not None:
                process.stdin.close()
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    return start


@pytest.fixture(scope="session")
def wait_until():
    """Waits for something to become true; the programs' own words if it does not."""

    def wait(true, seconds, *processes):
        until = time.monotonic() + seconds
        while not true():
            if time.monotonic() > until:
                said = (line for p in processes for line in (p.noted(), *p.printed_lines()))
                pytest.fail("\n".join(["it did not come:", *said]))
            time.sleep(0.05)

    return wait
