"""How orders come to the process that moves an arm."""

import json
import os
import time

from armload.devices.reader_process import _Orders

PIECE = 8192  # bytes that have come at a look


def test_a_long_order_is_heard_without_copying_it_at_each_look():
    theirs, ours = os.pipe()
    orders = _Orders(theirs)
    content = {"call": "begin", "arguments": [[0.1234567890123] * 1_500_000]}  # some minutes of motion, 25 MB
    text = (json.dumps(content) + '\n{"call": "stop"}\n').encode()
    begun = time.thread_time()
    json.loads(text.split(b"\n")[0])
    once = time.thread_time() - begun
    begun, heard = time.thread_time(), []
    for k in range(0, len(text), PIECE):
        os.write(ours, text[k : k + PIECE])
        heard += orders.waiting()
    taken = time.thread_time() - begun
    os.close(ours)
    assert list(orders.waiting()) == []
    assert orders.ended
    os.close(theirs)
    assert heard == [content, {"call": "stop"}]
    assert taken < 3.0 * once + 1.0  # all that had come, copied at each of 3000 looks: many seconds
