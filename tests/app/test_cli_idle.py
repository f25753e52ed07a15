"""An option that would change nothing is refused in one sentence, before anything is read or moved."""

import pytest

from armload.app.cli import main

READY = "0,-0.5,0,-2,0,1.6,0.8"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "measure sim --motion taie2024 --tool-speed 0.2",
            "--tool-speed is of a motion that is designed, and --motion",
        ),
        ("measure sim --motion taie2024 --time 1 --tool-speed 0.2", "--time and --tool-speed are of a motion"),
        ("measure ur://192.0.2.1 --robot ur10e --speed 0.5", "--speed is of the simulator, and the source is ur://"),
        ("measure fr3://192.0.2.1 --payload test.json --seed 3", "--payload and --seed are of the simulator"),
        ("measure sim --mounted nothing --undetermined-inertia", "--mounted and --undetermined-inertia are of --apply"),
        ("measure sim --columns t=clock --rate 100", "--columns and --rate are of the log of --tare"),
        ("measure sim --tare empty.csv --grip true", "--grip is of mounting the payload, and with --tare it is on"),
        ("ros2 node --robot panda --columns t=clock", "--columns is of the log of --tare"),
        ("motion check taie2024 --robot panda --rate 100", "--rate is of a log, and none is named"),
        ("motion check taie2024 --robot panda --tare random:1 --tare-columns none", "--tare-columns is of a log"),
        (f"motion design --robot panda --from {READY} --episode 3 --out m.json", "--episode is of a log"),
        (f"motion design --robot panda --from {READY} --tare none --columns t=a --out m.json", "--columns is of a log"),
        ("report log.csv --robot panda --runs 3 --seed 1 --out r.html", "--runs and --seed are of --dataset"),
        ("report --dataset data --truth test --frame panda_link7 --out r.html", "--frame and --truth are of a LOG"),
        ("report --dataset data --rate 100 --out r.html", "--rate is of a LOG"),
        ("profile day.csv --robot panda --out arm.profile --figure f.png", "--figure is of armload profile show"),
        ("profile day.csv --robot panda --out arm.profile --tare-columns none", "unrecognized arguments"),
        ("profile show arm.profile --update --topic /joint_states", "--update and --topic are of learning"),
        ("profile show arm.profile --gravity 0,0,-9.81", "--gravity is of --robot, which is not given"),
    ],
)
def test_an_option_that_would_change_nothing_is_refused(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words.split()) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1), err
    assert said in err
    assert list(tmp_path.iterdir()) == []


def test_what_an_option_says_is_asked_only_where_it_counts(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for words, said in (
        ("measure sim --tare none.csv --rate 100", "none.csv does not exist"),
        (
            f"motion design --robot panda --from {READY} --tare none.csv --rate 100 --out m.json",
            "none.csv does not exist",
        ),
        ("report log.csv --robot panda --frame panda_link7 --rate 100 --out r.html", "log.csv does not exist"),
        ("profile show none.profile --robot panda --gravity 0,0,-9.81", "no profile at none.profile"),
    ):
        assert main(words.split()) == 2
        assert said in capsys.readouterr().err
