"""Logs as MATLAB files: arrays and structs of every version, whichever way they lie; objects are refused by name.

SciPy writes those of version 4 and 5; 7.3 is written as MATLAB does, its dimensions in reverse. Files that MATLAB wrote
itself are SciPy's own test data, where they are installed.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from numpy.testing import assert_array_equal

from armload import Recording, read_recording
from armload.arms import arm
from armload.errors import RecordingError

PANDA = arm("panda")
BY_MATLAB = Path(scipy.io.__file__).parent / "matlab" / "tests" / "data"


@pytest.fixture(scope="module")
def log():
    rng = np.random.default_rng(8)
    q, dq, tau = rng.uniform(-1.0, 1.0, (3, 200, 7))
    return Recording(np.arange(200) / 100.0, q, dq, tau)


def arrays_of(log, across):
    """As MATLAB holds them: a column for each time, or a row."""
    arrays = {"time": log.t[:, None], "q": log.q, "qd": log.dq, "tau": log.tau}
    return {name: array.T if across else array for name, array in arrays.items()}


def write_7_3(path, tree):
    h5py = pytest.importorskip("h5py")

    def add(group, tree):
        for name, value in tree.items():
            if isinstance(value, dict):
                inner = group.create_group(name)
                inner.attrs["MATLAB_class"] = np.bytes_("struct")
                add(inner, value)
            elif isinstance(value, str):
                group[name] = np.frombuffer(value.encode("utf-16-le"), np.uint16)[:, None]
                group[name].attrs["MATLAB_class"] = np.bytes_("char")
            else:
                group[name] = value.T
                group[name].attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        add(file, tree)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64 HDF5 schema 1.00 .".ljust(124) + b"\x00\x02IM")


WRITERS = {
    "4": lambda path, tree: scipy.io.savemat(path, tree, format="4"),
    "7": lambda path, tree: scipy.io.savemat(path, tree, do_compression=True),
    "7.3": write_7_3,
}


def same(read, log):
    for name in ("t", "q", "dq", "tau"):
        assert_array_equal(getattr(read, name), getattr(log, name))


@pytest.mark.parametrize("across", [False, True])
@pytest.mark.parametrize("version", WRITERS)
def test_every_version_is_read_whichever_way_its_arrays_lie(log, tmp_path, version, across):
    path = tmp_path / "log.mat"
    WRITERS[version](path, arrays_of(log, across))
    same(read_recording(path, PANDA), log)


@pytest.mark.parametrize("version", ["7", "7.3"])
def test_fields_of_a_struct_are_read_by_their_own_names(log, tmp_path, version):
    path = tmp_path / "log.mat"
    more = {"robot": "panda", "gains": np.eye(7), "image": np.zeros((100, 120))}
    WRITERS[version](path, {"data": {"run": arrays_of(log, True) | more}, "version": "3"})
    same(read_recording(path, PANDA), log)


@pytest.mark.parametrize("version", ["7", "7.3"])
def test_two_structs_that_hold_the_same_are_told_apart_by_whoever_reads_them(log, tmp_path, version):
    path = tmp_path / "log.mat"
    other = {name: array + 1.0 for name, array in arrays_of(log, False).items()}
    WRITERS[version](path, {"before": arrays_of(log, False), "after": other})
    with pytest.raises(RecordingError, match=r"found .*(before|after)/(time|q\[0\])"):
        read_recording(path, PANDA)
    named = ",".join(f"{key}=after/{name}" for key, name in zip(("t", "q", "dq", "tau"), other, strict=True))
    assert_array_equal(read_recording(path, PANDA, columns=named).q, log.q + 1.0)


def test_a_struct_that_says_what_is_wanted_is_not_read_as_measured(log, tmp_path):
    path, arrays = tmp_path / "log.mat", arrays_of(log, False)
    reference = {"q": arrays.pop("q")}
    scipy.io.savemat(path, {"log": arrays, "desired": reference})
    with pytest.raises(RecordingError, match="desired"):
        read_recording(path, PANDA)


def test_signals_that_simulink_logs_with_their_times_are_read(log, tmp_path):
    path = tmp_path / "log.mat"
    arrays = arrays_of(log, False)
    time = arrays.pop("time")
    signals = {
        name: {"time": time, "signals": {"values": array.T[:, None, :], "dimensions": [7.0, 1.0]}}
        for name, array in arrays.items()
    }
    scipy.io.savemat(path, {"tout": time, "out": signals})
    same(read_recording(path, PANDA), log)


def test_objects_of_matlab_are_refused_by_name_with_what_to_do():
    if not (BY_MATLAB / "parabola.mat").exists():
        pytest.skip("SciPy is installed without its test data")
    with pytest.raises(RecordingError, match=r"parabola: an object of MATLAB's own.*writetable"):
        read_recording(BY_MATLAB / "parabola.mat", PANDA)


def test_what_matlab_wrote_that_is_no_log_is_refused():
    files = sorted(BY_MATLAB.glob("*.mat"))
    if not files:
        pytest.skip("SciPy is installed without its test data")
    assert len(files) > 50
    for file in files:
        with pytest.raises(RecordingError):
            read_recording(file, PANDA)


@pytest.mark.parametrize("share", [0.3, 0.9])
@pytest.mark.parametrize("version", ["7", "7.3"])
def test_a_file_that_was_cut_off_is_refused(log, tmp_path, version, share):
    path = tmp_path / "log.mat"
    WRITERS[version](path, arrays_of(log, False))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(RecordingError, match=r"log\.mat"):
        read_recording(path, PANDA)


def test_without_scipy_it_is_said_how_to_install_it(log, tmp_path, monkeypatch):
    path = tmp_path / "log.mat"
    WRITERS["7"](path, arrays_of(log, False))
    monkeypatch.setitem(sys.modules, "scipy.io", None)
    with pytest.raises(RecordingError, match=r"read through SciPy, which is missing: pip install .*h5py"):
        read_recording(path, PANDA)


def test_text_of_octave_is_refused_with_what_to_do(tmp_path):
    path = tmp_path / "log.mat"
    path.write_text("# Created by Octave 7.3.0, Fri Nov 27 2026\n# name: q\n# type: matrix\n")
    with pytest.raises(RecordingError, match="Octave's own text; save it with -v7"):
        read_recording(path, PANDA)
