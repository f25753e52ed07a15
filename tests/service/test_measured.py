"""What the page says of recovery, memory and processor time is what was measured."""

import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benchmarks" / "results"
PAGE = " ".join((ROOT / "docs" / "service.md").read_text(encoding="utf-8").split())


def test_the_table_of_recovery_is_the_committed_result():
    found = json.loads((RESULTS / "recovery.json").read_text())
    for told, name in (("with a spare process", "with a spare process"), ("without (`spare = false`)", "without")):
        answer, known, spent = (
            found[f"median {what} [s], {name}"]
            for what in ("to an answer", "to a known answer", "processor time until it is known")
        )
        assert f"| {told} | {answer:.2f} s | {known:.2f} s | {spent:.2f} s |" in PAGE


def test_memory_and_processor_time_are_the_committed_results():
    day, changing, steady = (
        json.loads((RESULTS / f"{name}.json").read_text()) for name in ("soak_50hz", "soak", "soak_steady")
    )
    first, *_ = day["resident [MB]"].values()
    slope, half = day["slope after the first quarter [MB/h]"], day["half-width of its 95 % interval [MB/h]"]
    assert f"{day['hours']:.1f} simulated hours" in PAGE
    assert f"{first:.0f} MB resident after the first minute and {day['last [MB]']:.0f} MB after the last" in PAGE
    assert f"{slope:+.1f} ± {half:.1f} MB an hour" in PAGE
    assert f"{100 * changing['share of a core']:.1f} % of a core where the payload changes" in PAGE
    assert f"{100 * steady['share of a core']:.1f} % where it stays the same" in PAGE


def test_what_a_saved_state_takes_is_the_committed_result():
    cases = json.loads((RESULTS / "saved_states.json").read_text())["cases"]
    for known, words in (("nothing", "With the default method"), ("profile", "With a profile")):
        steady, changing = (cases[f"{known}, {held}"]["mean [MB]"] for held in ("steady", "changing"))
        assert (
            f"{words} a Panda's takes {steady:.0f} MB while the payload stays the same, and {changing:.0f} MB" in PAGE
        )
    slowest = (max(case[f"{what} [s]"] for case in cases.values()) for what in ("saving", "going on"))
    assert "To save one took {:.2f} s at most, to go on from one {:.2f} s".format(*slowest) in PAGE


def test_what_a_spare_process_takes_is_the_committed_result():
    sizes = [
        kill["PSS of arm's and spare process [MB]"]
        for kill in json.loads((RESULTS / "recovery.json").read_text())["with a spare process"]
    ]
    arm, spare = ([each[k] for each in sizes] for k in (0, 1))
    assert f"takes {min(spare)} to {max(spare)} MB beside the arm's {sorted(arm)[len(arm) // 2]} MB" in PAGE
