"""A command never writes over what it reads, and says before it begins what it cannot write."""

import argparse
import importlib
import os
import time
from pathlib import Path

import pytest

from armload.app.cli import main
from armload.app.cli.arguments import OutputFile, OutputFolder
from armload.app.cli.entry import COMMANDS
from armload.app.cli.outputs import check_outputs
from armload.errors import UsageError

# what a command writes is known by these names alone: an option that is new and writes goes here, too
FILES = {"out", "figure", "record", "report", "summary", "page"}
FOLDERS = {"dir", "learn_profiles", "results", "save", "work"}
OUT_IS_FOLDER = {"armload benchmark", "armload dataset", "armload demo", "armload reproduce"}
READ = ["a.csv", "at.csv", "m.json", "r.json", "arm.profile", "arm.urdf", "lab.toml", "s.html", "x.safetensors"]
READY = "0,-0.5,0,-2,0,1.6,0.8"


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with files that commands may read, none of which is sound, and one with logs."""
    monkeypatch.chdir(tmp_path)
    for folder in ("logs/cell", "bag", "data/meta"):
        Path(folder).mkdir(parents=True)
    inside = ["logs/cell/a.csv", "bag/metadata.yaml", "bag/part.db3", "data/meta/info.json", "data/chunk.parquet"]
    for name in [*READ, *inside]:
        Path(name).write_text(f"of {name}")
    Path("list.txt").write_text("# one a line\nlogs/cell/a.csv\n")
    Path("marked.txt").write_text("logs/cell/a.csv\n", encoding="utf-8-sig")
    Path("link.csv").symlink_to("a.csv")
    return tmp_path


@pytest.fixture
def refused(capsys, here):
    """Call main and return the one sentence it must say; no file may have changed, and none may be new."""

    def call(*argv):
        before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
        code = main([str(word) for word in argv])
        out, err = capsys.readouterr()
        assert (code, out, err.count("\n")) == (2, "", 1), err
        assert {path: path.read_bytes() for path in here.rglob("*") if path.is_file()} == before
        return err

    return call


def options():
    """(program, action) of every option of every command."""

    def of(parser):
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                for inner in action.choices.values():
                    yield from of(inner)
            elif action.nargs != 0:
                yield parser.prog, action

    for command in COMMANDS:
        yield from of(importlib.import_module(f"armload.app.cli.{command}").parser())


def test_every_option_that_writes_is_looked_at_before_its_command_begins():
    found = 0
    for program, action in options():
        kind = type(action.type("x")) if action.dest in FILES | FOLDERS and callable(action.type) else str
        folder = action.dest in FOLDERS or (action.dest == "out" and program in OUT_IS_FOLDER)
        writes = action.dest in FILES | FOLDERS
        assert kind is ((OutputFolder if folder else OutputFile) if writes else str), (program, action.dest)
        found += writes
    assert found > 25


@pytest.mark.parametrize(
    "words",
    [
        "identify a.csv --robot panda --out a.csv",
        "identify a.csv --robot panda --out ./logs/../a.csv",
        "identify a.csv --robot panda --out link.csv",
        "identify link.csv --robot panda --out a.csv",
        "identify a.csv --robot panda --tare at.csv --out at.csv",
        "identify a.csv --robot panda --profile arm.profile --out arm.profile",
        "identify a.csv --robot panda --tool r.json --out r.json",
        "identify a.csv --robot panda --compensated r.json --out r.json",
        "identify a.csv --robot panda --columns lab.toml --out lab.toml",
        "identify a.csv --robot panda --method x.safetensors --out x.safetensors",
        "identify a.csv --robot arm.urdf --to urdf --out arm.urdf",
        "identify bag --robot panda --out bag/part.db3",
        "identify bag --robot panda --out bag/metadata.yaml",
        "identify data --robot panda --out data/meta/info.json",
        "export r.json --to urdf --out r.json",
        "export r.json --to urdf --plus m.json --out m.json",
        "export r.json --to urdf --minus franka-hand --minus m.json --out m.json",
        "report a.csv --robot panda --out a.csv",
        "report a.csv --robot panda --truth r.json --out r.json",
        "report a.csv --robot panda --model x.safetensors --out x.safetensors",
        "survey logs --robot panda --out logs/cell/a.csv",
        "survey logs/*/*.csv --robot panda --out logs/cell/a.csv",
        "survey @list.txt --robot panda --out logs/cell/a.csv",
        "survey @marked.txt --robot panda --out logs/cell/a.csv",
        "survey @list.txt --robot panda --out list.txt",
        "survey logs --robot panda --tare {arm}.csv --out a.csv",
        "survey report s.html --out s.html",
        "motion export m.json --format csv --out m.json",
        "motion show m.json --figure m.json",
        "motion enrich m.json --robot panda --out m.json",
        f"motion design --robot panda --from {READY} --tare a.csv --out a.csv",
        f"motion design --robot panda --from {READY} --profile arm.profile --out arm.profile",
        "motion random --robot arm.urdf --out arm.urdf",
        "profile a.csv at.csv --robot panda --out at.csv",
        "profile a.csv --robot panda --out arm.profile --update --tool arm.profile",
        "profile show arm.profile --figure arm.profile",
        "train --dataset data --motion m.json --out x.safetensors --report m.json",
        "train --dataset data --out data/chunk.parquet",
        "live a.csv --robot panda --record a.csv",
        "live a.csv --robot panda --tare at.csv --record at.csv",
        "measure sim --robot panda --tare at.csv --out at.csv",
        "measure sim --robot panda --motion m.json --out m.json",
        "reproduce taie2024 --real-log a.csv --page a.csv",
    ],
)
def test_no_command_writes_over_what_it_reads(refused, words):
    assert "would replace what this command reads" in refused(*words.split())


def test_two_outputs_of_a_command_are_two_files(refused, here):
    said = refused("train", "--robot", "panda", "--out", "new.safetensors", "--report", "./new.safetensors")
    assert "is written by another option, too" in said
    assert not (here / "new.safetensors").exists()


def test_the_empty_run_beside_a_designed_motion_is_no_input_either(refused):
    Path("m-empty.json").write_text("of the user")
    words = f"motion design --robot arm.urdf --from {READY} --tare-time 2 --profile m-empty.json --out m.json"
    assert "--tare-time m-empty.json would replace what this command reads" in refused(*words.split())


@pytest.mark.parametrize(
    ("said", "out"),
    [
        ({"log": "a.csv"}, "r.json"),  # an earlier result
        ({"log": "bag"}, "bag/held.json"),  # beside a bag's own files
        ({"paths": ["logs"]}, "logs/survey.csv"),  # the table of an earlier survey, among the logs
        ({"result": "franka-hand"}, "franka-hand"),  # a name that needs no file
        ({"result": "r.json", "name": "a.csv"}, "a.csv"),
        ({"paths": ["s3://logs/*.csv", "@none.txt", "x" * 5000]}, "a.csv"),
    ],
)
def test_what_is_no_input_is_written_over_as_before(here, said, out):
    (here / out).write_text("earlier")
    (here / "logs" / "survey.csv.cells").mkdir()
    check_outputs(argparse.Namespace(**said, out=OutputFile(out)))


@pytest.mark.parametrize(
    "words",
    [
        "identify a.csv --robot panda --out",
        "export r.json --to urdf --out",
        "report a.csv --robot panda --out",
        "survey logs --robot panda --out",
        "motion export taie2024 --format csv --out",
        f"motion design --robot panda --from {READY} --out",
        "motion random --robot panda --out",
        "motion show taie2024 --figure",
        "profile a.csv --robot panda --out",
        "train --robot panda --report",
        "live sim --headless --record",
        "measure sim --out",
        "benchmark --quick --page",
    ],
)
@pytest.mark.parametrize(
    ("name", "reason"),
    [("none/x.json", "there is no folder none"), ("logs", "it is a folder"), ("a.csv/x.json", "there is no folder")],
)
def test_what_cannot_be_written_is_refused_before_anything_is_read(refused, words, name, reason):
    began = time.monotonic()
    said = refused(*words.split(), name)
    assert f"{words.split()[-1]} {name} cannot be written: {reason}" in said
    assert time.monotonic() - began < 1.0


@pytest.mark.parametrize("name", ["/proc/x.json", "/dev/fd/99/x.json"])
def test_a_folder_that_takes_no_file_is_found_by_asking_it(refused, name):
    assert f"--out {name} cannot be written: " in refused("identify", "a.csv", "--robot", "panda", "--out", name)


@pytest.mark.parametrize("words", ["dataset --out", "serve sim --save", "measure sim --dir", "demo --out"])
@pytest.mark.parametrize("name", ["a.csv", "a.csv/in", "/proc/none/in"])
def test_a_folder_that_cannot_be_made_is_refused_before_anything_is_read(refused, words, name):
    assert f"{words.split()[-1]} {name} cannot be written: " in refused(*words.split(), name)


def test_a_folder_that_is_new_is_made_and_streams_are_no_files(here):
    known = argparse.Namespace(log="a.csv", out=OutputFile("/dev/stdout"), save=OutputFolder("new/state"))
    check_outputs(known)
    os.mkfifo("pipe")
    check_outputs(argparse.Namespace(log="pipe", out=OutputFile("pipe")))
    assert not Path("new").exists()
    Path("gone").mkdir()
    os.chdir("gone")
    (here / "gone").rmdir()
    with pytest.raises(UsageError, match="cannot be written"):
        check_outputs(argparse.Namespace(save=OutputFolder("new")))
    os.chdir(here)


@pytest.mark.parametrize("words", ["report a.csv --robot panda --out r.pdf", "survey report s.csv --out s2.csv"])
def test_a_report_is_named_as_a_page(refused, words):
    assert "expected a name that ends in .html" in refused(*words.split())
