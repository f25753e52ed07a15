"""Which test stands on each constant that half and double do not move: the constant is set so far off that it is none.

    python benchmarks/guards.py [--only SPEED,JUMP]

The constants are those of which benchmarks/results/sensitivity.json says "nothing" either way. Each is set to a
thousandth and to a thousandfold, and tests are run until one fails: those that its reason names, then those of its
room. A constant that no test stands on is named too: it is a stated prior, or goes.

Written to benchmarks/results/guards.json, whence `sensitivity.py --page` has the tests that it names. About 40 minutes
of one core.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys

import pytest
from script import RESULTS, ROOT, options, say, write
from sensitivity import RESULT, Constant, _times, constants, set_to

FACTORS = {"a thousandth": 1e-3, "a thousandfold": 1e3}
ROOMS = {"online": ["tests/online", "tests/app/test_live.py"], "identification": ["tests/identification"]}


class FirstFailure:
    """Remembers the first test that fails."""

    name: str | None = None

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and self.name is None:
            self.name = report.nodeid.split("[")[0]


def silent(result: dict, constant: Constant) -> bool:
    """Whether neither half nor double changed an answer."""
    tried = result["constants"][constant.name]
    return not any(found["changed"] for factor in ("half", "double") for found in tried[factor].values())


def first_failure(constant: Constant, factor: float, tests: list[str]) -> str | None:
    """The first test that fails with a constant so far off; None: all pass."""
    import armload.app
    import armload.identification.identify_log
    import armload.online.online_identifier  # noqa: F401

    seen = FirstFailure()
    with set_to(constant, _times(constant.value, factor)):
        pytest.main([*tests, "-x", "-q", "--no-header", "-p", "no:cacheprovider"], plugins=[seen])
    return seen.name


def tests_of(constant: Constant) -> list[list[str]]:
    """Tests to try, in this order: those that the reason names, those of the room."""
    named = re.findall(r"test_\w+", constant.reason)
    files = [
        f"{path.relative_to(ROOT)}::{name}"
        for name in named
        for path in sorted((ROOT / "tests").rglob("test_*.py"))
        if f"def {name}(" in path.read_text(encoding="utf-8")
    ]
    return [*([files] if files else []), ROOMS[constant.home.split(".")[0]]]


def main() -> None:
    asked = options(__doc__, only="", one="")
    known = {constant.name: constant for constant in constants()}
    if asked.one:  # a process of its own for each: nothing is left of the constant, and of what the tests made
        name, factor, *tests = asked.one.split(",")
        print("first failure:", json.dumps(first_failure(known[name], float(factor), tests)))
        return
    sensitivity = json.loads(RESULT.read_text())
    path = RESULTS / "guards.json"
    found = json.loads(path.read_text())["constants"] if path.is_file() else {}
    found = {name: found[name] for name in known if name in found and silent(sensitivity, known[name])}
    for name, constant in known.items():
        if not silent(sensitivity, constant) or (asked.only and name not in asked.only.split(",")):
            continue
        found[name] = None
        for tests in tests_of(constant):
            for word, factor in FACTORS.items():
                one = ",".join([name, str(factor), *tests])
                done = subprocess.run(
                    [sys.executable, __file__, "--one", one],
                    cwd=ROOT,
                    capture_output=True,
                    text=True,
                    check=False,
                )
                failed = json.loads(re.findall(r"first failure: (.*)", done.stdout)[-1])
                if failed is not None:
                    found[name] = {"set to": word, "fails": failed.split("::")[-1]}
                    break
            if found[name] is not None:
                break
        say(f"{name}: {found[name]}")
    write("guards", {"constants": found})


if __name__ == "__main__":
    main()
