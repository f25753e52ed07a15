"""Which cells the study of Taie et al. 2024 has, the most telling first, so that a study cut short still tells much."""

from __future__ import annotations

from dataclasses import replace

from armload.lab.study.basis import Size
from armload.lab.study.spec import SPLITS, Spec

SEEDS = (0, 1, 2)
CAP = 60  # epochs of the networks in further seeds and ablations
BENCHMARKS = (
    "rls",
    "rls-filter",
    "rls-filter-calibrated",
    "rls-filter-calibrated-other",
    "map",
    "map-tare",
    "same-prior",
    "hybrid",
    "hybrid-tare",
)


def plan(size: Size) -> list[Spec]:
    """All cells, in the order in which they are measured; a reduced size shrinks each of them alike."""
    cells = [Spec("benchmark", method, seed=0) for method in BENCHMARKS]
    cells += [Spec("benchmark", "training-mean", split=split, seed=seed) for split in SPLITS for seed in SEEDS]
    tree, network = Spec("tree"), Spec("network", max_epochs=CAP)
    # trees are cheap: all of theirs first
    cells += _main(tree, SEEDS, "ideal")
    cells += _main(replace(tree, scale="standard", ablation="scale"), SEEDS[:1], "ideal")
    cells += _main(tree, SEEDS[:1], "panda")
    # networks with the cap, then the headline without it
    cells += _main(network, SEEDS[:1], "ideal")
    cells += _main(replace(network, scale="standard", ablation="scale"), SEEDS[:1], "ideal")
    cells += _main(network, SEEDS[:1], "panda")
    cells += [Spec("mixed", max_epochs=CAP, scale=s, split=p) for s in ("raw", "standard") for p in SPLITS]
    cells += _main(Spec("network"), SEEDS[:1], "ideal")
    cells += _main(network, SEEDS[1:], "ideal")
    cells += _ablations(tree, network)
    # the paper does not say how it scaled: the headline once more, standardised
    cells += _main(Spec("network", scale="standard", ablation="scale"), SEEDS[:1], "ideal")
    shrunk = [as_small(cell, size) for cell in cells]
    return list({cell.name: cell for cell in reversed(shrunk)}.values())[::-1]  # the first of a name stays


def _main(spec: Spec, seeds: tuple[int, ...], sensors: str) -> list[Spec]:
    """Single and two stages, both splits."""
    return [
        replace(spec, stages=stages, split=split, seed=seed, sensors=sensors)
        for seed in seeds
        for split in SPLITS
        for stages in (1, 2)
    ]


def _ablations(tree: Spec, network: Spec) -> list[Spec]:
    out = []
    for split in SPLITS:
        for base in (replace(tree, split=split), replace(network, split=split)):
            out += [replace(base, drop=("t",), ablation="time"), replace(base, drop=("tau",), ablation="torque")]
            out += [replace(base, members=20, ablation="members")]
    for depth in (4, 8, 12, 16):
        out += [replace(tree, split=split, max_depth=depth, ablation="depth") for split in SPLITS]
    sweep = replace(network, split="payload", scale="standard", ablation="sweep")
    out += [replace(sweep, hidden=hidden) for hidden in (100, 250)]
    out += [replace(sweep, batch=2048), replace(sweep, learning_rate=1e-4), replace(sweep, learning_rate=1e-2)]
    return out


def as_small(spec: Spec, size: Size) -> Spec:
    """A cell with no more epochs, members and hidden neurons than a size has; at full size as it is."""
    if size.max_epochs is None or spec.kind == "benchmark":
        return spec
    small = replace(spec, max_epochs=min(spec.max_epochs, size.max_epochs))
    return replace(small, members=min(spec.members, size.members or 5), hidden=min(spec.hidden, size.hidden or 500))
