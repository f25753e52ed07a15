"""The study's page: one list of sections, written as Markdown for the docs and as HTML with figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.atomic import replacing
from armload.errors import ReportError
from armload.evaluate import Table
from armload.report import Section, write_report
from armload.study import summary
from armload.study.ablations import ABLATIONS, ablation_table, single_or_mean_table
from armload.study.claims import RULE
from armload.study.counterparts import benchmark_rows, izz_table, real_rows, test_payload_table, training_rows
from armload.study.numbers import PAPER_EPOCHS, Cells, at_end, cap, held_out
from armload.study.statements import RULES
from armload.study.tables import COMMAND, PROTOCOLS, claims_table, main_tables, parameter_table

if TYPE_CHECKING:
    from armload.report.style import Figure  # matplotlib belongs to report

TITLE = "The study of Taie et al. 2024, measured again"
_CAPTIONS = {
    4: "Fig. 4 in our numbers: single-stage training, single samples of the held-out rows.",
    5: "Fig. 5 in our numbers: two-stage training, single samples of the held-out rows.",
    6: "Fig. 6 in our numbers: the test payload in simulation and on real-like arms, at the end of the run.",
    7: "Fig. 7 in our numbers: ensembles and least squares, the test payload on real-like arms.",
    8: "Fig. 8 in our numbers: Izz over time in one run on a real-like arm; what overshoots leaves the picture.",
}
_PAPER_GIVES = """**What the paper gives.** The arm, the kind of motion (eight sinusoids a joint, six seconds), 77
loadings of a slotted container and their masses, 249 788 rows of 32 columns, inputs t, q, dq, tau, five members, one
hidden layer of 500 ReLU units for at most 1000 epochs, unrestricted trees, 70 / 15 / 15 % of the rows, both parts
drawn with replacement for each member, one stage or two.

**What is ours by choice.** The coefficients of the motion (the paper's are not public: a re-design of its form), the
lengths of the container and of its weights, two positions a slot (the paper says both two and three), which 77
loadings, the test payload, 3244 evenly spaced rows a run, MuJoCo in place of Gazebo, Adam with batches of 200 and a
rate of 0.001, training in SI units, and stopping once ten epochs lower the validation loss by less than a
ten-thousandth. Filter gain, forgetting and start of the recursive least squares are ours too: the paper of the
benchmark does not state them.

**No real Panda with a payload was measured.** Its stand-in are arms that differ from their model as real ones do, in
links, friction, offsets and a smooth residual; and, where a log of a real unloaded Panda was at hand, that log with
the test payload's torque added. Read "real robot" in a claim as the paper's, "real-like" as ours."""


def sections(cells: Cells, claims: Sequence[dict[str, Any]], figures: dict[int, Figure] | None = None) -> list[Section]:
    """The study as sections for `write_report`; without figures for Markdown."""
    drawn = figures or {}

    def shown(*numbers: int) -> tuple[tuple[Figure, str], ...]:
        return tuple((drawn[n], _CAPTIONS[n]) for n in numbers if n in drawn)

    return [
        Section("In plain words", "\n\n".join(summary.paragraphs(cells, claims))),
        Section("What was run", _what_was_run(cells) + "\n\n" + _PAPER_GIVES, (test_payload_table(),)),
        Section("Every method under every protocol", _PROTOCOLS, main_tables(cells)),
        Section("Figures 4 to 8", _FIGURES, _figure_tables(cells), shown(4, 5, 6, 7, 8)),
        Section("What drives the result", _ABLATIONS, (*_ablations(cells), single_or_mean_table(cells))),
        Section("Claim by claim", _claims_text(), _claims_tables(claims)),
        Section("Notes on single claims, contradictions of the paper among them", _notes(claims)),
    ]


def write_page(cells: Cells, claims: Sequence[dict[str, Any]], path: str | Path) -> Path:
    """Write the study as Markdown (docs/paper.md); the file appears whole or not at all.

    Args:
        cells: finished cells by name. claims: `evaluate(cells)`. path: the file; its folder must exist.

    Raises:
        ReportError: the file cannot be written.
    """
    lines = [f"# {TITLE}", "", f"Written by `{COMMAND}`; every measured number on this page comes from its cells.", ""]
    for section in sections(cells, claims):
        lines += [f"## {section.title}", "", section.text.strip(), ""]
        lines += [markdown(table) for table in section.tables]
    try:
        with replacing(path) as temporary:
            temporary.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    except OSError as error:
        raise ReportError(f"the page cannot be written to {path}: {error.strerror}; name a file elsewhere") from None
    return Path(path)


def html_report(cells: Cells, claims: Sequence[dict[str, Any]], path: str | Path) -> Path:
    """Write the study as one HTML file with Fig. 4 to 8; raises `ReportError` if it cannot be written."""
    from armload.study.figures import figures

    return write_report(path, sections(cells, claims, figures(cells)), TITLE)


def markdown(table: Table) -> str:
    """A table as Markdown: title, rows, note."""
    if not table.rows:
        return f"**{table.title}**\n\n{table.note}\n"
    rows = [table.columns, ["---"] * len(table.columns), *table.rows]
    lines = ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in rows]
    return f"**{table.title}**\n\n" + "\n".join(lines) + f"\n\n{table.note}\n"


def summary_json(cells: Cells, claims: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The study as numbers: rows, payloads, seeds, command, versions, wall_s, methods, claims; ready for JSON.

    methods: for each cell its specification, cap on epochs, epochs, wall time and, by protocol, `mae` and `spread` of
    the ten parameters [SI].
    """
    methods = {}
    for name, cell in sorted(cells.items()):
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
        "rows": max((cell["rows"] for cell in cells.values()), default=0),
        "payloads": max((cell["payloads"] for cell in cells.values()), default=0),
        "seeds": sorted({cell["spec"]["seed"] for cell in cells.values()}),
        "command": COMMAND,
        "versions": _versions(cells),
        "wall_s": round(sum(cell["wall_s"] for cell in cells.values()), 1),
        "methods": methods,
        "claims": [dict(claim) for claim in claims],
    }


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


_PROTOCOLS = """Read a column against the row `training mean`: a method above it tells nothing of the parameter.
`same-prior least squares` are MAP least squares whose prior is the payloads the ensembles were trained with: what an
ensemble has to beat. Rows split at random put neighbours of every test row, the same payload two milliseconds away,
into the training: that column measures memorising. Payloads held out, payloads outside the container's family and other
motions measure what was learned."""
_FIGURES = """The tables are the figures in numbers. For the test payload the paper does not say which training was
used: mass and first moments come from single-stage ensembles, the inertia from two-stage ones, as the paper found
better."""
_ABLATIONS = """Each table changes one thing; the first rows of a kind are what it is compared with. In SI units the
mass is a hundred times larger than the moments of inertia and dominates both the loss of a network and the splits of
a tree."""


def _figure_tables(cells: Cells) -> tuple[Table, ...]:
    at_end = "Rows split at random; running mean at the end of the run."
    return (
        parameter_table("Fig. 4: single-stage training", training_rows(cells, 1), "Single samples of held-out rows."),
        parameter_table("Fig. 5: two-stage training", training_rows(cells, 2), "Single samples of held-out rows."),
        parameter_table("Fig. 6: simulation and real-like arms", real_rows(cells), at_end),
        parameter_table(
            "Fig. 7: against least squares, real-like arms", benchmark_rows(cells), at_end + " RLS: second half."
        ),
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
    return (
        f"`{COMMAND}` on {data['rows']} rows of {data['payloads']} payloads; {len(cells)} finished cells (one method, "
        f"training and split each), seeds {', '.join(map(str, data['seeds']))}; {data['wall_s'] / 3600:.2f} h of "
        f"computing; {versions}.{capped}"
    )


def _claims_text() -> str:
    criteria = "\n\n".join(f"`{name}`: {rule.criterion}." for name, rule in RULES.items())
    return (
        "Sections V and VI print 62 percentages, repeats included; one of them (99.5 %) stands for four parameters, "
        "which makes 65 rows. The abstract adds 4, the ends of its two ranges. An improvement is 1 − MAE of the better "
        f"over MAE of the worse method.\n\n{RULE}\n\n"
        f"Statements without a number need a criterion; these are ours:\n\n{criteria}"
    )


def _claims_tables(claims: Sequence[dict[str, Any]]) -> tuple[Table, ...]:
    groups = {
        "Training, Fig. 4 and 5": lambda c: c["paper"] is not None and c["where"].startswith("Section V,"),
        "Against the benchmark, Fig. 7": lambda c: c["paper"] is not None and c["where"].startswith("Section V-A"),
        "Conclusion and abstract": lambda c: c["paper"] is not None and c["where"] in ("Section VI", "Abstract"),
        "Statements without a number": lambda c: c["paper"] is None,
    }
    return tuple(claims_table([c for c in claims if belongs(c)], title) for title, belongs in groups.items())


def _notes(claims: Sequence[dict[str, Any]]) -> str:
    by_note: dict[str, list[str]] = {}
    for claim in claims:
        if claim["note"]:
            by_note.setdefault(claim["note"], []).append(claim["id"])
    return "\n\n".join(f"`{'`, `'.join(ids)}`: {note}" for note, ids in by_note.items())
