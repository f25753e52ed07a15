"""What a live stream says while what an arm holds changes, or something else happens: delay, misses, mass.

    python benchmarks/events.py [--scenes 16] [--parts steps,ramps_2,...] [--minutes 0] [--seed 90000] [--quick]
                                [--jobs 1]

The default method on real-like Pandas (`World.real_like`, the sensors as measured, 8 % of the samples lost) at 200 Hz,
40 s each, every other one along the published excitation, the rest along random motions; of some scenes there are more
streams (`MORE`). Nothing is held for the first five seconds; then something is taken up and put down in turn, five
seconds or more apart. The streams are made by event_scenes.py.

steps        at once, 0.2 kg and more
ramps_0.1 … ramps_5    within so many seconds
slow         at 0.04 to 0.1 kg/s
standing     the arm stands, from 2 s before to 2 s after
early        at once, 0.3 to 2 s after the stream began
swaps        one payload for another, 0.2 kg apart and more
light        at once, 30 to 200 g
drop         what falls where the arm is quickest
shift        what is held slips by 2 to 6 cm; its mass stays
cycles       the same taken up and put down every half period of the motion, always in the same two poses
rate_25 … rate_1000    at once, at so many samples a second, their distances scattered by a fifth and more
drift        ±0.5 N·m on each joint within 40 s, nothing changes
quiet        nothing changes; every other arm holds a payload since 4 s
pushes       the same, and a person pushes with 10–60 N for 0.3–3 s, at the flange or at the forearm
real         five real logs (Panda, UR10e empty and loaded, UR10, KUKA), payloads' torque added and taken away at once
real_tared   the Panda's log after its first ten seconds, which are the tare
real_motor   the loaded UR10e with the empty one as its tare, and the empty one after its first half, which is the tare
real_as_is   the five real logs as they are

A change counts as noticed with its first event from its beginning until a second after its end, else as missed; of the
missed ones those count as late that have an event within five seconds. All other events are false, but those during a
push and a second after it, which are counted there. *inside* is the share of masses within
their 95 % interval some time after the end. Of all moments, in tenths of a second, `reliability` says how often a
probability was right; event_truth.py says what was true.

Scenes are cells in out/events: a scene measured once is not measured again while `armload.online`, `armload.posterior`,
`armload.regression`, the streams and what is true of them stay as they are. They are measured one of each part in turn;
--minutes: begin none after so many minutes, and tell of those that are there. Written to benchmarks/results/events.json
and from there to docs/online_measured.md; printed only: --quick, two of each part; some --parts; another --seed to
begin with than 90000. Constants were set on others.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from event_scenes import LOOKED, PARTS, RATES, Scene, Stream, streamed
from event_truth import AS_BEFORE, IS_HELD, LEAST, TAKEN_UP, reliability_of, turns_of_held
from scipy.stats import beta, chi2
from script import ROOT, markdown_table, options, say, write, write_table
from threadpoolctl import threadpool_limits

import armload
from armload.lab.cells import key_of
from armload.lab.experiment import Task, run_tasks, source_key
from armload.online import OnlineIdentifier

SEED = 90_000
PAGE = ROOT / "docs" / "online_measured.md"
LATE = 5.0  # [s]
LOOK = 0.02  # [s] between two looks at what is said
MORE = {"ramps_5": 3, "early": 6, "pushes": 6}  # times as many streams: 16 do not tell a share of 5 % from 10 %
NAMES = {
    "steps": "at once, 0.2 kg and more",
    "ramps_0.1": "within 0.1 s",
    "ramps_0.5": "within 0.5 s",
    "ramps_1": "within 1 s",
    "ramps_2": "within 2 s",
    "ramps_5": "within 5 s",
    "slow": "at 0.04 to 0.1 kg/s",
    "standing": "the arm stands",
    "early": "within the first 2 s",
    "swaps": "one for another",
    "light": "30 to 200 g",
    "drop": "dropped in motion",
    "shift": "slips by 2 to 6 cm",
    "cycles": "in step with the motion",
    "rate_25": "25 Hz",
    "rate_50": "50 Hz",
    "rate_100": "100 Hz",
    "rate_500": "500 Hz",
    "rate_1000": "1000 Hz",
    "real": "added to real logs",
    "real_tared": "the real Panda, tared",
    "real_motor": "the real UR10e, tared",
}  # rows of the page


# ---------------------------------------------------------------------- one scene


def measured(scene: Scene) -> dict[str, Any]:
    """One scene as a cell's numbers."""
    return measured_stream(streamed(scene))


def measured_stream(stream: Stream) -> dict[str, Any]:
    """What the default method says of a stream, as a cell's numbers."""
    identifier, said, events, last, turns, was = OnlineIdentifier(stream.robot, stream.tare), [], {}, -np.inf, 0, False
    for sample in stream.log:
        one = identifier.update(*sample)
        turns, was = turns + (one.held != was), one.held
        if one.event is not None:
            events[one.event.t] = one.event.to_dict()
        if one.t - last < 0.999 * LOOK:
            continue
        last = one.t
        back = 0
        if one.event is not None and one.event.kind == "return":
            back = AS_BEFORE if one.event.mass == 0.0 else TAKEN_UP
        said.append(
            (
                *(one.t, one.phi[0], one.low[0], one.high[0], one.interval == "calibrated", one.settling, back),
                *(one.p_held, one.p_change, one.p_contact, one.since, one.held),
            )
        )
    identifier.close()
    table, found = np.array(said, dtype=float), list(events.values())
    t = table[:, 0]
    held = stream.held(t)
    mass = held[:, 0] + (np.nan if stream.base is None else stream.base)
    inside = (table[:, 2] <= mass) & (mass <= table[:, 3])
    left, changes = list(found), []
    for change, counted in zip(stream.changes, stream.counted, strict=True):
        end = change.start + change.seconds
        own = [e for e in left if change.start <= e["t"] < end + 1.0]
        left = [e for e in left if e not in own]
        at = np.minimum(np.searchsorted(t, end + np.array(LOOKED)), len(t) - 1)
        if counted:
            k = np.searchsorted(t, change.start)
            changes.append(
                {
                    "t": change.start,
                    "by": float(change.phi[0] - held[max(k - 1, 0), 0]),
                    "delay": own[0]["t"] - change.start if own else None,
                    "after_end": own[0]["t"] - end if own else None,
                    "events": [(e["kind"], e["mass"]) for e in own],
                    "inside": None if stream.base is None else inside[at].tolist(),
                    "error": None if stream.base is None else (table[at, 1] - mass[at]).tolist(),
                    "half_width": (0.5 * (table[at, 3] - table[at, 2])).tolist(),
                }
            )
    pushes = []
    for push in stream.pushes:
        own = [e for e in left if push.start <= e["t"] < push.end + 1.0]
        left = [e for e in left if e not in own]
        during = (t >= push.start) & (t <= push.end)
        wrong, called = ~inside[during], table[during, 4] == 1.0
        pushes.append(
            {
                "link": push.link,
                "newtons": (newtons := float(np.linalg.norm(push.force))),
                "from_vertical": float(np.degrees(np.arccos(abs(push.force[2]) / newtons))),  # [°]
                "called": [e["kind"] for e in own],
                "calibrated": float(called.mean()),
                "wrong": float(wrong.mean()),
                "wrong_and_calibrated": float((wrong & called).mean()),
                "most_kg": float(np.abs(table[during, 1] - mass[during]).max()),
            }
        )
    every = np.searchsorted(t, np.arange(t[0] + 2.5, t[-1], 0.1))
    return {
        "seconds": float(t[-1] - t[0]),
        "changes": changes,
        "pushes": pushes,
        "false": left,
        "inside": None if stream.base is None else float(inside[every].mean()),
        "calibrated": float(table[every, 4].mean()),
        "calibrated_and_out": None if stream.base is None else float((~inside & (table[:, 4] == 1.0))[every].mean()),
        "reliability": reliability_of(stream, table, held, every),
        "held": None if stream.base is None else turns_of_held(turns, table[:, IS_HELD], mass > LEAST, every),
    }


def code_of_streams(*scripts: str) -> str:
    """What a stream's answers depend on: the rooms of the package that say them, and these scripts."""
    rooms = (Path(armload.__path__[0]) / room for room in ("online", "posterior", "regression"))
    files = sorted(file for room in rooms for file in room.glob("*.py"))
    return source_key(*files, *(Path(__file__).parent / script for script in scripts))


def finished_cells(tasks: list[Task], asked: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """The cells of streams, measured on one thread each, as far as `asked` has them: its cells, jobs and minutes."""
    until = 60.0 * asked.minutes if asked.minutes else None
    with threadpool_limits(1):
        return run_tasks(tasks, asked.cells, jobs=asked.jobs, until=until, say=say)


# ---------------------------------------------------------------------- what the cells say


def share(count: int, total: int) -> dict[str, Any]:
    """A share with its 95 % interval (Clopper and Pearson)."""
    low = beta.ppf(0.025, count, total - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, total - count) if count < total else 1.0
    return {"count": count, "of": total, "low": round(float(low), 4), "high": round(float(high), 4)}


def per_hour(count: int, hours: float) -> dict[str, Any]:
    """A rate with its 95 % interval (Poisson, exact)."""
    low = chi2.ppf(0.025, 2 * count) / 2.0 / hours if count else 0.0
    high = chi2.ppf(0.975, 2 * count + 2) / 2.0 / hours
    rate = {"count": count, "hours": round(hours, 4), "per_hour": round(count / hours, 2)}
    return rate | {"low": round(float(low), 2), "high": round(float(high), 2)}


def late(cell: dict[str, Any]) -> tuple[list[float], list[dict[str, Any]]]:
    """Delays [s] of a scene's changes that were noticed late, and its false events."""
    left, delays = list(cell["false"]), []
    for change in (x for x in cell["changes"] if x["delay"] is None):
        own = [e for e in left if change["t"] <= e["t"] < change["t"] + LATE]
        if own:
            left.remove(own[0])
            delays.append(own[0]["t"] - change["t"])
    return delays, [e | {"scene": cell["name"]} for e in left]


def of_part(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """The changes, pushes and false events of a part."""
    changes, pushes = ([x for cell in cells for x in cell[name]] for name in ("changes", "pushes"))
    lates = [late(cell) for cell in cells]
    after_all, false = [x for delays, _ in lates for x in delays], [x for _, events in lates for x in events]
    inside = [cell["inside"] for cell in cells if cell["inside"] is not None]
    wrong = [x for cell in cells if (x := cell["calibrated_and_out"]) is not None]
    out: dict[str, Any] = {
        "scenes": len(cells),
        "false": per_hour(len(false), sum(cell["seconds"] for cell in cells) / 3600.0) | {"which": false},
        "inside": round(float(np.mean(inside)), 3) if inside else None,
        "calibrated": round(float(np.mean([cell["calibrated"] for cell in cells])), 3),
        "calibrated_and_out": round(float(np.mean(wrong)), 4) if wrong else None,
        "p_change": reliability(cells)["p_change"],
    }
    if told := [cell["held"] for cell in cells if cell["held"] is not None]:
        out["held"] = {what: sum(x[what] for x in told) for what in told[0]}
    if changes:
        missed = [x for x in changes if x["delay"] is None]
        told = [x["inside"] for x in changes if x["inside"] is not None]
        out |= {
            "changes": len(changes),
            "missed": share(len(missed), len(changes)),
            "late": len(after_all),
            "late_s": _quantiles(after_all),
            "missed_kg": sorted(round(x["by"], 3) for x in missed),
            "delay_s": _quantiles([x["delay"] for x in changes if x["delay"] is not None]),
            "delay_after_its_end_s": _quantiles([x["after_end"] for x in changes if x["delay"] is not None]),
            "several_events": sum(len(x["events"]) > 1 for x in changes),
        }
        for k, after in enumerate(LOOKED):
            width = [x["half_width"][k] for x in changes]
            error = [abs(x["error"][k]) for x in changes if x["inside"] is not None]
            out[f"after_{after:g}_s"] = {
                "inside": share(sum(x[k] for x in told), len(told)),
                "error_g": _quantiles(error, 1e3),
                "half_width_g": _quantiles(width, 1e3),
            }
    if pushes:
        out["pushes"] = {
            "called_a_change": share(sum(bool(x["called"]) for x in pushes), len(pushes)),
            "by_link": {
                link: share(sum(bool(x["called"]) for x in pushes if x["link"] == link), n)
                for link in ("panda_link8", "panda_link4")
                if (n := sum(x["link"] == link for x in pushes))
            },
            "called_from_vertical": sorted(round(x["from_vertical"], 1) for x in pushes if x["called"]),
            "calibrated": round(float(np.mean([x["calibrated"] for x in pushes])), 3),
            "wrong_and_calibrated": round(float(np.mean([x["wrong_and_calibrated"] for x in pushes])), 4),
            "most_kg": round(max(x["most_kg"] for x in pushes), 2),
        }
    return out


def _quantiles(values: list[float], unit: float = 1.0) -> dict[str, float] | None:
    if not values:
        return None
    return {f"{q} %": round(unit * float(np.percentile(values, q)), 4) for q in (50, 90, 100)}


def reliability(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """Of the moments called so: how often it was, of all parts together."""
    out = {}
    for name in ("p_held", "p_change", "p_contact"):
        counted = [cell["reliability"][name] for cell in cells if name in cell["reliability"]]
        if not counted:  # nobody says what is held
            continue
        total = np.sum(counted, axis=0)
        out[name] = [
            {"called": round(p / n, 4), "was": round(so / n, 4), "moments": int(n)} for n, p, so in total.tolist() if n
        ]
    return out


def by_mass(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """Of changes after the first half second of a stream: how many are noticed, and how soon, by the kilograms."""
    out = {}
    for name, low, high in (("below_half_a_kilo", 0.0, 0.5), ("half_a_kilo_and_more", 0.5, np.inf)):
        those = [x for cell in cells for x in cell["changes"] if x["t"] >= 0.5 and low <= abs(x["by"]) < high]
        out[name] = {
            "noticed": share(sum(x["delay"] is not None for x in those), len(those)),
            "within_0.4_s": sum(x["delay"] is not None and x["delay"] <= 0.4 for x in those),
            "inside_after_0.5_s": share(sum(x["inside"][0] for x in those), len(those)),
        }
    return out


def is_sound(part: str) -> bool:
    """Whether nobody pushes and the simulated arm stays as it is."""
    return part not in ("pushes", "drift") and not part.startswith("real")


def in_all(parts: dict[str, Any]) -> dict[str, Any]:
    """Of all simulated parts: changes of 0.2 kg and more within half a second; false events where nobody pushes."""
    which = ("steps", "ramps_0.1", "ramps_0.5", "swaps", "drop", "cycles", *RATES)
    quick = [parts[x] for x in which if x in parts]
    sound = [x["false"] for name, x in parts.items() if is_sound(name)]
    told = [x["held"] for name, x in parts.items() if is_sound(name)]
    return {
        "held": {what: sum(x[what] for x in told) for what in told[0]},
        "missed": share(sum(x["missed"]["count"] for x in quick), sum(x["changes"] for x in quick)),
        "false": per_hour(sum(x["count"] for x in sound), sum(x["hours"] for x in sound)),
    }


# ---------------------------------------------------------------------- the page


def show(result: dict[str, Any], page: Path = PAGE) -> None:
    """Put a result between its marks on a page: the table of changes, and what was seen beside them."""
    parts, rows = result["parts"], []
    for name, said in NAMES.items():
        if (part := parts.get(name)) is None:
            continue  # of a result that is older than the part
        after = [part[f"after_{s:g}_s"] for s in LOOKED]
        told = [f"{100 * x['inside']['count'] / x['inside']['of']:.0f}" for x in after]
        rows.append(
            (
                said,
                str(part["changes"]),
                f"{part['missed']['count']}{_of_them_late(part)} (≤ {100 * part['missed']['high']:.0f} %)",
                f"{part['false']['count']} ({part['false']['low']:.1f}–{part['false']['high']:.0f})",
                _seconds(part["delay_s"]),
                _seconds(part["delay_after_its_end_s"]),
                " · ".join(told) + f" of {after[0]['inside']['of']}",
                " · ".join(
                    f"{x['error_g']['50 %']:.0f} ± {x['half_width_g']['50 %']:.0f}" for x in (after[0], after[2])
                ),
            )
        )
    columns = (
        "change",
        "number",
        "missed",
        "false events (an hour)",
        "delay",
        "after its end",
        "inside after " + " · ".join(f"{s:g}" for s in LOOKED) + " s [%]",
        "error ± half-width [g] after 0.5 · 2 s",
    )
    push, drift, quiet, real = (parts[name] for name in ("pushes", "drift", "quiet", "real_as_is"))
    pushed, held = push["pushes"], result["in_all"]["held"]
    hands = [f"{x['count']} of {x['of']}" for x in pushed["by_link"].values()]
    lines = [
        markdown_table(columns, "lrrrrrrr", rows),
        "",
        f"{pushed['called_a_change']['of']} pushes: {pushed['called_a_change']['count']} called a change "
        f"({hands[0]} at the flange, {hands[1]} at the forearm; 95 % interval "
        f"{100 * pushed['called_a_change']['low']:.0f} to {100 * pushed['called_a_change']['high']:.0f} %). "
        f"Answers are called calibrated in {100 * pushed['calibrated']:.0f} % of their time, calibrated and wrong in "
        f"{100 * pushed['wrong_and_calibrated']:.1f} %.",
        "",
        f"A drift of ±0.5 N·m within 40 s: {_events(drift)}, {100 * drift['inside']:.0f} % of the intervals hold, "
        f"{100 * drift['calibrated']:.0f} % are called calibrated. "
        f"Where nothing happens: {_events(quiet)}, {100 * quiet['calibrated']:.0f} % called calibrated. "
        f"The real logs as they are: {_events(real)}.",
        "",
        f"Where nobody pushes and the simulated arm stays as it is, something began or ceased to be held "
        f"{held['should']} times, and `held` turned {held['turned']} times; it was wrong in "
        f"{100 * held['wrong'] / held['moments']:.1f} % of the moments, tenths of a second from 2.5 s on.",
        "",
        "How often a probability was right, over all moments of all scenes, in tenths of a second:",
        "",
        markdown_table(
            ("probability", "moments", "called, on average", "was so"),
            "lrrr",
            [
                (f"`{name}`", str(x["moments"]), f"{100 * x['called']:.1f} %", f"{100 * x['was']:.1f} %")
                for name, found in result["reliability"].items()
                for x in found
            ],
        ),
    ]
    write_table(page, "events", "\n".join(lines))


def _seconds(quantiles: dict[str, float] | None) -> str:
    return "–" if quantiles is None else f"{quantiles['50 %']:.2f} s, {quantiles['90 %']:.2f} s"


def _of_them_late(part: dict[str, Any]) -> str:
    return f", {part['late']} late" if part["late"] else ""


def _events(part: dict[str, Any]) -> str:
    return f"{part['false']['count']} events in {60.0 * part['false']['hours']:.0f} minutes"


def main() -> None:
    asked = options(
        __doc__,
        quick=False,
        parts=",".join(PARTS),
        scenes=16,
        seed=SEED,
        minutes=0.0,
        jobs=1,
        cells=ROOT / "out" / "events",
    )
    code = code_of_streams("event_scenes.py", "event_truth.py")
    parts, scenes = asked.parts.split(","), 2 if asked.quick else asked.scenes
    streams = {part: scenes * (1 if asked.quick else MORE.get(part, 1)) for part in parts}
    if "real_as_is" in streams:
        streams["real_as_is"] = min(scenes, 5)  # there are no more logs
    tasks = []
    for k in range(max(streams.values())):
        for part in (x for x in parts if k < streams[x]):
            scene = Scene(part, asked.seed + k)
            tasks.append(Task.of_one(f"{part}-{scene.seed}", key_of(asdict(scene), code), measured, scene))
    cells = finished_cells(tasks, asked)
    found = {part: [x for name, x in cells.items() if name.rpartition("-")[0] == part] for part in parts}
    result: dict[str, Any] = {"seeds_from": asked.seed, "parts": {part: of_part(x) for part, x in found.items() if x}}
    if "early" in parts:
        result["early"] = by_mass(found["early"])
    result["reliability"] = reliability([x for y in found.values() for x in y])
    if any(map(is_sound, parts)):
        result["in_all"] = in_all(result["parts"])
    if asked.quick or set(parts) != set(PARTS) or asked.seed != SEED:
        print(json.dumps(result, indent=1))
    else:
        write("events", result)
        show(result)


if __name__ == "__main__":
    main()
