"""The study's pages: the first one and its appendix as Markdown for the docs, both as one HTML file with figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from armload.lab.report import Section, write_markdown, write_report
from armload.lab.report.shown import Table
from armload.lab.study import summary
from armload.lab.study.ablations import ABLATIONS, ablation_table, single_or_mean_table
from armload.lab.study.appendix import further_tables
from armload.lab.study.counterparts import (
    benchmark_rows,
    first_table,
    izz_table,
    ratio_table,
    real_rows,
    test_payload_table,
    training_rows,
)
from armload.lab.study.numbers import PAPER_EPOCHS, Cell, Cells, at_end, cap, held_out
from armload.lab.study.plain import against_table, in_plain_words
from armload.lab.study.study_front import front
from armload.lab.study.study_tables import COMMAND, PROTOCOLS, epochs_table, main_tables, parameter_table

TITLE = "The study of Taie et al. 2024, measured again"
APPENDIX = "The study of Taie et al. 2024: all tables"
_PAPER_GIVES = """**What the paper gives.** The arm, the kind of motion (sums of sinusoids in every joint), 77 loadings
of a slotted container and their masses, 249 788 rows of 32 columns, inputs t, q, dq, tau, five members, one hidden
layer of 500 ReLU units for at most 1000 epochs, unrestricted trees, 70 / 15 / 15 % of the rows, both parts drawn with
replacement for each member, one stage or two.

**What is ours by choice.** Eight sinusoids a joint over six seconds (the paper gives neither number; they are those of
its reference [7], as far as that is public), their coefficients (not public: a re-design of the form), the lengths of
the container and of its weights, two positions a slot (the paper says both two and three), which 77 loadings, the test
payload, 3244 evenly spaced rows a run, MuJoCo in place of Gazebo, Adam with batches of 200 and a rate of 0.001,
training in SI units (and once more standardised: the paper does not say), on signals without noise (and once more with
it: the paper does not say what its simulator adds), and stopping once ten epochs lower the validation loss by less than
a ten-thousandth.

**The benchmark** is the paper's reference [7], Kurdas et al., ICRA 2022: RLS on differentiated velocities; the same
with its special filter (`filtered RLS`); and with its virtual calibration: the empty arm is identified on the run's own
motion as if it carried a load, and the answer is subtracted (`filtered RLS calibrated as in [7]`). Our simulated
friction and residual do not depend on the load, so the empty run repeats the arm's mismatch to the last detail: the
best case for this calibration. [7] is said to calibrate across different motions, too: the row `calibrated on another
motion` shows what that comes to on our arms. The real log holds no such run: there both rows are calibrated on another
part of the log and are the same. Filter gain, forgetting and start of the recursion are ours: what is public of [7],
which is all that we know of it, does not state them.

**No real Panda with a payload was measured.** Its stand-in are arms that differ from their model as real ones do, in
links, friction, offsets and a smooth residual. Where a log of a real unloaded Panda was available, it is that log with
the test payload's torque added. Read "real robot" in a claim as the paper's, "real-like" as ours."""


_QUICK = """**This was a quick run: its verdicts mean nothing.** It goes through every table at a small part of the
size, with ensembles hardly trained: it shows that the study runs, not what is true. Run `armload reproduce taie2024`
without `--quick` for numbers."""


def sections(cells: Cells, claims: Sequence[dict[str, Any]]) -> list[Section]:
    """The appendix."""
    return [
        Section("In plain words", in_plain_words(cells), (against_table(cells),)),
        Section("The findings in numbers", "\n\n".join(summary.paragraphs(cells)), (ratio_table(cells),)),
        Section("What was run", _what_was_run(cells) + "\n\n" + _PAPER_GIVES, _run_tables(cells)),
        Section("Every method under every protocol", _PROTOCOLS, main_tables(cells)),
        Section("Figures 4 to 8 in numbers", _FIGURES, _figure_tables(cells)),
        Section("The first time step", _FIRST, (first_table(cells),)),
        Section("What drives the result", _ABLATIONS, (*_ablations(cells), single_or_mean_table(cells))),
        Section("What else the paper's numbers say", _FURTHER, further_tables(cells)),
        Section("Notes on single claims, contradictions of the paper among them", _notes(claims)),
    ]


def pages(page: str | Path) -> dict[str, Path]:
    """The page's own path and that of its appendix, by what they are; pictures are in a folder beside them.

    >>> pages("docs/paper.md")["tables"].as_posix()
    'docs/paper_tables.md'
    """
    page = Path(page)
    return {"page": page, "tables": page.with_name(f"{page.stem}_tables{page.suffix}")}


def write_pages(
    cells: Cells, claims: Sequence[dict[str, Any]], page: str | Path, quick: bool = False
) -> dict[str, Path]:
    """Write the study as Markdown: the page (docs/paper.md) with its pictures, and its appendix; each appears whole.

    Args:
        cells: finished cells by name. claims: `evaluate(cells)`. page: the file; its folder must exist.
        quick: whether the cells are of reduced size.

    Raises:
        ReportError: a file cannot be written.
    """
    from armload.lab.study.paper_figures import figures

    paths = pages(page)
    command = f"{COMMAND}{' --quick' if quick else ''}"
    note = f"Written by `{command}`; every measured number on this page comes from its cells."
    note = f"{_QUICK}\n\n{note}" if quick else note
    first = front(cells, claims, figures(cells, claims), paths["tables"].name)
    write_markdown(paths["page"], first, TITLE, note, pictures=f"pictures/{paths['page'].stem}")
    write_markdown(paths["tables"], sections(cells, claims), APPENDIX, note)
    return paths


def html_report(cells: Cells, claims: Sequence[dict[str, Any]], path: str | Path, quick: bool = False) -> Path:
    """Write the study as one HTML file with Fig. 4 to 8; raises `ReportError` if it cannot be written."""
    from armload.lab.study.paper_figures import figures

    first = [Section("A quick run", _QUICK)] if quick else []
    whole = [*first, *front(cells, claims, figures(cells, claims)), *sections(cells, claims)]
    return write_report(path, whole, TITLE)


def summary_json(cells: Cells, claims: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The study as numbers: rows, payloads, seeds, command, versions, wall_s, methods, claims; ready for JSON.

    wall_s: the sum of the cells' times [s]; cells measured side by side pass in less. methods: for each cell its
    specification, cap on epochs, epochs, wall time and, by protocol, `mae` and `spread` of the ten parameters [SI].
    """
    methods = {}
    for name, cell in sorted(cells.items()):
        if cell["spec"]["kind"] == "rival":
            methods[name] = {**cell["spec"], **cell["setting"], "mae": _rivals_mae(cell), "wall_s": cell["wall_s"]}
            continue
        errors = {p: held_out([cell]) if p == "held_out" else at_end([cell], p) for p in PROTOCOLS}
        methods[name] = {
            "spec": dict(cell["spec"]),
            "cap": cap(cell),
            "epochs": cell.get("epochs"),
            "wall_s": cell["wall_s"],
            "mae": {p: _rounded(e.mean(axis=0)) for p, e in errors.items() if e is not None},
            "spread": {p: _rounded(e.std(axis=0, ddof=1)) for p, e in errors.items() if e is not None and len(e) > 1},
        }
    return {
        "rows": max((cell.get("rows", 0) for cell in cells.values()), default=0),
        "payloads": max((cell.get("payloads", 0) for cell in cells.values()), default=0),
        "seeds": sorted({cell["spec"]["seed"] for cell in cells.values() if "seed" in cell["spec"]}),
        "command": COMMAND,
        "versions": _versions(cells),
        "wall_s": round(sum(cell["wall_s"] for cell in cells.values()), 1),
        "methods": methods,
        "claims": [dict(claim) for claim in claims],
    }


def _rivals_mae(cell: Cell) -> dict[str, list[float]]:
    return {p: _rounded(np.mean(part["second_half"], axis=0)) for p, part in cell["protocols"].items()}


def _rounded(values: Any) -> list[float]:
    return [float(f"{x:.6g}") for x in values]


def _versions(cells: Cells) -> dict[str, str]:
    """Versions behind the cells; where they differ, all of them."""
    seen: dict[str, set[str]] = {}
    for cell in cells.values():
        for name, version in cell.get("versions", {}).items():
            seen.setdefault(name, set()).add(version)
    return {name: ", ".join(sorted(versions)) for name, versions in sorted(seen.items())}


# ---------------------------------------------------------------------- texts


_PROTOCOLS = """Split: what was held out from training, rows drawn at random (the paper's) or whole payloads; epochs:
the cap. The errors of a group are averaged over its parameters. Read a column against the row `training mean`: a method
with a larger error has no information on the parameter. `same-prior least squares` are MAP least squares whose prior
has the mean and covariance of the payloads of the training: what an ensemble has to beat.

`test rows, single samples` are the held-out rows of the simulated data set. Rows split at random put neighbours of
every test row, the same payload two milliseconds away, into the training. This measures memorising. The other columns
are whole runs: the running mean of an ensemble at the end, the mean over the second half for RLS and filtered RLS (as
in [7]), the last estimate of the other least squares. Payloads held out, `other payloads` (outside the container's
family) and `other motions` measure what was learned."""
_FIGURES = """The tables are the figures in numbers. For the test payload the paper does not say which training was
used: mass and first moments come from single-stage ensembles, the inertia from two-stage ones, as the paper found
better."""
_FIRST = """The paper calls its estimates accurate from the first time step. An ensemble answers from the first sample
on. Compare this answer with the training mean, which needs no sample, and with least squares. RLS and MAP
least squares need more than one sample: their first estimate is what they start from, zero (an error of 100 %) or, for
same-prior least squares, the mean of the training payloads. Filtered RLS takes gravity from the first sample, as
these runs start at rest: it has the mass and a part of the first moments, but no inertia."""
_FURTHER = """What the paper's percentages imply without its saying so, where its rivals stay ahead, what averaging
over time brings on payloads that were held out, and every rival with the settings that were found."""
_ABLATIONS = """Each table changes one thing. A row stands below the one it is compared with, which has the same split
and the same cap on epochs. In SI units the mass is a hundred times larger than the moments of inertia and dominates
both the loss of a network and the splits of a tree."""


def _run_tables(cells: Cells) -> tuple[Table, ...]:
    return (test_payload_table(), epochs_table(cells))


def _figure_tables(cells: Cells) -> tuple[Table, ...]:
    rows, at_end = "Single samples of held-out rows.", "Rows split at random; running mean at the end of the run."
    end = at_end + " RLS and filtered RLS: mean over the second half; other least squares: last estimate."
    return (
        parameter_table("Fig. 4: single-stage training", training_rows(cells, 1), rows),
        parameter_table("Fig. 5: two-stage training", training_rows(cells, 2), rows),
        parameter_table("Fig. 6: simulation, real-like arms and a real log", real_rows(cells), at_end),
        parameter_table("Fig. 7: against least squares, real-like arms", benchmark_rows(cells), end),
        izz_table(cells),
    )


def _ablations(cells: Cells) -> tuple[Table, ...]:
    return tuple(ablation_table(cells, name) for name in ABLATIONS)


def _what_was_run(cells: Cells) -> str:
    if not cells:
        return f"Nothing is measured yet: `{COMMAND}` measures it."
    data = summary_json(cells, [])
    caps = sorted({c for cell in cells.values() if (c := cap(cell)) is not None and c < PAPER_EPOCHS})
    capped = (
        ""
        if not caps
        else " Networks trained for further seeds and comparisons are capped at "
        + " or ".join(map(str, caps))
        + " epochs and labelled so: their numbers are not those of the paper's setting."
    )
    versions = ", ".join(f"{name} {version}" for name, version in data["versions"].items())
    counts = ", ".join(f"{PROTOCOLS[p]} {_runs(cells, p)}" for p in PROTOCOLS if _runs(cells, p))
    return (
        f"`{COMMAND}` on {_grouped(data['rows'])} rows of {data['payloads']} payloads; {len(cells)} finished cells "
        f"(one method, training and split each), seeds {', '.join(map(str, data['seeds']))}. The cells took "
        f"{data['wall_s'] / 3600:.2f} h, added up; measured side by side (`--jobs`) they pass in less. Runs on "
        f"which methods are measured: {counts}. Versions: {versions}.{capped}"
    )


def _runs(cells: Cells, protocol: str) -> str:
    """How many runs of a protocol every method has, and how many those that were measured on more arms."""
    parts = [cell["protocols"][protocol] for cell in cells.values() if protocol in cell["protocols"]]
    counts = sorted({len(part.get("second_half", part.get("running", ()))) for part in parts} - {0})
    more = f" ({counts[-1]} for the readings and the rivals)" if counts[1:] else ""
    return f"{counts[0]}{more}" if counts else ""


def _grouped(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def _notes(claims: Sequence[dict[str, Any]]) -> str:
    by_note: dict[str, list[str]] = {}
    for claim in claims:
        if claim["note"]:
            by_note.setdefault(claim["note"], []).append(claim["id"])
    return "\n\n".join(f"`{'`, `'.join(ids)}`: {note}" for note, ids in by_note.items())
