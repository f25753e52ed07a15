"""A process that goes on from a saved state: what was held then may have been exchanged since."""

import json
import select
import time

import pytest

from armload.online import OnlineIdentifier
from armload.payloads import test_payload
from armload.recording import write_recording
from armload.service import ArmSettings
from armload.service.spare import Spare, order

PATIENCE = 120.0  # [s]


def test_what_a_saved_state_holds_is_unconfirmed_until_a_second_has_told(panda, analytic_log, tmp_path):
    held, path = test_payload().parameters, tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, held, duration=4.0))
    settings = ArmSettings(name="left", source=str(path), robot="panda", method="map", loop=True, save=str(tmp_path))
    identifier = OnlineIdentifier(panda, method="map")
    for sample in analytic_log(panda, held, duration=4.0, start=1000.0):
        identifier.update(*sample)
    assert settings.state is not None
    identifier.save(settings.state)
    identifier.close()
    process, answers = Spare([]).take(), []
    assert process.stdout is not None
    try:
        order(process, {"ready": [{"robot": "panda", "method": "map"}]})  # so that its first answer comes soon
        order(process, {"arm": settings.to_dict(), "every": 0.1})
        until = time.monotonic() + PATIENCE
        while not (answers and answers[-1]["known"]):
            assert select.select([process.stdout], [], [], max(0.0, until - time.monotonic()))[0]
            line = json.loads(process.stdout.readline())
            if line.get("mass") is not None:
                answers.append(line)
    finally:
        process.kill()
        process.communicate()
    assert answers[0]["mass"] == pytest.approx(held.mass, abs=0.05)  # it went on from there
    # the line is of a moment 1 s after the first sample, and an answer that is 0.5 s late is `behind`
    assert 0.5 <= answers[-1]["t"] < 1000.0
    assert {line["unknown"] for line in answers[:-1]} <= {"unconfirmed", "behind", "silent"}
