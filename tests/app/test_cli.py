"""The command line's manners: help, usage errors in one sentence, exit codes, quick start, signals."""

import json
import os
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

import armload
from armload.app.cli import main
from armload.app.cli.entry import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
HEAVY = {"jax", "sklearn", "matplotlib", "mujoco", "rosbags", "trimesh"}


def refused(capsys, argv, code=2):
    """The one line on stderr of a call that must be refused with nothing on stdout."""
    assert main(argv) == code
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.splitlines()
    assert len(lines) == 1, err
    assert "Traceback" not in err
    assert not set(err) & set("│╭╮╰╯─┌┐└┘|")
    assert lines[0].startswith("armload: ")
    return lines[0]


def test_help_lists_every_command_with_a_line_of_its_own(capsys):
    assert main(["--help"]) == 0
    out = capsys.readouterr().out
    for name, text in COMMANDS.items():
        assert sum(line.split()[:1] == [name] and text in line for line in out.splitlines()) == 1


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_ends_with_examples_of_it(capsys, command):
    assert main([command, "--help"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert f"armload {command}" in out.split("examples:")[1]


@pytest.mark.parametrize("columns", [80, 100, 200])
@pytest.mark.parametrize("command", ["identify", "measure", "motion design"])
def test_options_are_explained_in_lines_that_a_terminal_does_not_break(command, columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert main([*command.split(), "--help"]) == 0
    lines = capsys.readouterr().out.partition("\nexamples:")[0].splitlines()
    lengths = [len(line) for line in lines if line.startswith(" ")]  # of all but the sentence that says what it does
    most = min(columns - 2, 110)
    assert 0.8 * most < max(lengths) <= most


def test_version_is_the_packages(capsys):
    assert main(["--version"]) == 0
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert capsys.readouterr().out == f"armload {stated}\n"
    assert armload.__version__ == stated


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        ([], "identify"),
        (["identfy"], "did you mean 'identify'"),
        (["--robot", "panda"], "--robot"),
        (["identify"], "LOG, --robot"),
        (["identify", "log.csv"], "--robot"),
        (["identify", "--robot", "panda"], "LOG"),
        (["identify", "log.csv", "--robot", "panda", "--colour", "red"], "--colour"),
        (["identify", "log.csv", "more.csv", "--robot", "panda"], "more.csv"),
        (["identify", "log.csv", "--robot"], "--robot"),
        (["identify", "log.csv", "--robot", "panda", "--gravity"], "--gravity"),
        (["identify", "log.csv", "--robot", "panda", "--gravity", "--json"], "--gravity"),
        (["identify", "log.csv", "--robot", "panda", "--gravity", "1,2"], "'1,2'"),
        (["identify", "log.csv", "--robot", "panda", "--gravity", "-1,2"], "'-1,2'"),
        (["identify", "log.csv", "--robot", "panda", "--gravity", "a,b,c"], "'a,b,c'"),
        (["identify", "log.csv", "--robot", "panda", "--gravity", "0,0,nan"], "gravity"),
        (["identify", "log.csv", "--robot", "panda", "--gravity", "0,0,-9810"], "9.81e+03"),
        (["identify", "log.csv", "--robot", "panda", "--gravity="], "--gravity"),
        (["identify", "log.csv", "--robot", "panda", "--json=yes"], "--json"),
        (["motion"], "ACTION"),
        (["motion", "dance"], "dance"),
        (["motion", "show", "random:x"], "random:x"),
        (["motion", "check", "no_such.json", "--robot", "panda"], "no_such.json"),
        (["motion", "export", "taie2024", "--format", "gif", "--out", "x"], "gif"),
        (["motion", "random", "--robot", "panda", "--seed", "-1", "--out", "x"], "-1"),
        (["motion", "random", "--robot", "panda", "--duration", "1e9", "--out", "x"], "from 0.1 to 3600"),
        (["motion", "export", "taie2024", "--format", "csv", "--rate", "1e9", "--out", "x"], "from 0.001 to 10000"),
        (["motion", "export", "taie2024", "--format", "csv", "--out", ""], "--out: the name is empty"),
        (["motion", "show", "taie2024", "--robot", "nobody"], "nobody"),
    ],
)
def test_a_usage_error_is_one_sentence_that_names_the_place(capsys, argv, named):
    assert named in refused(capsys, argv)


def test_interruption_is_one_line_and_130(capsys, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("armload.arms.arm", interrupt)
    assert refused(capsys, ["identify", "log.csv", "--robot", "panda"], code=130) == "armload: interrupted"


def cause():
    """As the interpreter says that compiled code came back with an error it did not tell of."""
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as stop:
        raise SystemError("returned a result with an exception set") from stop


def context():
    """As a compiler that cleans up fails over what it left unfinished."""
    unfinished = {}
    try:
        raise KeyboardInterrupt
    finally:
        unfinished["half compiled"]


def destructor():
    """Where Python prints the exception and goes on."""

    class Stopped:
        def __del__(self):
            raise KeyboardInterrupt

    Stopped()
    for _ in range(500):
        time.sleep(0.01)
    raise AssertionError("the interruption was lost")


@pytest.fixture
def hears_ctrl_c():
    """A test runner's worker may ignore the signal."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("hears_ctrl_c")
@pytest.mark.parametrize("how", [cause, context, destructor])
def test_an_interruption_that_others_made_something_else_of_is_one_all_the_same(capfd, monkeypatch, how):
    monkeypatch.setattr("armload.arms.arm", lambda *_, **__: how())
    assert refused(capfd, ["identify", "log.csv", "--robot", "panda"], code=130) == "armload: interrupted"


def test_a_bug_told_after_an_interruption_is_a_bug(capsys, monkeypatch):
    def told_late(*_, **__):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise ZeroDivisionError("of the thread that identifies") from None

    monkeypatch.setattr("armload.arms.arm", told_late)
    assert "ZeroDivisionError" in refused(capsys, ["identify", "log.csv", "--robot", "panda"], code=1)


def test_too_little_memory_is_no_bug(capsys, monkeypatch):
    def full(*_, **__):
        raise MemoryError

    monkeypatch.setattr("armload.arms.arm", full)
    said = refused(capsys, ["identify", "run.csv", "--robot", "panda"])
    assert said == "armload: too little memory: no more can be had"


def test_a_bug_is_one_line_with_a_hint_and_the_traceback_on_request(capsys, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("by zero,\nsomewhere")

    monkeypatch.setattr("armload.arms.arm", broken)
    argv = ["identify", "log.csv", "--robot", "panda"]
    line = refused(capsys, argv, code=1)
    assert "ZeroDivisionError: by zero, somewhere" in line
    assert "ARMLOAD_TRACEBACK=1" in line
    assert main([*argv, "--traceback"]) == 1
    assert "Traceback" in capsys.readouterr().err
    monkeypatch.setenv("ARMLOAD_TRACEBACK", "1")
    assert main(argv) == 1
    assert "Traceback" in capsys.readouterr().err


def run(*argv, **settings):
    return subprocess.run([sys.executable, "-m", "armload", *argv], capture_output=True, text=True, **settings)


def test_the_process_refuses_as_main_does():
    done = run("identify", "no_such_log.csv", "--robot", "panda", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "no_such_log.csv" in done.stderr


@pytest.mark.parametrize(
    ("argv", "unbuffered"),
    [(["--help"], ""), (["methods"], ""), (["--version"], ""), (["--version"], "1")],
    ids=["text", "a table", "the version", "the version as it is printed"],
)
def test_a_reader_that_left_is_not_complained_about(argv, unbuffered):
    read, write = os.pipe()
    os.close(read)
    command, environment = [sys.executable, "-m", "armload", *argv], {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    try:
        done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, env=environment)
    finally:
        os.close(write)
    assert (done.returncode, done.stderr) == (141, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full to write to")
def test_a_full_disk_is_one_sentence():
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-m", "armload", "--help"], stdout=full, stderr=subprocess.PIPE)
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1


def test_a_terminal_without_greek_still_gets_the_answer():
    done = run("motion", "show", "taie2024", env=os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"})
    assert done.returncode == 0
    assert "-0.852" in done.stdout


@pytest.mark.parametrize(
    ("code", "allowed"),
    [
        ("import armload", set()),
        ("import armload.app.cli; armload.app.cli.main(['--help'])", set()),
        ("import armload.app.cli; armload.app.cli.main(['identify', '--help'])", set()),
        (
            "import armload.app.cli; armload.app.cli.main(['identify', 'none.csv', '--robot', 'panda'])",
            {"numpy", "pinocchio"},
        ),
    ],
)
def test_nothing_heavy_is_imported_before_it_is_needed(code, allowed):
    listing = "import sys, json; print('\\n' + json.dumps([m for m in sys.modules if '.' not in m]))"
    done = subprocess.run([sys.executable, "-c", f"{code}\n{listing}"], capture_output=True, text=True, check=True)
    loaded = set(json.loads(done.stdout.splitlines()[-1]))
    assert not loaded & ((HEAVY | {"numpy", "pinocchio", "scipy", "rich", "numba"}) - allowed - {"scipy", "numba"})
    assert allowed or not loaded & {"scipy", "numba"}


def test_every_public_name_is_there():
    for name in armload.__all__:
        assert getattr(armload, name) is not None
        assert name in dir(armload)
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = armload.no_such_name


def test_numba_keeps_what_it_compiles_in_a_folder_of_the_user_s_own_where_nothing_else_can_be_written(tmp_path):
    code = "import os; os.access = lambda *_: False; import armload; print(os.environ['NUMBA_CACHE_DIR'])"
    env = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"TMPDIR": str(tmp_path)}

    def folder():
        return Path(
            subprocess.run([sys.executable, "-c", code], env=env, check=True, capture_output=True, text=True).stdout[
                :-1
            ]
        )

    kept = folder()
    assert kept == folder() == tmp_path / f"armload-{os.getuid()}"
    assert kept.stat().st_mode & 0o777 == 0o700
    kept.chmod(0o777)  # anybody could put code there
    other = folder()
    assert other != kept
    assert other.stat().st_mode & 0o777 == 0o700


HOMES = {
    "a home that is unknown": "os.path.expanduser = lambda path: path; Path.expanduser = refuse(RuntimeError)",
    "a home that may not be looked into": "stat = os.stat\n"
    "os.stat = lambda path, **o: refuse(PermissionError)() if '/other/home' in str(path) else stat(path, **o)",
    "no folder for temporary files": "tempfile.gettempdir = refuse(FileNotFoundError)",
}


@pytest.mark.parametrize("case", HOMES)
def test_a_user_without_a_home_or_a_place_for_files_can_import_it(case, tmp_path):
    """As a container's user has none; the system's own answers are played, since the tests may run as root."""
    code = f"""
import os, tempfile
from pathlib import Path
def refuse(error):
    def ask(*_, **__):
        raise error
    return ask
os.access = lambda *_: False
{HOMES[case]}
import armload
print(os.environ.get("NUMBA_CACHE_DIR"))
"""
    env = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")} | {
        "HOME": "/other/home"
    }
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=env | {"TMPDIR": str(tmp_path)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{None if 'temporary' in case else tmp_path / f'armload-{os.getuid()}'}\n"


@pytest.mark.full  # some seconds
def test_who_waits_for_the_compiler_is_told_once_and_not_when_all_is_on_disk(tmp_path):
    code = (
        "import numpy as np; from armload.app.cli.entry import _notes_on_stderr; "
        "from armload.inertia.cholesky import inverse\n"
        "with _notes_on_stderr(): inverse(np.eye(2)); inverse(np.eye(2, dtype=np.float32))"
    )

    def said():
        env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "ARMLOAD_KERNELS": ""}
        return subprocess.run([sys.executable, "-c", code], env=env, check=True, capture_output=True, text=True).stderr

    assert said() == "armload: compiling for this machine, which is done once and takes a while\n"
    assert said() == ""


CLOSED = [pytest.param("2>&-", marks=pytest.mark.full), ">&-"]


@pytest.mark.parametrize("closed", CLOSED)
def test_an_answer_to_a_stream_that_is_closed_is_no_crash(closed):
    """A shell can start a program without standard output or error; Python then has None for them."""
    done = subprocess.run(
        ["sh", "-c", f'"{sys.executable}" -m armload methods {closed}'], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0
    assert "Traceback" not in done.stdout + done.stderr
    assert ("hybrid" in done.stdout) == (closed == "2>&-")


@pytest.mark.parametrize("closed", [pytest.param(">&-", marks=pytest.mark.full), "2>&-"])
def test_a_refusal_to_a_stream_that_is_closed_is_no_crash(closed):
    done = subprocess.run(
        ["sh", "-c", f'"{sys.executable}" -m armload identify no.csv --robot panda {closed}'],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout == ""
