"""An arm's process that compiles functions says so, as long as it takes, and is not taken for one that hangs."""

import math
import time
from itertools import pairwise

import numpy as np
import pytest

from armload.app.page import tables
from armload.app.page.status import Watcher
from armload.devices import Source
from armload.payloads import test_payload
from armload.recording import Sample, write_recording
from armload.runtime import compiling
from armload.service import ArmSettings, Session
from armload.service.arm_process import ArmProcess
from armload.service.catching_up import CATCHING_UP, CatchingUp
from armload.service.unknown import Unknown

LASTS = 1.5  # [s]


@pytest.fixture
def compilations(monkeypatch):
    """Those of this process, begun and ended by hand."""
    ours = compiling.Compilations()
    monkeypatch.setattr(compiling, "_ours", ours)
    return ours


def test_functions_are_compiled_while_any_thread_compiles_one_and_a_moment_longer(compilations, monkeypatch):
    assert not compiling.compiling()
    compilations.begin()
    compilations.begin()
    compilations.end()
    assert compiling.compiling()
    compilations.end()
    assert compiling.compiling()  # what waited for it is late
    monkeypatch.setattr(compiling, "_AFTER", 0.0)
    assert not compiling.compiling()


@pytest.mark.full  # some seconds
def test_a_process_that_compiles_after_its_first_answer_speaks_on(panda, analytic_log, tmp_path, compilations):
    write_recording(tmp_path / "run.csv", analytic_log(panda, test_payload().parameters, duration=4.0))
    settings = ArmSettings(name="left", source=str(tmp_path / "run.csv"), robot="panda", method="map")
    process, lines = ArmProcess(settings, 0.1), []
    process._write = lambda fields: lines.append((time.monotonic(), fields))  # what goes to the service
    compiled = []

    def compile_once(update):
        def updated(*sample):
            if sample[0] > 1.0 and not compiled:
                compiled.append(time.monotonic())
                compilations.begin()
                time.sleep(LASTS)
                compilations.end()
            return update(*sample)

        return updated

    made = process._made_session

    def made_session():
        session = made()
        session.identifier.update = compile_once(session.identifier.update)
        return session

    process._made_session = made_session
    process.run()
    (began,) = compiled
    told = [(at, said) for at, said in lines if "known" in said]
    assert (
        max(b - a for (a, _), (b, _) in pairwise(told)) < 0.9
    )  # the service waits ten seconds, on a busy machine, too
    meanwhile = [said for at, said in told if began + 0.8 < at < began + LASTS]
    assert {said["unknown"] for said in meanwhile} == {"compiling"}
    ages = [said["age"] for said in meanwhile]
    assert ages == sorted(ages)
    assert ages[-1] > 0.8
    assert told[-1][1]["unknown"] == "source ended"


def test_what_waited_for_functions_is_caught_up_with_unless_it_comes_no_closer(compilations):
    late = CatchingUp()
    assert late.why(9.0, 0.0) is None  # nothing was compiled: the machine is too busy
    compilations.begin()
    assert late.why(None, 1.0) == compiling.COMPILING
    compilations.end()
    compilations._ended = -math.inf
    assert [late.why(lag, 2.0 + k) for k, lag in enumerate((8.0, 6.0, 3.0, 1.0))] == [CATCHING_UP] * 4
    assert late.why(0.1, 6.0) is None
    assert late.why(9.0, 7.0) is None  # it had caught up: this has another reason
    compilations.begin()
    late.why(9.0, 8.0)
    compilations.end()
    compilations._ended = -math.inf
    assert late.why(9.0, 9.0) == CATCHING_UP
    assert late.why(9.5, 11.5) is None  # and stays behind


class Stuck(Source):
    """Gives one sample, whose answer takes long."""

    name, n, rate = "robot", 7, 100.0

    def __init__(self, arm):
        self.arm = arm

    def __iter__(self):
        q = np.zeros(7)
        yield Sample(0.0, q, q, self.arm.torque(q))

    def close(self):
        pass


def test_the_page_says_that_functions_are_compiled_not_that_the_machine_is_too_busy(panda, compilations):
    session = Session(Stuck(panda), panda, method="map")
    watcher = Watcher(session)
    compilations.begin()
    first = watcher.look()
    assert (first.why.reason, first.gone) == (Unknown.COMPILING, True)
    assert "compiling for this machine" in tables.gone(first)
    compilations.end()
    session.run()
    session.ended = False  # the next sample's answer does not come
    watcher.look()
    compilations.begin()
    late = watcher.look(time.monotonic() + 30.0)
    assert late.why.reason is Unknown.COMPILING
    assert late.waits == "functions (compiling for this machine, which is done once and takes a while)"
    answer = session.estimate
    assert answer is not None
    said = tables.stream("robot", answer.behind(30.0), 0, late.why.reason)
    assert "functions are compiled" in said
    assert "too busy" not in said
    session.close()
