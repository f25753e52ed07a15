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
