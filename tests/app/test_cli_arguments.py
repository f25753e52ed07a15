"""What holds of the options of every command."""

import argparse
import importlib

import pytest

from armload.app.cli.arguments import centre, gravity, weighed
from armload.app.cli.entry import COMMANDS, main
from armload.app.cli.motion_arguments import box, floor, numbers
from armload.app.cli.parser import attach_values

OF_NUMBERS = (box, centre, floor, gravity, numbers, weighed)


def options_of(parser):
    """Every option of a command, those of its actions among them."""
    for action in parser._actions:
        for inner in action.choices.values() if isinstance(action, argparse._SubParsersAction) else ():
            yield from options_of(inner)
        if action.option_strings:
            yield action


def test_numbers_may_begin_with_a_minus_sign_wherever_they_are_asked_for():
    seen = set()
    for command in COMMANDS:
        for option in options_of(importlib.import_module(f"armload.app.cli.{command}").parser()):
            if option.type in OF_NUMBERS:
                seen.add(option.type)
                assert attach_values([option.option_strings[-1], "-1,0"]) == [f"{option.option_strings[-1]}=-1,0"], (
                    command
                )
    assert seen == set(OF_NUMBERS)


def test_a_pose_may_begin_with_a_negative_angle():
    parser = importlib.import_module("armload.app.cli.measure").parser()
    assert parser.parse_args(attach_values(["sim", "--at", "-0.1,-0.5"])).at == (-0.1, -0.5)


@pytest.mark.parametrize("height", ["nan", "inf", "high", ""])
def test_what_is_no_height_is_refused(height):
    with pytest.raises(argparse.ArgumentTypeError, match="not a height"):
        floor(height)


@pytest.mark.parametrize("names", ["anything", "nothing", "tool and payload", "wide,nothing", "Wide", ""])
def test_a_family_is_a_kind_of_payload_that_somebody_may_know(names, capsys):
    assert main(["identify", "run.csv", "--robot", "panda", f"--family={names}"]) == 2
    said = capsys.readouterr().err
    assert "expected some of boxes, shapes, tools, container, wide, light" in said
    assert "anything, " not in said  # a part of the learned prior, and no kind of payload


@pytest.mark.parametrize("command", COMMANDS)
def test_help_says_of_each_option_what_it_is_and_what_holds_without_it(command):
    for option in options_of(importlib.import_module(f"armload.app.cli.{command}").parser()):
        assert option.help, option.option_strings
        if option.default not in (None, False, argparse.SUPPRESS, [], ()):
            assert "default: " in option.help, option.option_strings


@pytest.mark.parametrize("command", COMMANDS)
def test_no_line_of_help_is_wider_than_a_page(command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    parsers = [importlib.import_module(f"armload.app.cli.{command}").parser()]
    for action in list(parsers[0]._actions):
        parsers += action.choices.values() if isinstance(action, argparse._SubParsersAction) else ()
    for parser in parsers:
        before, _, _ = parser.format_help().partition("examples:")  # a command stays one line
        assert max(map(len, before.split("\n"))) <= 110, parser.prog
