"""What a wheel is compiled for is what Python calls, and a library gets only arguments that it was compiled for."""

import ast
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import armload
from armload.runtime import kernels

PACKAGE = Path(armload.__file__).parent


@pytest.mark.full  # some seconds
def test_every_kernel_that_python_calls_is_compiled_for_a_wheel():
    trees = {
        "armload." + path.relative_to(PACKAGE).with_suffix("").as_posix().replace("/", "."): ast.parse(path.read_text())
        for path in PACKAGE.rglob("*.py")
    }
    made, called = {}, set()
    for module, tree in trees.items():
        functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
        made[module] = {f.name: f for f in functions if any("'kernel'" in ast.dump(d) for d in f.decorator_list)}
    for module, tree in trees.items():
        known = {name: f"{module}.{name}" for name in made[module]}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module in made:
                known |= {
                    a.asname or a.name: f"{node.module}.{a.name}" for a in node.names if a.name in made[node.module]
                }
        compiled = {id(node) for f in made[module].values() for node in ast.walk(f)}
        calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call) and id(node) not in compiled)
        called |= {known[c.func.id] for c in calls if isinstance(c.func, ast.Name) and c.func.id in known}
    assert len(called) > 20
    named = {f"armload.{name}" for name in kernels.signatures()}
    assert called <= named <= {f"{module}.{name}" for module, names in made.items() for name in names}
    for name, kinds in kernels.signatures().items():
        module, _, function = f"armload.{name}".rpartition(".")
        takes = len(made[module][function].args.args)
        assert {len(each) for each in kinds} == {takes}, f"{name} takes {takes} arguments"


@pytest.fixture
def ahead(monkeypatch):
    """A kernel of (array of doubles, number) and what was handed to its library, where all else is refused."""
    handed = []

    def _of_two(x, a):  # noqa: ARG001
        raise AssertionError("not compiled for this")

    monkeypatch.setattr(kernels, "signatures", lambda: {kernels.name_of(_of_two): [["float64[:, :]", "float64"]]})
    monkeypatch.setattr(kernels, "_just_in_time", lambda function, _: function)
    library = SimpleNamespace(**{kernels.symbol(_of_two, 0): lambda *arguments: handed.append(arguments)})
    return kernels._Ahead(_of_two, {}, library), handed


@pytest.mark.parametrize(
    "x",
    [
        np.zeros((4, 3)).T,
        np.zeros((4, 3))[:, ::2],
        np.zeros((4, 3), np.float32),
        np.zeros((4, 3), int),
        np.zeros(3),
        [1.0],
    ],
    ids=["turned", "a view", "single precision", "whole numbers", "fewer dimensions", "a list"],
)
def test_an_array_of_another_order_or_type_never_reaches_the_library(x, ahead):
    function, handed = ahead
    with pytest.raises(AssertionError, match="not compiled"):
        function(x, 1.0)
    assert not handed


def test_arguments_that_fit_reach_the_library_by_place_or_name(ahead):
    function, handed = ahead
    x = np.zeros((2, 2))
    function(x, 1.0)
    function(x, a=np.float64(1.0))
    function(x, 1)
    assert handed == [(x, 1.0)] * 3


def test_two_processes_that_compile_at_once_both_get_the_libraries(tmp_path, monkeypatch):
    spec = spec_from_file_location("hatch_build", Path(__file__).parents[2] / "hatch_build.py")
    build = module_from_spec(spec)
    spec.loader.exec_module(build)

    found, begun = [], []

    def compile_all(folder, _):
        (folder / "_kernels_any.so").write_text("compiled")
        begun.append(folder)
        if len(begun) == 1:
            found.append(build.kept(tmp_path))  # another process, which is done first

    monkeypatch.setattr(build, "compile_all", compile_all)
    found.append(build.kept(tmp_path))
    assert found[0] == found[1]
    assert [path.read_text() for path in found[1]] == ["compiled"]
    assert [path.name for path in tmp_path.iterdir()] == [found[1][0].parent.name]  # nothing else is left
