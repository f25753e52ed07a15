"""`armload methods`: the catalogue of estimators, when to use each, and what is left out."""

from __future__ import annotations

import argparse

from armload.app.cli.parser import Parser
from armload.app.cli.printing import console, print_json, table

_EXAMPLES = """\
examples:
  armload methods
  armload methods --json
  armload identify run.csv --robot panda --method rls-filter
"""


def parser() -> Parser:
    """The arguments of `armload methods`."""
    parser = Parser(
        prog="armload methods",
        description="List the methods of identification: when to use each, what it makes of a tare, where it is from.",
        epilog=_EXAMPLES,
    )
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    form.add_argument("--markdown", action="store_true", help="print the page docs/methods.md")
    return parser


def run(options: argparse.Namespace) -> None:
    """Print the catalogue."""
    from armload.identification import DEFAULT, LEFT_OUT, METHODS

    if options.json:
        shown = ("name", "title", "when", "source", "tare", "prior", "needs")
        print_json(
            {
                "methods": [{field: getattr(method, field) for field in shown} for method in METHODS.values()],
                "default": DEFAULT,
                "left_out": [{"what": what, "why": why} for what, why in LEFT_OUT.items()],
            }
        )
        return
    if options.markdown:
        print(page(), end="")
        return
    out = console()
    rows = table("methods, best first", "name", "when to use", "tare", "source", left=4)
    for method in METHODS.values():
        name = method.name + (" (default)" if method.name == DEFAULT else "")
        needs = f"; needs {_NEEDS[method.needs]}" if method.needs else ""
        rows.add_row(name, f"{method.title}\n→ {method.when}{needs}", method.tare, method.source)
    for column, width in zip(rows.columns, (None, 90, None, 44), strict=True):
        column.max_width = width
    out.print(rows)
    left_out = table("left out of the paper's related work (its reference numbers)", "what", "why", left=2)
    for what, why in LEFT_OUT.items():
        left_out.add_row(*(text.replace("[", "\\[") for text in (what, why)))
    for column in left_out.columns:
        column.max_width = 80
    out.print(left_out)


def page() -> str:
    """docs/methods.md: the same catalogue as Markdown."""
    from armload.identification import DEFAULT, LEFT_OUT, METHODS

    lines = [
        "# Methods",
        "",
        "Written by `armload methods --markdown`. Every method takes the same log and gives the same ten parameters",
        "with intervals: `armload identify LOG --method NAME`, in Python `METHODS[NAME].make(arm, tare)`. The best",
        "come first. The [benchmark](benchmark.md) and [results on real-like arms](results.md) measure the main ones.",
        "",
        "In most cases do not choose: the default is `hybrid` where one is trained for the arm, else `map-gp`. Take",
        "`map-gp` for a wide and thin payload, and `rls-filter` to compare with published results.",
        "",
        "| name | what it is | when to use it | tare | source |",
        "|---|---|---|---|---|",
    ]
    for method in METHODS.values():
        name = f"`{method.name}`" + (" (default)" if method.name == DEFAULT else "")
        needs = f"; needs {_NEEDS[method.needs]}" if method.needs else ""
        lines.append(f"| {name} | {method.title} | {method.when}{needs} | {method.tare} | {method.source} |")
    lines += [
        "",
        "How a method uses a tare, an earlier log of the same arm:",
        "",
        *(f"- **{name}**: {text}." for name, text in _TARES.items()),
        "",
        *_OWN.splitlines(),
        "",
        "## Left out",
        "",
        "What the paper's related work names (its reference numbers) and armload does not build:",
        "",
        *(f"- **{what}**: {why}." for what, why in LEFT_OUT.items()),
    ]
    return "\n".join(lines) + "\n"


_NEEDS = {"tare": "a tare", "training": "a trained model's file", "motion": "the commanded motion (Python only)"}
_TARES = {
    "own equation": "the tare, on any motion, is one more log in the same equations",
    "virtual calibration": "the method's answer to the tare is subtracted from its answer to the run",
    "same motion": "the tare must follow the run's own motion; it is subtracted sample by sample",
    "none": "the method cannot use one",
}
_OWN = """\
## Your own

A method is an `Identifier`: it says how to forget (`reset`), how to take the next N samples (`_take`), and what
follows from all so far (`_estimate`). Streams (`update`), logs (`run`), a tare (`Tared`) and the comparison with others
follow. This one weighs each joint by its rated torque:

```python
import numpy as np
from armload import RecursiveLeastSquares, arm, simulate, taie2024
from armload.estimators import Estimate, Identifier
from armload.lab.evaluation import EvaluationRun, compare
from armload.payloads import test_payload
from armload.regression import FilteredRegression


class RatedLeastSquares(Identifier):
    name = "rated"

    def __init__(self, arm):
        self.arm, self.rows, self.weights = arm, FilteredRegression(arm), 1.0 / arm.limits.effort**2
        self.reset()

    def reset(self):
        self.rows.reset()
        self.A, self.b, self.count = 1e-9 * np.eye(10), np.zeros(10), 0

    def _take(self, t, q, dq, tau):  # (N,) and three times (N, n)
        r, W = self.rows(t, q, dq, tau)  # r = W·phi, without accelerations
        self.A += np.einsum("j,kja,kjb->ab", self.weights, W, W)
        self.b += np.einsum("j,kja,kj->a", self.weights, W, r)
        self.count += len(t)

    def _estimate(self, t):
        covariance = np.linalg.inv(self.A)
        return Estimate(t, covariance @ self.b, covariance, self.count, self.arm.frame)


panda = arm("panda")
log = simulate(panda, taie2024(), test_payload(), rate=100.0)  # or: read_recording("run.csv", panda)
methods = {"rated": RatedLeastSquares(panda), "rls": RecursiveLeastSquares(panda)}
print(compare(methods, [EvaluationRun(log, test_payload().parameters)]))
```

`armload identify --method` and `armload benchmark` know the names above alone. A method gets one by a row in
`identification/methods.py`."""
