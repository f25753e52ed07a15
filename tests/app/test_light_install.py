"""A wheel without extras identifies, follows a stream and exports; what is missing is one sentence.

What the package depends on is that of the running tests, less every module of a distribution that the wheel does not
require: importing one of those fails as if it were not installed. So this shows that armload gets along without them.
The package is the one under test, which has the files of the wheel but for the compiled functions: those of
ARMLOAD_KERNELS take their place, as in `make test`, or numba compiles them. What is marked full is the wheel itself, as
pip installs it into an environment of its own, without numba. That pip finds what is required shows
`benchmarks/install.py`, which needs the network.
"""

import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from importlib.metadata import PackageNotFoundError, PathDistribution, distribution, packages_distributions
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import armload
from armload.payloads import test_payload as payload_of_the_tests
from armload.recording import write_recording
from armload.runtime import extras, kernels

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
HOOK = '''\
"""Refuses to import what is not required."""
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {refused!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Refuse())
'''


def required(names):
    """Canonical names of all that these distributions require, themselves included."""
    found, left = set(), list(names)
    while left:
        name = canonicalize_name(left.pop())
        if name in found:
            continue
        found.add(name)
        try:
            lines = distribution(name).requires or []
        except PackageNotFoundError:
            continue
        wanted = [Requirement(line) for line in lines]
        left += [r.name for r in wanted if r.marker is None or r.marker.evaluate({"extra": ""})]
    return found


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    return built(folder, {"ARMLOAD_PURE_WHEEL": "1"})


def built(folder, settings):
    """A wheel of the project."""
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True, env=os.environ | settings)
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def refused(wheel):
    """The modules of all that is installed and the wheel does not require."""
    (info,) = (path for path in zipfile.Path(wheel).iterdir() if path.name.endswith(".dist-info"))
    core = [Requirement(line) for line in PathDistribution(info).requires or []]  # type: ignore[arg-type]
    allowed = required(r.name for r in core if r.marker is None or r.marker.evaluate({"extra": ""}))
    found = {
        module
        for module, owners in packages_distributions().items()
        if module != "armload" and not {canonicalize_name(owner) for owner in owners} & allowed
    }
    assert {
        "numba",
        "llvmlite",
        "mujoco",
        "sklearn",
        "jax",
        "matplotlib",
        "jinja2",
        "joblib",
        "trimesh",
        "viser",
        "rosbags",
    } <= found
    return found


@pytest.fixture(scope="module", params=["package", pytest.param("wheel", marks=pytest.mark.full)])
def light(request, refused, tmp_path_factory):
    """Runs Python with armload and what it requires, and nothing else."""
    folder = tmp_path_factory.mktemp("light")
    if request.param == "package":
        home, python = Path(armload.__file__).parents[1], sys.executable
        kept = os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), str(home)])}
        compiler = set() if os.environ.get(kernels.FOLDER) else {"numba", "llvmlite"}
        (folder / "sitecustomize.py").write_text(HOOK.format(refused=refused - compiler))
    else:
        home, python = folder, str(folder / "venv" / "bin" / "python")
        foreign = ("PYTHON", "NUMBA", kernels.FOLDER)
        kept = {name: value for name, value in os.environ.items() if not name.startswith(foreign)}
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder / "venv")], check=True)
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "--python", python]
        subprocess.run([*pip, "install", "--no-deps", "--no-index", str(built(folder, {}))], check=True, cwd=folder)
        (place,) = (folder / "venv" / "lib").glob("python*/site-packages")
        (place / "only_required.py").write_text(HOOK.format(refused=refused))
        packages = sysconfig.get_path("purelib")
        # the hook last: the packages' own may import anything
        start = f"import site; site.addsitedir({packages!r}); import only_required\n"
        (place / "only_required.pth").write_text(start)

    def run(*arguments):
        command = [python, *map(str, arguments)]
        return subprocess.run(command, cwd=folder, env=kept, capture_output=True, text=True, timeout=300)

    found = run("-c", "import armload; print(armload.__file__); import mujoco")
    assert Path(found.stdout.strip()).is_relative_to(home)
    assert "'mujoco'" in found.stderr
    return run


@pytest.mark.full  # some seconds
def test_a_wheel_without_extras_identifies_exports_and_follows_a_replay(light, panda, analytic_log, tmp_path):
    body = payload_of_the_tests()
    log, held = tmp_path / "log.csv", tmp_path / "held.json"
    write_recording(log, analytic_log(panda, body.parameters, duration=2.0))

    done = light("-m", "armload", "identify", log, "--robot", "panda", "--json")
    assert done.returncode == 0, done.stderr
    held.write_text(done.stdout)
    assert json.loads(done.stdout)["mass"] == pytest.approx(body.parameters.mass, abs=0.1)

    assert "1.4" in light("-m", "armload", "export", held, "--to", "franka").stdout

    done = light("-m", "armload", "live", log, "--robot", "panda", "--headless", "--speed", "max")
    assert done.returncode == 0, done.stderr
    last = json.loads(done.stdout.splitlines()[-1])
    assert last["t"] == pytest.approx(2.0, abs=0.1)
    assert last["mass"] == pytest.approx(body.parameters.mass, abs=0.1)


@pytest.mark.full  # some seconds
def test_a_wheel_without_extras_learns_a_profile_shows_it_and_says_what_to_record_next(
    light, panda, analytic_log, tmp_path
):
    empty, profile = tmp_path / "empty.csv", tmp_path / "arm.profile"
    write_recording(empty, analytic_log(panda, duration=2.0))
    done = light("-m", "armload", "profile", empty, "--robot", "panda", "--out", profile)
    assert done.returncode == 0, done.stderr
    assert "one session does not tell how the arm drifts" in done.stderr
    done = light("-m", "armload", "profile", "show", profile, "--json")
    assert done.returncode == 0, done.stderr
    assert "one session" in json.loads(done.stdout)["next"][0]


@pytest.mark.full
@pytest.mark.parametrize("light", ["wheel"], indirect=True)
def test_each_library_of_a_wheel_says_what_numba_says(light, panda, analytic_log, tmp_path):
    log, tare = tmp_path / "log.csv", tmp_path / "tare.csv"
    write_recording(log, analytic_log(panda, payload_of_the_tests().parameters, duration=2.0))
    write_recording(tare, analytic_log(panda, duration=2.0, phase=1.0))
    found = f"found = armload.identify({str(log)!r}, 'panda', tare={str(tare)!r}); "
    code = f"import armload; {found} print(*found.phi)"
    numba_s = os.environ | {kernels.FOLDER: ""}
    done = subprocess.run([sys.executable, "-c", code], env=numba_s, capture_output=True, text=True, check=True)
    wanted = np.array(done.stdout.split(), dtype=float)
    for name, (_, needed) in kernels.LIBRARIES.items():
        if not needed <= kernels._processor():
            continue  # which would not run on this processor
        code = (
            f"from armload.runtime import kernels; kernels._processor = lambda: {needed!r}; import armload; {found}"
            "print(kernels._library().__name__, *found.phi)"
        )
        done = light("-c", code)
        assert done.returncode == 0, done.stderr
        library, *phi = done.stdout.split()
        assert library == f"armload.{name}"
        np.testing.assert_allclose(np.array(phi, dtype=float), wanted, atol=1e-9)


NEEDS = {
    "pyarrow": ["demo", "--quick", "--out", "demo"],
    "scikit-learn": ["dataset", "--out", "{data}"],  # all of its extra, not what it happens to import first
    "mujoco": ["live", "--headless", "--duration", "0.1"],
    "panda-python": ["live", "panda://127.0.0.1", "--headless"],
    "viser": ["live", "{log}", "--robot", "panda"],
}


@pytest.mark.full  # some seconds
def test_what_needs_an_extra_says_in_one_sentence_how_to_install_it(light, panda, analytic_log, tmp_path):
    """One process asks for all: none has what it needs, whatever was refused before."""
    log = tmp_path / "log.csv"
    write_recording(log, analytic_log(panda, duration=0.5))
    data = tmp_path / "data"
    asked = [[argument.format(log=log, data=data) for argument in arguments] for arguments in NEEDS.values()]
    code = (
        "import contextlib, io, json\nfrom armload.app import main\nsaid = []\n"
        f"for argv in {asked!r}:\n"
        "    out, err = io.StringIO(), io.StringIO()\n"
        "    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err): code = main(argv)\n"
        "    said.append([code, out.getvalue(), err.getvalue()])\n"
        "print(json.dumps(said))"
    )
    done = light("-c", code)
    assert (done.returncode, done.stderr) == (0, "")
    for package, (status, out, err) in zip(NEEDS, json.loads(done.stdout), strict=True):
        assert (status, out) == (2, ""), err
        line = err.splitlines()[-1]  # what was done until then may stand above
        assert "Traceback" not in err
        (wanted,) = [r for e in PROJECT["optional-dependencies"].values() for r in e if r.startswith(f"{package}>")][:1]
        assert f"'{wanted.partition(';')[0].strip()}'" in line.partition("pip install ")[2]
    assert not data.exists()


def test_python_that_needs_an_extra_is_told_how_to_install_it(light):
    done = light(
        "-c", "import armload; from armload.motion import taie2024; armload.simulate(armload.arm('panda'), taie2024())"
    )
    assert done.returncode == 1
    assert re.search(r"ModuleNotFoundError: this needs \w+, which is not installed: pip install ", done.stderr)


def test_each_extra_and_each_package_of_it_is_known_and_named_as_in_pyproject():
    of = {e: {Requirement(r).name for r in rs} for e, rs in PROJECT["optional-dependencies"].items()}
    assert of.pop("all") == {"armload"}
    of.pop("dev")
    stated = {(package, extra) for package, extra in extras.MODULES.values()}
    assert {(p, e) for e, packages in of.items() for p in packages} - stated == {
        ("trimesh", "live"),
        ("pyarrow", "lab"),
        ("joblib", "cluster"),
        ("scipy", "matlab"),
        ("h5py", "matlab"),
    }
    assert all(package in of[extra] for package, extra in stated)


def test_a_python_that_is_too_old_is_named_by_the_build_and_not_its_compiler():
    """pip builds a clone's wheel before it asks what Python the wheel is for; this one says it is older."""
    code = "import runpy, sys; sys.version_info = (3, 10, 13); runpy.run_path('hatch_build.py')"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (1, "")
    assert PROJECT["requires-python"] == ">=3.11"
    assert re.fullmatch(r"armload needs Python 3\.11 or newer, and this is Python [\d.]+\n", done.stderr)


def test_the_wheel_holds_the_files_of_the_package_and_nothing_else(wheel):
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    package = ROOT / "src" / "armload"
    files = {path.relative_to(package.parent) for path in package.rglob("*") if path.is_file()}
    assert names == {path.as_posix() for path in files if "__pycache__" not in path.parts}
    assert "armload/py.typed" in names
    assert any(name.startswith("armload/posterior/models/") for name in names)


@pytest.mark.parametrize(
    ("commands", "absent"),
    [
        (
            [
                ["identify", "{log}", "--robot", "panda", "--tare", "{tare}"],
                ["live", "{log}", "--robot", "panda", "--headless", "--speed", "max"],
            ],
            set(),
        ),
        ([["export", "{held}", "--to", "franka"]], {"numba", "pinocchio", "scipy"}),
    ],
    ids=["identify and live", "export"],
)
def test_light_commands_import_nothing_of_the_extras(commands, absent, panda, analytic_log, tmp_path):
    names = {name: tmp_path / f"{name}.csv" for name in ("log", "tare")} | {"held": tmp_path / "held.json"}
    body = payload_of_the_tests().parameters
    write_recording(names["log"], analytic_log(panda, body, duration=0.5))
    write_recording(names["tare"], analytic_log(panda, duration=0.5, phase=1.0))
    names["held"].write_text(json.dumps({"phi": body.phi.tolist(), "frame": panda.frame, "robot": "panda"}))
    argvs = [[part.format(**names) for part in command] for command in commands]
    code = (
        f"import sys, json; from armload.app import main; codes = [main(argv) for argv in {argvs!r}]; "
        "print('\\n' + json.dumps([any(codes), [m for m in sys.modules if '.' not in m]]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    status, loaded = json.loads(done.stdout.splitlines()[-1])
    assert not status, done.stderr
    # numba imports scipy where it is installed; that nothing needs it show the tests in the light environment
    assert not set(loaded) & (set(extras.MODULES) - {"scipy", "numba"} | absent)
