"""The house rules, read from the source: which room may import which, who owns what is heavy, nothing pickled."""

import ast
import builtins
import importlib
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "armload"
MODULES = sorted(SOURCE.rglob("*.py"))
ROW = re.compile(r"^\| `([a-z0-9_]+)(?:/|\.py)` \|.*\| ([^|]*) \|$", re.MULTILINE)

# Which rooms may import what is slow to load or speaks to the outside. Everything else is free.
OWNERS = {
    "numba": {"runtime"},
    "pinocchio": {"arms"},
    "coal": {"arms"},
    "clarabel": set(),  # the tests' oracle
    "trimesh": {"payloads", "app"},
    "rosbags": {"recording"},
    "mcap": {"recording"},
    "rclpy": {"devices"},
    "sensor_msgs": {"devices"},
    "geometry_msgs": {"devices"},
    "trajectory_msgs": {"devices"},
    "pyarrow": {"recording", "lab", "survey"},
    "h5py": {"recording"},
    "mujoco": {"simulation"},
    "jax": {"ensembles"},
    "sklearn": {"ensembles", "posterior"},
    "safetensors": {"runtime"},
    "matplotlib": {"lab", "survey"},
    "distributed": {"lab"},
    "fsspec": {"survey"},
    "jinja2": {"lab"},
    "pylibfranka": {"devices"},
    "panda_py": {"devices"},
    "rtde_receive": {"devices"},
    "viser": {"app"},
}
FORBIDDEN = {"torch", "pickle", "cPickle", "cloudpickle", "dill", "shelve", "marshal"}


def table_of_rooms():
    """Rooms and their main names, in the order of docs/architecture.md: the page is the rule."""
    return {room: names for room, names in ROW.findall((ROOT / "docs" / "architecture.md").read_text(encoding="utf-8"))}


ROOMS = table_of_rooms()
ORDER = list(ROOMS)


def room_of(path):
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


@cache
def tree_of(path):
    """The syntax tree of a file, to be read only."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(path):
    """(module, line) of every import in a file, the lazy ones inside functions and TYPE_CHECKING included."""
    found = []
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                package = ["armload", *path.relative_to(SOURCE).parent.parts]
                base = ".".join(package[: len(package) - node.level + 1])
                module = f"{base}.{node.module}" if node.module else base
            else:
                module = node.module
            # `from armload import arms` names a room as well as `import armload.arms` does
            found += [(f"{module}.{a.name}" if module == "armload" else module, node.lineno) for a in node.names]
    return found


def test_the_page_lists_every_room_and_no_other():
    there = {room_of(path) for path in MODULES} - {"__init__", "__main__"}
    assert there == set(ORDER)
    assert len(ORDER) >= 14


def test_imports_go_one_way():
    wrong = []
    for path in MODULES:
        room = room_of(path)
        if room in ("__init__", "__main__"):
            continue  # the front door opens on every room
        above = ORDER[: ORDER.index(room) + 1]
        for module, line in imports(path):
            parts = module.split(".")
            if parts == ["armload"]:
                wrong.append(f"{path}:{line} imports the front door: import from the room itself")
            elif parts[0] == "armload" and parts[1] not in above:
                wrong.append(f"{path}:{line} imports armload.{parts[1]}, which is below {room}")
    assert wrong == []


def test_no_modules_import_each_other_in_a_circle():
    """Imports inside functions count too; those for type checkers alone do not."""
    names = {dotted(path): path for path in MODULES}
    graph = {name: {d for d in imported_modules(path, names) if d != name} for name, path in names.items()}
    while free := [name for name, needs in graph.items() if not needs & graph.keys()]:
        for name in free:
            del graph[name]
    needed = set().union(*graph.values()) if graph else set()
    assert not (graph.keys() & needed), f"these import each other: {sorted(graph.keys() & needed)}"


def dotted(path):
    return ".".join(("armload", *path.relative_to(SOURCE).with_suffix("").parts)).removesuffix(".__init__")


def imported_modules(path, names):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            node.body = [ast.Pass()]
    found = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module and not node.level]
    pairs = [(node.module, alias.name) for node in found for alias in node.names]
    return {f"{m}.{n}" if f"{m}.{n}" in names else m for m, n in pairs} & names.keys()


def test_heavy_packages_stay_in_their_rooms():
    wrong = []
    for path in MODULES:
        for module, line in imports(path):
            package = module.split(".")[0]
            owners = OWNERS.get(package)
            if owners is not None and room_of(path) not in owners:
                wrong.append(f"{path}:{line} imports {package}, owned by {owners}")
    assert wrong == []


def test_nothing_is_pickled():
    wrong = []
    for path in MODULES:
        wrong += [f"{path}:{line} imports {m}" for m, line in imports(path) if m.split(".")[0] in FORBIDDEN]
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                if ast.unparse(node.func) in ("joblib.dump", "joblib.load"):
                    wrong.append(f"{path}:{node.lineno} calls {ast.unparse(node.func)}: a pickle")
                if any(k.arg == "allow_pickle" and ast.unparse(k.value) != "False" for k in node.keywords):
                    wrong.append(f"{path}:{node.lineno} allows pickle")
    assert wrong == []


def test_what_is_written_at_once_is_written_beside_and_appears_whole():
    """Into what `replacing` gives, which is called so everywhere; what grows is a `GrowingFile`."""
    wrong = []
    for path in MODULES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                into = ast.unparse(node.func.value)
                if node.func.attr in ("write_text", "write_bytes") and into not in ("temporary", "part"):
                    wrong.append(f"{path}:{node.lineno} writes into {into}: use armload.runtime.replacing")
    assert wrong == []


def test_modules_are_named_after_a_concept():
    words = {path: {*path.stem.strip("_").split("_"), *path.parent.relative_to(SOURCE).parts} for path in MODULES}
    vague = {"utils", "util", "helpers", "helper", "core", "common", "misc", "base", "shared"}
    assert [str(path) for path in MODULES if words[path] & vague] == []


def test_each_room_has_the_names_the_page_promises():
    for room, text in ROOMS.items():
        names = re.findall(r"`(\w+)`", text)
        assert names, f"the page names nothing of {room}"
        module = importlib.import_module(f"armload.{room}")
        missing = [name for name in names if not hasattr(module, name)]
        assert not missing, f"armload.{room} has no {missing}"


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import armload", ["pinocchio", "numba", "scipy", *OWNERS]),
        ("import armload.app.cli", [name for name in OWNERS if name not in ("pinocchio", "coal")]),
        (
            "from armload.arms import arm; from armload.estimators import RecursiveLeastSquares; "
            "from armload.recording import read_recording; from armload.payloads import from_mesh",
            [name for name in OWNERS if name not in ("pinocchio", "coal", "numba")],
        ),
    ],
    ids=["armload", "armload.app.cli", "identification"],
)
def test_what_is_heavy_loads_only_when_used(statement, absent):
    code = f"import sys; {statement}; print([m for m in {absent!r} if m in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert loaded.strip() == "[]"


# Where an error of Python's own is raised only to be caught by who knows the file, the object or the line.
CAUGHT = {
    "ensembles/artefact.py",
    "ensembles/compiled.py",
    "identification/tare_age.py",  # after a loop that always returns
    "payloads/payload_file.py",
    "posterior/model_file.py",
    "posterior/profile_file.py",
    "recording/csv_file.py",
    "recording/spooled.py",
    "runtime/lazy.py",
    "runtime/packing.py",
    "runtime/sparing.py",
    "runtime/real_numbers.py",
    "survey/table_file.py",
}


def test_what_is_raised_is_armloads_own_but_where_it_is_caught():
    said = (OSError, ModuleNotFoundError)  # by the command line in a sentence, whoever raises them
    raised = set()
    for path in MODULES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Raise) and node.exc is not None:
                name = ast.unparse(node.exc.func if isinstance(node.exc, ast.Call) else node.exc)
                kind = getattr(builtins, name, KeyboardInterrupt)
                if issubclass(kind, Exception) and not issubclass(kind, said):
                    raised.add(path.relative_to(SOURCE).as_posix())
    assert raised == CAUGHT


def test_every_exception_has_the_one_base():
    tree = tree_of(SOURCE / "errors.py")
    own = {node.name for node in tree.body if isinstance(node, ast.ClassDef)}
    errors = importlib.import_module("armload.errors")
    assert own
    for name in own:
        assert issubclass(getattr(errors, name), errors.ArmloadError)
    for path in MODULES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ClassDef) and path.name != "errors.py":
                bases = [ast.unparse(base) for base in node.bases]
                stray = [b for b in bases if b.endswith(("Error", "Exception")) and b not in own]
                assert not stray, f"{path}:{node.lineno} {node.name} derives from {stray}: put it into errors.py"
