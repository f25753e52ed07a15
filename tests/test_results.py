"""Numbers in the README come from committed results, to the digit."""

import json
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = ROOT / "benchmarks" / "results"


def test_the_readme_s_table_is_that_of_the_committed_benchmark():
    result = json.loads((RESULTS / "real_like_arms.json").read_text())
    end, second = result["times"].index(6.0), result["times"].index(1.0)
    for method, mae in result["mae"].items():
        error, spread = 1e3 * np.array(mae), 1e3 * np.array(result["spread"][method])
        row = (
            f"| {method} | {error[end, 0]:.0f} ± {spread[end, 0]:.0f} | {error[end, 1:4].mean():.1f} "
            f"| {error[end, 4:].mean():.1f} | {error[second, 0]:.0f} ± {spread[second, 0]:.0f} |"
        )
        assert row in README


def test_the_readme_s_real_logs_are_those_of_the_committed_benchmark():
    result = json.loads((RESULTS / "real_logs.json").read_text())
    pair, semi = result["ur10e_pair"]["map-gp"], result["panda_semi_real"]
    assert f"{pair['mass_kg']:.2f} ± {pair['half_width_kg']:.2f} kg" in README
    assert f"{result['panda_unloaded_phantom']['hybrid']['mass_kg']:.3f} kg" in README
    for name, digits in (("hybrid, with tare, 6 s", 1), ("hybrid, with tare, 1 s", 0), ("hybrid, 6 s", 0)):
        moment = np.mean(semi[name]["first_moment_g_m"])
        assert f"{semi[name]['mass_g']:.{digits}f} g and {moment:.1f} g·m" in README
