"""A Ctrl-C is held back, not lost."""

import signal

import pytest

from armload.runtime.interruption import held_back, put_off


@pytest.fixture(autouse=True)
def _interruptible():
    """Ctrl-C as in a terminal: what a shell has begun in the background ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interruption_that_a_module_would_swallow_comes_afterwards():
    def swallows():
        try:
            signal.raise_signal(signal.SIGINT)
        except BaseException:  # as optional imports of others do
            return "lost"
        return "went on"

    said = []
    with pytest.raises(KeyboardInterrupt), held_back():
        said.append(swallows())
    assert said == ["went on"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_under_nohup_a_closed_terminal_stays_ignored_while_other_signals_are_held_back():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with held_back() as interruption:
            signal.raise_signal(signal.SIGHUP)
        assert interruption.name is None
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_whoever_stops_what_a_shell_runs_in_the_background_is_heard(number):
    before = signal.signal(number, signal.SIG_IGN)
    try:
        with pytest.raises(KeyboardInterrupt), held_back() as interruption:
            signal.raise_signal(number)
        assert interruption.name == signal.Signals(number).name
        assert signal.getsignal(number) == signal.SIG_IGN
    finally:
        signal.signal(number, before)


def test_an_interruption_of_what_must_be_whole_reaches_its_own_handler_once_that_is_done():
    said = []
    before = signal.signal(signal.SIGTERM, lambda *_: said.append("its handler"))
    try:
        with put_off():
            signal.raise_signal(signal.SIGTERM)
            said.append("whole")
        assert said == ["whole", "its handler"]
        with pytest.raises(KeyboardInterrupt), put_off():
            said.append(signal.raise_signal(signal.SIGINT))
        assert said[-1] is None  # it was not broken off
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGTERM, before)


def test_an_interruption_that_is_ignored_stays_so_while_something_must_be_whole():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with put_off():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
