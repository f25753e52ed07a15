"""Who reads a command's notes slowly, or not at all, delays nobody who says them."""

import os
import threading

from armload.app.cli.aside import Aside
from armload.app.cli.printing import notes_aside, print_note


def test_nobody_waits_for_whoever_reads_no_notes(monkeypatch):
    theirs, ours = os.pipe()
    with open(theirs) as read, open(ours, "w") as stderr:
        monkeypatch.setattr("sys.stderr", stderr)
        said = threading.Event()

        def say():
            with notes_aside():
                for k in range(2000):  # more than a pipe holds
                    print_note(f"note {k} {'x' * 200}")
                said.set()

        speaker = threading.Thread(target=say, daemon=True)
        speaker.start()
        in_time = said.wait(30.0)
        for line in read:  # now somebody reads
            if "note 1999 " in line:  # the oldest gave way, the newest did not
                break
        speaker.join(30.0)
        assert in_time
        assert not speaker.is_alive()


def test_lines_are_written_in_their_order_before_it_is_closed():
    written = []
    aside = Aside(written.append)
    for k in range(100):
        aside.put(k)
    aside.close(30.0)
    assert written == list(range(100))
