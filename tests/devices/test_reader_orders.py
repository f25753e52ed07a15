"""Orders to a reader, as they come through a pipe."""

import json
import os

import pytest

from armload.devices.reader_process import _Orders


@pytest.mark.parametrize("piece", [1, 7, 1000])
def test_orders_are_heard_whole_and_in_their_order_in_whatever_pieces_they_come(piece):
    theirs, ours = os.pipe()
    orders = _Orders(theirs)
    sent = [{"call": "begin", "arguments": [[0.1234567890123] * 300]}, {"call": "stop"}, {"call": "whereabouts"}]
    text = "".join(json.dumps(each) + "\n" for each in sent).encode()
    heard = []
    for k in range(0, len(text), piece):
        os.write(ours, text[k : k + piece])
        heard += orders.waiting()
    assert not orders.ended
    assert list(orders.waiting()) == []
    os.close(ours)
    assert list(orders.waiting()) == []
    assert orders.ended
    os.close(theirs)
    assert heard == sent


def test_what_comes_with_the_first_order_is_heard_after_it():
    theirs, ours = os.pipe()
    orders = _Orders(theirs)
    os.write(ours, b'{"spec": "sim"}\n{"call": "stop"}\n{"call": ')
    assert orders.first() == {"spec": "sim"}
    assert list(orders.waiting()) == [{"call": "stop"}]
    os.write(ours, b'"hold"}\n')
    assert list(orders.waiting()) == [{"call": "hold"}]
    for end in (theirs, ours):
        os.close(end)
