"""Currents, and torque without gravity, of arms that measure motor current: how many logs are refused by that name.

    python benchmarks/torque_forms.py [--logs 30] [--seed 0]

Logs of 3, 6 or 20 s at 200 Hz of a random motion, 0.3 to 1 times as fast as it is drawn, of UR3e, UR5e and UR10e that
differ from their model as real ones do, and of arms beyond those, in turn. They hold nothing in a third, else 0 to 1.2
times the rated payload. Each is asked as it is (sound), with its torque divided by 11 N·m/A (currents), and less the
gravity of the bare arm (without gravity), as a controller that is set to carry nothing reports it; the latter and the
sound logs are asked once more with `--compensated nothing`, which puts gravity back. Called so: refused, by the form's
own name; refused: by any; covered or doubted: refused, or called approximate by `identify`, or with the
mass in its interval, which is that of what was known before where the log does not determine it. In the result stand,
too, the log odds of torque without gravity (`OTHER_FORM`): the most of the sound logs, and the least of those without.
Written to benchmarks/results/torque_forms.json and a table of docs/recordings.md; three minutes of one core.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from bodies import body_of
from script import ROOT, markdown_table, options, say, write, write_table

from armload import Recording, arm, identify
from armload.arms import rated_mass
from armload.errors import RecordingError
from armload.identification import check_plausible
from armload.identification.torque_scale import torque_scale
from armload.motion import random_motion
from armload.recording import with_gravity
from armload.simulation import Sensors, World, simulate

ROBOTS = ("ur3e", "ur5e", "ur10e")
CONSTANT = 11.0  # [N·m/A]
COLUMNS = ("called so", "refused", "covered or doubted")
PUT_BACK = ", compensated"
FORMS = {
    "sound": "",
    "currents": "look like currents",
    "without gravity": "gravity taken out",
    f"without gravity{PUT_BACK}": "",
    f"sound{PUT_BACK}": "gravity in it already",
}


def log_of(robot: str, seed: int) -> tuple[Recording, float]:
    """A sound log, and what it holds [kg]."""
    known, rng = arm(robot), np.random.default_rng([seed, 21])
    mass = rated_mass(known) * float(rng.uniform(0.0, 1.2))
    duration, slower = float(rng.choice([3.0, 6.0, 20.0])), float(rng.uniform(0.3, 1.0))
    world = (World.real_like if seed % 2 else World.beyond)(known, seed)
    motion = random_motion(known, seed + 40, duration=duration / slower)
    payload = body_of(mass, seed) if seed % 3 else None
    how = {"world": world, "sensors": Sensors.of(known), "rate": 200.0, "seed": seed}
    log = simulate(known, motion, payload, duration=duration, **how)
    return log, 0.0 if payload is None else payload.parameters.mass


def as_form(log: Recording, robot: str, form: str) -> Recording:
    """The same log with its torque in another form."""
    if form == "currents":
        return replace(log, tau=log.tau / CONSTANT)
    return replace(log, tau=log.tau - arm(robot).torque(log.q)) if form.startswith("without gravity") else log


def read(log: Recording, robot: str, form: str) -> Recording:
    """A log as `identify` takes it: looked at, and with gravity put back where that is asked for."""
    log = as_form(log, robot, form)
    if form.endswith(PUT_BACK):
        log = with_gravity(log, arm(robot))
    check_plausible(log, arm(robot))
    return log


def refusal(log: Recording, robot: str, form: str) -> str:
    """Why a log is refused; "": it is not."""
    try:
        read(log, robot, form)
    except RecordingError as error:
        return str(error)
    return ""


def is_fine(log: Recording, robot: str, form: str, held: float) -> bool:
    """Whether an answer doubts itself, or holds the mass."""
    answer = identify(read(log, robot, form), arm(robot))
    return answer.interval != "calibrated" or answer.phi_low[0] <= held <= answer.phi_high[0]


def log_odds(log: Recording, robot: str) -> float:
    """Log odds of torque without gravity over torque with it."""
    known = arm(robot)
    with_it, without = torque_scale(log, known), torque_scale(log, known, lacks=known.torque)
    assert with_it is not None
    assert without is not None
    return without.evidence - with_it.evidence


def main() -> None:
    asked = options(__doc__, logs=30, seed=0)
    found: dict[str, dict[str, dict[str, float]]] = {}
    for robot in ROBOTS:
        logs = [log_of(robot, 1000 * asked.seed + k) for k in range(asked.logs)]
        found[robot] = {}
        for form, name in FORMS.items():
            said = [refusal(log, robot, form) for log, _ in logs]
            called = sum(bool(name) and name in text for text in said)
            fine = sum(
                bool(text) or is_fine(log, robot, form, held) for text, (log, held) in zip(said, logs, strict=True)
            )
            counts = {"called so": called, "refused": sum(map(bool, said)), "covered or doubted": int(fine)}
            found[robot][form] = {"logs": len(logs)} | counts
        for form, what, end in (("sound", "most", max), ("without gravity", "least", min)):
            found[robot][form][what] = end(log_odds(as_form(log, robot, form), robot) for log, _ in logs)
        say(f"{robot}: {found[robot]}")
    write("torque_forms", {"seed": asked.seed, "robots": found})
    rows = [
        [robot, form, *(f"{case[what]} of {case['logs']}" for what in COLUMNS)]
        for robot, forms in found.items()
        for form, case in forms.items()
    ]
    for row in rows:
        if not FORMS[row[1]]:
            row[2] = ""
    table = markdown_table(["arm", "torque", *COLUMNS], "llrrr", rows)
    write_table(ROOT / "docs" / "recordings.md", "torque forms", table)


if __name__ == "__main__":
    main()
