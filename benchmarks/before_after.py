"""Two versions of armload on the same logs and streams: what they answer, how far off it is, what an update costs.

    python benchmarks/before_after.py --before REV [--seeds 5] [--rounds 5] [--keep FOLDER] [--out FILE]

The version before is a git revision; the version after is the code as it stands. Both run in processes of their own
(before_after_worker.py), with the same interpreter and one thread for linear algebra. Logs and streams are simulated
once, by the code as it stands (before_after_logs.py).

Answers: an episode of every population of the benchmark for each seed, 3 s at 500 Hz, tares of at most 10 s; no
training has used these seeds. Real logs, where ARMLOAD_REAL_DATA has them: what `armload identify --json` says.
Streams: 3 s empty, then 5 s with a payload, at 1 kHz. In being timed the versions take turns; the time of an update is
the least of all rounds, as the work is the same in each and a busy machine only adds to it.

Writes benchmarks/results/before_after.json, which is of the rebuilt estimator (27f4e28), or --out. About half an hour;
fewer seeds are only printed. --keep: the folder in which logs and every finished answer are kept, so that the same
command goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import platform
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from before_after_logs import (
    FIRST_SEED,
    SEEDS,
    STREAM_SEED,
    STREAMS,
    TIMES,
    real_commands,
    write_episodes,
    write_streams,
)
from before_after_table import table

from armload import __version__, read_recording
from armload.inertia import Z95
from armload.recording import GAP
from armload.runtime.atomic import replacing

ROOT = Path(__file__).resolve().parents[1]
RESULT = ROOT / "benchmarks" / "results" / "before_after.json"
WORKER = Path(__file__).with_name("before_after_worker.py")
GROUPS = {"mass_g": slice(0, 1), "first_moment_g_m": slice(1, 4), "inertia_g_m2": slice(4, 10)}
UNITS = dict(zip(("kg", "kg·m", "kg·m²"), GROUPS.values(), strict=True))
ROUNDING = 1e-9  # [kg, kg·m, kg·m²] what was only moved differs by no more
Sources = dict[str, Path]  # the folder with the package of each version: "before", "after"


def checked_out(revision: str, folder: Path) -> Path:
    """The package as of a git revision, with that revision's times: what numba compiled of it stays valid."""
    archive = subprocess.run(("git", "archive", revision, "src"), cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        files.extractall(folder, filter="data")
    return folder / "src"


def environment(source: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(source), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def worked(task: str, folder: Path, version: str, source: Path) -> dict[str, Any]:
    """What a version makes of a task."""
    written = folder / f"{task}-{version}.json"
    subprocess.run((sys.executable, WORKER, task, folder, written), env=environment(source), check=True)
    return json.loads(written.read_text())


def kept(path: Path, made: Callable[[], Any]) -> Any:
    """What was made before and is in the file, or is made now and written there."""
    if not path.is_file():
        value = made()
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(value), encoding="utf-8")
    return json.loads(path.read_text(encoding="utf-8"))


def largest(before: Any, after: Any) -> dict[str, float]:
    """Largest |difference| of phi (…, 10), by unit; infinite where only one version has a finite number."""
    a, b = np.array(before, dtype=float), np.array(after, dtype=float)
    with np.errstate(invalid="ignore"):
        gap = np.where(np.isfinite(a) | np.isfinite(b), np.abs(b - a), 0.0)
    gap[np.isnan(gap)] = np.inf
    return {unit: float(f"{gap[..., part].max(initial=0.0):.3g}") for unit, part in UNITS.items()}


def answers(folder: Path, sources: Sources, seeds: int) -> dict[str, Any]:
    """By how much answers changed; the hybrid's errors and coverage before and after."""
    truth = kept(folder / "truth.json", lambda: write_episodes(folder, seeds))
    found = {version: worked("answers", folder, version, source) for version, source in sources.items()}
    asked: dict[str, list[str]] = {}
    for name, tasks in found["after"].items():
        for key in tasks:
            asked.setdefault(key, []).append(name)
    methods, hybrid = {}, []
    for key, names in asked.items():
        pairs = [[found[version][name][key] for version in sources] for name in names]
        both = [pair for pair in pairs if all("phi" in said for said in pair)]
        methods[key] = {
            "logs": len(names),
            "refused": [sum("refused" in pair[k] for pair in pairs) for k in (0, 1)],
            "answered_by_one": sum(("phi" in a) != ("phi" in b) for a, b in pairs),
            "largest_change": largest(*([pair[k]["phi"] for pair in both] for k in (0, 1))),
            "largest_change_of_std": largest(*([pair[k]["std"] for pair in both] for k in (0, 1))),
            "cpu_s": [round(sum(pair[k]["cpu_s"] for pair in pairs), 1) for k in (0, 1)],
        }
        if key.startswith("hybrid"):
            real = np.array([truth[name][key] for name in names])
            hybrid += [compared(key, t, k, both, real) for k, t in enumerate(TIMES)]
    return {"methods": methods, "hybrid": hybrid, "not_worse": all(line["not_worse"] for line in hybrid)}


def compared(key: str, t: float, k: int, both: list[list[Any]], truth: np.ndarray) -> dict[str, Any]:
    """Errors and coverage [before, after] of the k-th answers; after − before ± its paired standard error."""
    phi, std = (np.array([[said[what][k] for said in pair] for pair in both]) for what in ("phi", "std"))
    error = np.abs(phi - truth[:, None])
    scores = {group: 1e3 * error[..., part].mean(axis=-1) for group, part in GROUPS.items()}
    scores["coverage"] = np.mean(error <= Z95 * std, axis=-1)
    line: dict[str, Any] = {"what": key, "t": t, "logs": len(both), "not_worse": True}
    for score, values in scores.items():
        more = values[:, 1] - values[:, 0]
        mean, se = float(more.mean()), float(more.std(ddof=1) / np.sqrt(len(more)))
        line[score] = [round(float(x), 4) for x in values.mean(axis=0)]
        line[f"{score}_more"], line[f"{score}_more_se"] = float(f"{mean:.3g}"), float(f"{se:.3g}")
        worse = -mean if score == "coverage" else mean - 1e3 * ROUNDING
        line["not_worse"] &= worse <= 2.0 * se
    return line


def real_logs(folder: Path, sources: Sources) -> list[dict[str, Any]]:
    """Mass and half-width [kg] by `armload identify` of real logs, [before, after]."""
    data, out = Path(os.environ.get("ARMLOAD_REAL_DATA", ROOT.parent / "shared" / "data")), []
    if not data.is_dir():
        print(f"real logs not found in {data}: set ARMLOAD_REAL_DATA to their folder", file=sys.stderr)
        return out
    for name, words in real_commands(data, folder).items():
        steps = np.diff(read_recording(words[0]).t)
        line: dict[str, Any] = {"log": name, "pauses_s": round(float(steps[steps > GAP].sum()), 3)}
        line |= {"mass_kg": [], "half_width_kg": []}
        phi = []
        for source in sources.values():
            command = (sys.executable, "-m", "armload", "identify", *words, "--json")
            said = json.loads(subprocess.run(command, env=environment(source), capture_output=True, check=True).stdout)
            phi.append(said["phi"])
            line["mass_kg"].append(round(said["mass"], 5))
            line["half_width_kg"].append(round(0.5 * (said["phi_high"][0] - said["phi_low"][0]), 5))
        out.append(line | {"largest_change": largest(*phi)})
    return out


def streams(folder: Path, sources: Sources, rounds: int) -> dict[str, Any]:
    """What is said along streams, the changes noticed, and what an update costs."""
    write_streams(folder)
    said = {version: worked("follow", folder, version, source) for version, source in sources.items()}
    times: dict[str, list[dict[str, Any]]] = {version: [] for version in sources}
    for _ in range(rounds):
        for version, source in sources.items():
            times[version].append(worked("time", folder, version, source))
    out = {}
    for name in STREAMS:
        before, after = (said[version][name] for version in sources)
        apart = np.abs(np.array(after["phi"]) - before["phi"]).max(axis=1) > ROUNDING
        told = [[(event["kind"], event["t"]) for event in x["events"]] for x in (before, after)]
        out[name] = {
            "largest_change": largest(before["phi"], after["phi"]),
            "differs_from_s": after["t"][int(np.argmax(apart))] if apart.any() else None,
            "doubted_from_s": [before["doubted_from_s"], after["doubted_from_s"]],
            "events": [before["events"], after["events"]],
            "events_equal": told[0] == told[1],
            **{clock: costs([[r[name][clock] for r in times[v]] for v in sources]) for clock in ("thread", "wall")},
            "process_s": [round(min(r[name]["process_s"] for r in times[v]), 3) for v in sources],
        }
    together = [[np.concatenate([r[name]["thread"] for name in STREAMS]) for r in times[v]] for v in sources]
    return {"streams": out, "thread": costs(together)}


def costs(ns: list[Any]) -> dict[str, Any]:
    """Quantiles [µs] of the updates' times [before, after], each update's the least of its rounds; after over before.

    ns: for each version (rounds, updates).
    """
    a, b = (np.array(version) / 1e3 for version in ns)
    out: dict[str, Any] = {}
    for name, q in (("p50", 50), ("p99", 99), ("p99.9", 99.9)):
        pair = [float(np.percentile(x.min(axis=0), q)) for x in (a, b)]
        rounds = np.percentile(b, q, axis=1) / np.percentile(a, q, axis=1)
        out[name] = {"us": np.round(pair, 1).tolist(), "ratio": round(pair[1] / pair[0], 3)}
        out[name]["ratio_by_round"] = np.round(rounds, 3).tolist()
    mean = [float(x.min(axis=0).mean()) for x in (a, b)]
    return out | {"mean": {"us": np.round(mean, 1).tolist(), "ratio": round(mean[1] / mean[0], 3)}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", required=True, metavar="REV", help="the version to compare with")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where to keep what is finished")
    parser.add_argument("--out", type=Path, default=RESULT, metavar="FILE")
    asked = parser.parse_args()
    command = ("git", "rev-parse", asked.before, "HEAD")
    revisions = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    with tempfile.TemporaryDirectory() as name:
        folder: Path = (asked.keep or Path(name)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        if kept(folder / "revisions.json", lambda: revisions) != revisions:
            raise SystemExit(f"{folder} holds answers of other revisions: name another folder")
        sources = {"before": checked_out(asked.before, folder / "before"), "after": ROOT / "src"}
        result = {
            "command": f"python benchmarks/before_after.py --before {asked.before} --seeds {asked.seeds} "
            f"--rounds {asked.rounds}",
            "version": __version__,
            "revisions": revisions,
            "machine": f"{platform.machine()}, {os.cpu_count()} cores",
            "load": round(os.getloadavg()[0], 1),
            "seeds": {"episodes": [FIRST_SEED + k for k in range(asked.seeds)], "streams": STREAM_SEED},
            "online": kept(folder / "online.json", lambda: streams(folder, sources, asked.rounds)),
            "real_logs": kept(folder / "real_logs.json", lambda: real_logs(folder, sources)),
            "answers": answers(folder, sources, asked.seeds),
        }
    print(table(result))
    text = json.dumps(result, indent=1, ensure_ascii=False)
    if asked.seeds >= SEEDS:
        asked.out.write_text(text + "\n", encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
