"""Builds message packages with CMake into the ROS 2 environment that runs this, as colcon does.

    .venv-ros/bin/python tests/devices/ros/build_messages.py

armload_msgs as it is, and stand-ins of those that no wheel has (`messages/`): franka_msgs and ur_msgs with the one
service that is called, tf2_msgs, and of moveit_msgs those fields that are used. They need a C++ compiler and CMake. The
wheels' own CMake files name the Python of the machine that built them, which is put right first.
"""

import os
import re
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

import numpy

HERE = Path(__file__).resolve().parent
OURS = HERE.parents[2] / "ros2" / "armload_msgs"
PREFIX = Path(sys.prefix)
_BUILDERS = "/opt/python/cp311-cp311"  # of the wheels


def mend() -> None:
    """The paths of Python and numpy in the wheels' CMake files."""
    there = {
        f"{_BUILDERS}/include/python3.11": sysconfig.get_path("include"),
        f"{_BUILDERS}/lib/python3.11/site-packages/numpy/_core/include": numpy.get_include(),
    }
    for path in PREFIX.glob("share/*/cmake/*.cmake"):
        text = path.read_text(encoding="utf-8")
        mended = text
        for wrong, right in there.items():
            mended = mended.replace(wrong, right)
        if mended != text:
            path.write_text(mended, encoding="utf-8")


def describe(folder: Path, into: Path) -> Path:
    """A package of the definitions in a folder, which has nothing else."""
    files = sorted(folder.glob("*/*.*"))
    text = "\n".join(file.read_text(encoding="utf-8") for file in files)
    needs = sorted(set(re.findall(r"^(\w+)/", text, re.MULTILINE)) - {folder.name})
    listed = " ".join(f'"{file.relative_to(folder)}"' for file in files)
    package = into / folder.name
    for file in files:
        (package / file.parent.name).mkdir(parents=True, exist_ok=True)
        (package / file.relative_to(folder)).write_bytes(file.read_bytes())
    lines = [
        "cmake_minimum_required(VERSION 3.20)",
        f"project({folder.name})",
        *(f"find_package({name} REQUIRED)" for name in ("ament_cmake", "rosidl_default_generators", *needs)),
        f"rosidl_generate_interfaces(${{PROJECT_NAME}} {listed} DEPENDENCIES {' '.join(needs)})",
        "ament_package()",
    ]
    (package / "CMakeLists.txt").write_text("\n".join(lines).replace(" DEPENDENCIES )", ")"), encoding="utf-8")
    (package / "package.xml").write_text(
        f'<package format="3"><name>{folder.name}</name><version>0.0.0</version><description>A stand-in.</description>'
        '<maintainer email="maintainers@armload.invalid">armload developers</maintainer><license>Apache-2.0</license>'
        "<buildtool_depend>ament_cmake</buildtool_depend><member_of_group>rosidl_interface_packages</member_of_group>"
        "<export><build_type>ament_cmake</build_type></export></package>",
        encoding="utf-8",
    )
    return package


def build(package: Path, into: Path) -> None:
    """Configure, build and install one package."""
    env = os.environ | {
        "AMENT_PREFIX_PATH": str(PREFIX),
        "PATH": f"{PREFIX / 'bin'}{os.pathsep}{os.environ['PATH']}",
    }
    where = (
        f"-DCMAKE_PREFIX_PATH={PREFIX}",
        f"-DCMAKE_INSTALL_PREFIX={PREFIX}",
        f"-DPython3_EXECUTABLE={sys.executable}",
    )
    for command in (["cmake", "-S", package, "-B", into, *where], ["cmake", "--build", into, "-t", "install"]):
        done = subprocess.run(list(map(str, command)), env=env, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{package.name}: {(done.stderr or done.stdout)[-2000:]}")
    print(f"{package.name} is built", flush=True)


def main() -> None:
    mend()
    with tempfile.TemporaryDirectory() as folder:
        into = Path(folder)
        stand_ins = [describe(each, into) for each in sorted((HERE / "messages").iterdir())]
        for package in (OURS, *stand_ins):
            build(package, into / "build" / package.name)


if __name__ == "__main__":
    main()
