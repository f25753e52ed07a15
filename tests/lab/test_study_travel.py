"""The paper's protocol on another arm and with other payloads."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from armload.lab.study.basis import QUICK, Basis
from armload.payloads import container_loadings

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def travel(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    return importlib.import_module("study_travel")


@pytest.mark.full  # some seconds
def test_only_arm_and_payloads_differ_between_the_settings(travel, tmp_path):
    bases = [travel.basis_of(tmp_path, setting, 811) for setting in travel.SETTINGS]
    assert [(b.arm.name, b.arm.n) for b in bases] == [("panda", 7), ("ur10e", 6), ("panda", 7)]
    assert {b.size for b in bases} == {bases[0].size}
    assert {len(b.loadings) for b in bases} == {len(container_loadings())}
    names = [[t.name for t in travel.tasks(b, 14)] for b in bases]
    assert names[0] == names[1] == names[2]
    assert len({b.fingerprint for b in bases}) == 3


def test_a_random_family_has_products_of_inertia_and_a_test_payload_of_its_own(tmp_path):
    basis = Basis(tmp_path, QUICK, payloads="boxes")
    phi = np.array([p.parameters.phi for p in basis.loadings])
    assert np.abs(phi[:, 5]).min() > 0.0  # Ixy, which is zero in every loading of the container
    assert np.abs(phi - basis.truth.phi).max(axis=1).min() > 0.0


def test_another_arm_s_data_set_has_its_joints_and_hides_the_right_columns(tmp_path):
    from armload.lab.study.trained import _columns

    basis = Basis(tmp_path, QUICK, robot="ur10e")
    dataset = basis.dataset("ideal")
    assert dataset.X.shape[1] == 1 + 3 * 6
    names = ["t", *(f"{s}{k}" for s in ("q", "dq", "tau") for k in range(6))]
    for signal in ("t", "q", "dq", "tau"):
        assert {name.rstrip("0123456789") for name in names[_columns(signal, 6)]} == {signal}


def test_the_page_shows_the_committed_result_and_says_what_it_says(written):
    page, text, result = written("study_travel_page", "paper_travel.md", "study_travel")
    settings = result["settings"]
    assert page.groups(settings) in text
    assert page.each(settings) in text
    words, parameters = " ".join(text.split()), {c["id"]: c["parameter"] for c in page.load_claims()}

    def counted(name, split, *starts):  # hold, open, reversed
        chosen = [
            found[split][2]
            for key, found in settings[name]["claims"].items()
            if key.startswith(starts) and page.comparable(name, key, parameters)
        ]
        return [chosen.count(wanted) for wanted in (True, None, False)]

    trees = ("fig4-tree-network", "fig5-tree-network")
    arm = [counted("UR10e, container", split, *trees) for split in ("row", "payload")]
    said = [f"{found[0]} of {sum(found)}" for found in arm]
    assert f"{said[0]} percentages hold on rows held out, {said[1]} on payloads held out" in words
    holds, other, reverse = counted("Panda, boxes", "payload", *trees)
    assert f"{holds} of {holds + other + reverse} hold and {reverse} are reversed" in words
    holds, other, reverse = counted("UR10e, container", "row", "fig7-")
    assert f"strongest on the UR10e ({holds} of {holds + other + reverse})" in words
    gains = [
        found[split][0]
        for setting in settings.values()
        for key, found in setting["claims"].items()
        if key.startswith("stages-tree-two")
        for split in ("row", "payload")
    ]
    paper = [c["paper"] for c in page.load_claims() if c["id"].startswith("stages-tree-two")]
    assert f"at most {max(gains):.0f} %, far from the paper's {min(paper):.0f}–{max(paper):.1f} %" in words
    close = {name: setting["claims"]["real-close-tree"]["row"][0] for name, setting in settings.items()}
    said = "(errors {:.1f} times as large on a real-like Panda, {:.1f} on a UR10e, {:.1f} with boxes"
    assert said.format(*close.values()) in words
    far = settings["UR10e, container"]["claims"]["real-close-network"]["row"][0]
    assert f"fails for networks on the UR10e ({far:.0f} times)" in words
