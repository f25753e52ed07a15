"""What docs/motion.md says was measured."""

import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "motion.md").read_text(encoding="utf-8")


def result(name):
    return json.loads((ROOT / "benchmarks" / "results" / f"{name}.json").read_text(encoding="utf-8"))


def test_the_tables_of_designed_motions_are_those_of_the_committed_benchmark(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from designed_motions import table

    found = result("designed_motions")["arms"]
    assert {"panda", "ur10e"} <= found.keys()
    for rows in found.values():
        assert table(rows) in PAGE


def test_what_became_of_the_requests_is_what_was_counted_and_none_was_rejected(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from motion_requests import sentence

    found = result("motion_requests")
    assert sentence(found) in PAGE
    assert found["designed"] + found["refused"] == found["requests"]
    assert found["rejected"] == []


def test_the_table_of_promises_is_that_of_the_committed_benchmark(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from kept_promises import table

    found = result("kept_promises")["rows"]
    assert {name.split(",")[0] for name in found} == {"panda", "ur10e"}
    assert table(found) in PAGE
    kept, worlds = result("kept_promises")["kept"], sum(row["worlds"] for row in found.values())
    assert f"{100 * kept:.0f} % of the {worlds} worlds together" in " ".join(PAGE.split())
    assert min(row["kept"] for row in found.values()) >= 0.9  # what `--until` relies on


def test_the_table_of_ways_to_the_start_is_that_of_the_committed_benchmark(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from ways_to_start import table

    assert table(result("ways_to_start")["arms"]) in PAGE


def test_what_an_enriched_path_tells_is_on_the_page_and_is_at_most_half_of_what_was_left_open(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from designed_motions import enriched_sentence

    found = result("enriched_path")["arms"]
    assert enriched_sentence(found) in PAGE
    assert all(max(one["ratio"]) <= 0.5 for one in found.values())


def test_what_limits_motor_currents_is_what_was_measured(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from motor_side_limits import in_words, tables

    found, words = result("motor_side_limits"), " ".join(PAGE.split())
    for text in tables(found["removed"], found["ways"]).values():
        assert text in PAGE
    removed, ways = found["removed"], found["ways"]
    assert f"on {found['worlds']} other simulated UR10e" in words
    mass, *others = in_words(removed["gain, load, friction"]["error"]).split(" · ")
    assert f"the error is {mass} g · {' · '.join(others)}" in words
    mass, *others = in_words(found["bound"]["nothing"]).split(" · ")
    assert f"is {mass} g · {' · '.join(others)}" in words
    # what the page says in words: the empty run takes these out, those are in proportion to the load, a weight halves
    for gone in ("residual", "links", "sensors"):
        assert abs(removed[gone]["error"][0] / removed["nothing"]["error"][0] - 1.0) < 0.05
    assert removed["gain, load"]["error"][0] < 0.6 * removed["nothing"]["error"][0]
    assert ways["weight"]["error"][0] < 0.55 * ways["as designed"]["error"][0]
    assert ways["both sides"]["error"][0] > ways["as designed"]["error"][0]


def test_the_table_of_processor_times_is_that_of_the_committed_benchmark(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from design_time import table

    found = result("design_time")["arms"]
    assert table(found) in PAGE
    assert all(each["design"] < 10.0 and each["nudge"] <= 1.0 for each in found.values())


def test_how_far_off_a_centre_of_mass_is_and_in_how_many_worlds_is_what_was_measured():
    panda, ur = (result("designed_motions")["arms"][name] for name in ("panda", "ur10e"))
    words = " ".join(PAGE.split())
    assert f"{panda['poses']['worlds']} worlds of the Panda and {ur['poses']['worlds']} of the UR10e" in words
    for name, text in (
        ("poses", "{:.2g} mm (UR10e: {:.2g} mm) with four static poses"),
        ("designed same", "{:.2g} mm ({:.2g} mm) with the designed 2 s"),
        ("pair", "{:.2g} mm ({:.2g} mm) with an empty run of its own"),
    ):
        assert text.format(1e3 * panda[name]["centre"], 1e3 * ur[name]["centre"]) in words


def test_how_good_a_designed_pair_is_and_how_soon_is_what_was_measured():
    panda, words = result("designed_motions")["arms"]["panda"], " ".join(PAGE.split())
    same, own = (
        " · ".join(f"{1e3 * x:.2g}" for x in panda[name]["error"]["2.0"]) for name in ("designed same", "pair")
    )
    assert f"The designed 2 s leave {same}, or {own} with an empty run of its own" in words
    soon, mostly = (panda["designed same"][f"reached_{which}_s"] for which in ("median", "90"))
    assert f"is reached in {soon:g} s (90 %: {mostly:g} s)" in words
    assert f"reaches it in {100 * panda['excitation']['reached_share']:.0f} % of the worlds" in words
    assert mostly * 3.0 < 6.0
    assert panda["excitation"]["reached_median_s"] is None


def test_in_how_many_worlds_a_motion_reaches_the_accuracy_is_what_was_measured():
    words = " ".join(PAGE.split())
    panda, ur = (
        {name: round(100 * found["reached_share"]) for name, found in result("designed_motions")["arms"][arm].items()}
        for arm in ("panda", "ur10e")
    )
    elsewhere = {
        name: share for name, share in panda.items() if name not in {"designed same", "pair"} and "pair" not in name
    }
    long = elsewhere.pop("designed 3 s")
    assert (
        f"`taie2024` reaches it in {elsewhere['excitation']} % of the worlds within 6 s, the designed 3 s in {long} %"
        in words
    )
    assert f"none of the others in more than {max(elsewhere.values())} %" in words
    assert "No motion reaches the accuracy within 6 s in any of the worlds" in words
    assert set(ur.values()) == {0}
    bound = [
        result("designed_motions")["arms"]["ur10e"][name]["predicted_over_given"] for name in ("designed same", "pair")
    ]
    assert all(abs(found[0] - 0.25) < 0.03 for found in bound)


def test_what_the_quickest_ways_would_save_is_what_was_measured():
    arms = result("ways_to_start")["arms"]
    panda, ur = ([arms[name][way]["duration"] for way in ("ruckig", "quintic")] for name in ("panda", "ur10e"))
    assert abs(panda[0] / panda[1] - 7 / 10) < 0.03
    assert abs(ur[0] / ur[1] - 5 / 6) < 0.03
    assert all(slow - quick < 0.5 for quick, slow in (panda, ur))  # [s], in the median
    assert all(set(found["one only"].values()) == {0} for found in arms.values())  # both ways or neither
