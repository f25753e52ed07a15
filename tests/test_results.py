"""Numbers in the README come from committed results, to the digit."""

import json
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = ROOT / "benchmarks" / "results"


def test_the_readme_s_table_is_that_of_the_committed_benchmark():
    result = json.loads((RESULTS / "benchmark.json").read_text())
    second, end = result["times"].index(1.0), result["times"].index(6.0)

    def cell(population, method, k):
        found = result["populations"][population]["methods"][method]
        error, spread = 1e3 * np.array(found["mae"][k]), 1e3 * found["standard_error"][k][0]
        return f"{error[0]:.0f} ± {spread:.0f} · {error[1:4].mean():.1f} · {error[4:].mean():.1f}"

    columns = (("reference", second), ("reference", end), ("container", second), ("beyond", second))
    for method in ("hybrid", "map-gp", "rls-filter+tare", "training mean", "same-prior least squares"):
        assert f"| {method} | {' | '.join(cell(p, method, k) for p, k in columns)} |" in README


def test_the_readme_s_real_logs_are_those_of_the_committed_benchmark():
    result = json.loads((RESULTS / "real_logs.json").read_text())
    pair, semi = result["ur10e_pair"]["map-gp"], result["panda_semi_real"]
    assert f"{pair['mass_kg']:.2f} ± {pair['half_width_kg']:.2f} kg" in README
    assert f"{result['panda_unloaded_phantom']['hybrid']['mass_kg']:.3f} kg" in README
    for name, digits in (("hybrid, with tare, 6 s", 1), ("hybrid, with tare, 1 s", 0), ("hybrid, 6 s", 0)):
        moment = np.mean(semi[name]["first_moment_g_m"])
        assert f"{semi[name]['mass_g']:.{digits}f} g and {moment:.1f} g·m" in README


def test_the_ablation_of_the_hybrid_is_that_of_the_committed_benchmark():
    page = (ROOT / "docs" / "hybrid.md").read_text(encoding="utf-8")
    found = json.loads((RESULTS / "hybrid_ablation.json").read_text())["rows"]
    for what in ("tare", "no tare"):
        for name in dict.fromkeys(cell["row"] for cell in found):
            cells = [cell for cell in found if (cell["row"], cell["what"]) == (name, what)]
            columns = [
                f"{c['mass_g']:.0f} ± {c['mass_g_se']:.0f} · {c['first_moment_g_m']:.1f} · {c['inertia_g_m2']:.2f}"
                for c in cells
            ]
            width = f"{cells[1]['mass_g_half_width']:.0f} · {cells[1]['inertia_g_m2_half_width']:.1f}"
            assert f"| {name} | {' | '.join(columns)} | {width} |" in page


def test_the_width_of_the_shipped_hybrid_is_that_of_its_training_s_report():
    page = (ROOT / "docs" / "hybrid.md").read_text(encoding="utf-8")
    ratio = np.array(json.loads((RESULTS / "hybrid_panda.json").read_text())["ratio"], dtype=float)
    assert f"mean half-width is {np.nanmean(ratio[:2]):.1f} times" in page
    assert f"up to {np.nanmax(ratio):.1f} in the first tenth" in page
