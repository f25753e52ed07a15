"""What an arm does at the moment its controller is told what it holds: at once, and in the steps of `armload serve`.

    python benchmarks/feedback.py [--seeds 2]

The simulated Panda of closed_loop.py (`World.real_like`, joint impedance with inverse dynamics at 1 kHz, libfranka's
example stiffness) holds a payload that nobody declared. A live stream of 6 s with the empty arm's 20 s as the tare
identifies it; then the arm stands, and its controller is told: at once, or by `armload.service.Feedback`, one step
every 0.2 s. Measured while it stands: the largest joint speed, how far the flange is off its place before and after,
and of the external torque that a momentum observer sees, what it is before and after and its largest change within
20 ms. Then the arm follows another motion with what it was told. Writes benchmarks/results/feedback.json and the table
in docs/service.md.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from closed_loop import OBSERVER, PAYLOADS, errors, follow, residual, rms, tare_of
from numpy.typing import NDArray
from scipy.signal import lfilter
from script import ROOT, markdown_table, options, say, write, write_table

from armload.arms import Arm, arm, payload_regressor
from armload.devices import Counted, check_writable
from armload.inertia import InertialParameters
from armload.motion import StraightMotion, random_motion
from armload.online import OnlineIdentifier
from armload.regression import FilteredRegression
from armload.service.feedback import PAUSE, Feedback
from armload.simulation import JointImpedance, Sensors, World, torque_controlled

BEFORE, AFTER = 1.0, 2.0  # [s] it stands before the first step and after the last
WITHIN = 20  # samples, 20 ms


class Standing:
    """The controller of an arm that stands; it keeps what it is told."""

    def __init__(self, robot: Arm) -> None:
        self.robot, self.told = robot, [InertialParameters.zero("panda_link8")]

    def counted(self) -> Counted:
        return Counted([0.0] * 7, 0.0, self.told[-1])

    def put(self, load: Any) -> None:
        how = {"allow_undetermined_inertia": True, "allow_nothing": True}
        self.told.append(check_writable(load, self.robot, moving=False, write=True, **how))

    def done(self) -> None:
        pass

    def close(self) -> None:
        pass


class Switching:
    """A law whose declared payload changes: the last of (time [s], law) that has come."""

    def __init__(self, laws: list[tuple[float, JointImpedance]]) -> None:
        self.laws = laws

    def __call__(self, t: float, q: NDArray, dq: NDArray) -> NDArray[np.float64]:
        return next(law for since, law in reversed(self.laws) if t >= since)(t, q, dq)


def loads_of(robot: Arm, said: Any, q: NDArray) -> list[InertialParameters]:
    """What the controller counts, step by step."""
    controller = Standing(robot)
    feedback = Feedback(robot, controller, InertialParameters.zero(robot.frame), say)
    for _ in range(1000):
        feedback.offer(said, q, True)
        feedback.step()
        if feedback.waits is None:
            return controller.told
    raise SystemExit(f"the controller was never told: {feedback.waits}")


def standing(robot: Arm, world: World, q: NDArray, held: Any, loads: list[InertialParameters], seed: int) -> dict:
    """The arm stands while it is told one load after the other."""
    lasting = BEFORE + PAUSE * len(loads) + AFTER
    motion = StraightMotion(q, q + 1e-9, lasting)
    models = [robot if load.mass == 0.0 else robot.with_payload(load) for load in loads]
    times = [-np.inf, *(BEFORE + PAUSE * k for k in range(len(loads) - 1))]
    laws = [(t, JointImpedance(model, motion)) for t, model in zip(times, models, strict=True)]
    truth = torque_controlled(robot, Switching(laws), q, lasting, held, world=world, settle=2.0).recording
    seen = Sensors.panda(robot).observe(truth, seed)
    off = np.linalg.norm(robot.frame_pose(truth.q)[1] - robot.frame_pose(q[None])[1], axis=1)
    # the observer of the model without a load, and the declared load's torque as the observer takes it in
    still = np.zeros((1, robot.n))
    W = payload_regressor(robot.frame_motion(q[None]), still, still)[0]
    which = np.searchsorted(times, seen.t, side="right") - 1
    load = np.array([robot.in_frame(x).phi for x in loads])[which] @ W.T
    keep = np.exp(-OBSERVER / seen.rate)
    declared = -FilteredRegression(robot, OBSERVER)(seen.t, seen.q, seen.dq, seen.tau)[0]
    declared = declared + lfilter([1.0 - keep], [1.0, -keep], load, axis=0)
    part, begun = seen.t > 0.5, truth.t > 0.0
    jumps = np.abs(declared[part][WITHIN:] - declared[part][:-WITHIN]).max()
    first, last = (part & (seen.t < BEFORE)), seen.t > seen.t[-1] - 1.0
    return {
        "steps": len(loads) - 1,
        "seconds": PAUSE * (len(loads) - 2),
        "fastest_mrad_s": 1e3 * float(np.abs(truth.dq[begun]).max()),
        "off_mm": [1e3 * float(off[truth.t < BEFORE].mean()), 1e3 * float(off[-1000:].mean())],
        "external_Nm": [float(rms(declared[first])), float(rms(declared[last]))],
        "jump_Nm": float(jumps),
    }


def measured(robot: Arm, seed: int) -> list[dict[str, Any]]:
    """All payloads on one arm."""
    world, rows, start = World.real_like(robot, seed), [], time.process_time()
    tare = tare_of(robot, world, seed)
    excitation, work = (random_motion(robot, base + seed, duration=6.0) for base in (2000, 3000))
    for k, (name, held) in enumerate(PAYLOADS.items()):
        log = follow(robot, world, excitation, held, None, 10 * seed + k)[1]
        identifier = OnlineIdentifier(robot, tare)
        for sample in log:
            said = identifier.update(*sample)
        identifier.close()
        q = log.q[-1]
        loads = loads_of(robot, said, q)
        row: dict[str, Any] = {"seed": seed, "payload": name, "told_kg": loads[-1].mass}
        row["at once"] = standing(robot, world, q, held, [loads[0], loads[-1]], seed)
        row["in steps"] = standing(robot, world, q, held, loads, seed)
        for declared, told in (("before", None), ("after", loads[-1])):
            truth, seen = follow(robot, world, work, held, told, 10 * seed + k)
            outside = residual(robot, told, seen)[seen.t - seen.t[0] > 0.3]
            row[declared] = {
                "flange_mm": 1e3 * float(rms(errors(robot, work, truth)[1])),
                "external_Nm": float(rms(outside)),
            }
        rows.append(row)
        say(f"{seed}, {name}: {time.process_time() - start:.0f} s")
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Means over the arms, of the largest the largest."""
    out = []
    for name in PAYLOADS:
        mine = [row for row in rows if row["payload"] == name]
        for how in ("at once", "in steps"):
            got = [row[how] for row in mine]
            off, external = (np.mean([x[key] for x in got], axis=0) for key in ("off_mm", "external_Nm"))
            out.append(
                (
                    name,
                    how,
                    f"{np.mean([x['steps'] for x in got]):.0f}",
                    f"{max(x['fastest_mrad_s'] for x in got):.1f}",
                    f"{max(x['jump_Nm'] for x in got):.2f}",
                    f"{off[0]:.2f} → {off[1]:.2f}",
                    f"{external[0]:.2f} → {external[1]:.2f}",
                )
            )
    columns = (
        "held",
        "told",
        "steps",
        "fastest joint [mrad/s]",
        "largest jump [N·m]",
        "flange off its place [mm]",
        "external torque seen [N·m rms]",
    )
    moving = [np.mean([[row[x][key] for x in ("before", "after")] for row in rows], axis=0) for key in _MOVING]
    said = (
        f"On the motion after it, the flange is off its path by {moving[0][1]:.1f} mm rms instead of "
        f"{moving[0][0]:.1f}, and the external torque seen is {moving[1][1]:.2f} N·m rms instead of {moving[1][0]:.2f}."
    )
    return markdown_table(columns, "llrrrrr", out) + "\n\n" + said


_MOVING = ("flange_mm", "external_Nm")


def main() -> None:
    asked = options(__doc__, seeds=2)
    rows = [row for seed in range(asked.seeds) for row in measured(arm("panda"), seed)]
    write("feedback", {"rows": rows})
    write_table(ROOT / "docs" / "service.md", "feedback", table(rows))


if __name__ == "__main__":
    main()
