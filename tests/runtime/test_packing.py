"""What was packed is data: whoever wrote it, nothing of it is called when it is unpacked."""

import numpy as np
import pytest

from armload.arms import Limits
from armload.runtime.packing import Packer, Unpacker
from armload.service.unknown import Link


def _unpacked(objects, arrays=()):
    return Unpacker(objects, list(arrays), {}).value({"object": 0})


def test_named_tuples_and_objects_of_armload_are_the_same_again():
    link, limits = Link("lost", "gone", 2, None, 1.5), Limits(*(np.arange(k, k + 2.0) for k in range(7)))
    packer = Packer({})
    node = packer.node({"link": link, "limits": limits, "both": (link, [limits])})
    again = Unpacker(packer.objects, packer.arrays, {}).value(node)
    assert (again["link"], type(again["link"]), again["both"][0]) == (link, Link, link)
    assert type(again["limits"]) is Limits
    assert again["both"][1][0] is again["limits"]
    assert all(np.array_equal(one, vars(limits)[name]) for name, one in vars(again["limits"]).items())


@pytest.mark.parametrize(
    ("name", "items"),
    [
        ("armload.service.webhook.Webhook", ["http://127.0.0.1:9/x"]),  # would post, from a thread of its own
        ("armload.posterior.worker.Thread", []),  # of another package, which a module of armload has
        ("armload.runtime.packing.Path", ["x"]),  # which that module does not even have
        ("armload.__main__.main", []),  # whose module is the command line
        ("subprocess.Popen", [["true"]]),
        ("armload.service.unknown.Link", ["lost"]),  # with a part of its fields
    ],
)
def test_nothing_that_is_named_in_a_file_is_called(name, items, monkeypatch):
    called = []
    monkeypatch.setattr("armload.service.webhook.Webhook.__init__", lambda *_: called.append("webhook"))
    monkeypatch.setattr("sys.exit", lambda *_: called.append("exit"))
    monkeypatch.setattr("armload.app.cli.main", lambda *_: called.append("main"))
    with pytest.raises(ValueError, match=f"it holds a {name}"):
        _unpacked([["group", name, items]])
    assert called == []
