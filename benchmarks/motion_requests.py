"""Do designed motions keep to what was asked, by code that shares nothing with the design? Requests at random.

    nice -n 15 python benchmarks/motion_requests.py [--requests 1000] [--first 0] [--thorough] [--page]

Each request draws an arm, a pose, a share of the limits, a payload range, a time, joints, a tare, boxes, a held body,
a floor. Where a motion is designed, it is exported as CSV at 1 kHz and read again; the file's own difference quotients,
Pinocchio's inverse dynamics of the arm with payloads drawn from the range, and distances of capsules in closed form
then say whether it is allowed. A refusal must say which limit stands in the way. Without --thorough the design looks
less long, which changes what a motion tells and not what it may do. Results go to
benchmarks/results/motion_requests.json after every 20 requests, and with --page in a sentence on docs/motion.md.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from script import RESULTS, ROOT, options, say, write, write_table

from armload.arms import ARMS, Arm, arm
from armload.errors import MotionError
from armload.excitation import Constraints, Criterion, Obstacle, PayloadRange, Surroundings, design_motion
from armload.motion import Motion, export_motion, load_motion, save_motion
from armload.motion.collision import capsule_arm

QUICK: dict[str, Any] = {"starts": 1, "stages": ((6, 100.0), (6, 2000.0))}
KEPT = (0.05, 0.01, 0.05)  # [m] from the floor, itself and boxes, or half of what the start has
_SLACK = 1e-6  # of a limit: the file has nine decimals
_ALLOWANCE = 1e-3  # [m] coal's distance of a box, and points on an axis in place of the axis
_POINTS = 15  # on a capsule's axis
_PAYLOADS = 6  # drawn from the range


class Request(NamedTuple):
    """What is asked for."""

    arm: Arm
    start: NDArray[np.float64]
    share: float
    payload: PayloadRange
    surroundings: Surroundings
    joints: NDArray[np.bool_]
    speed: float
    tare: str | None
    times: list[float]

    def constraints(self) -> Constraints:
        """As the design reads it; MotionError where the start is forbidden."""
        return Constraints(
            self.arm,
            self.start,
            share=self.share,
            payload=self.payload,
            surroundings=self.surroundings,
            joints=self.joints,
            speed=self.speed,
        )


def drawn(seed: int, longest: float = 2.5) -> Request:
    """One request."""
    rng = np.random.default_rng([15, seed])
    robot = arm(str(rng.choice(sorted(ARMS))))
    low = np.maximum(robot.limits.position_low, -np.pi)
    high = np.minimum(robot.limits.position_high, np.pi)
    share = float(rng.uniform(0.3, 1.0))
    wide = 1.0 if rng.random() < 0.1 else 0.9 * share  # one in ten may start outside its share
    start = (low + high) / 2 + wide * (high - low) / 2 * rng.uniform(-1, 1, robot.n)
    payload = PayloadRange(float(rng.uniform(0.0, 0.7) * ARMS[robot.name].rated_payload))
    place = robot.frame_pose(start[None])[1][0]
    boxes = []
    for _ in range(int(rng.integers(0, 4))):
        away = rng.normal(size=3)
        edges = rng.uniform(0.05, 0.5, 3)
        centre = place + away / np.linalg.norm(away) * (rng.uniform(0.2, 0.6) + edges.max() / 2)
        boxes.append(Obstacle(tuple(centre.tolist()), tuple(edges.tolist())))
    held = (
        tuple(rng.uniform(0.05, 0.2, 3).tolist()) if rng.random() < 0.3 else (float(rng.choice([0.0, 0.05, 0.1, 0.15])))
    )
    floor = None if rng.random() < 0.3 else float(rng.uniform(-0.8, 0.0))
    joints = rng.random(robot.n) < rng.choice([1.0, 1.0, 0.5])
    joints[rng.integers(robot.n)] = True
    tare = (None, "same", "own")[int(rng.integers(3))]
    times = rng.uniform(0.4, longest, size=2 if tare == "own" else 1).round(2).tolist()
    around = Surroundings(robot, floor, tuple(boxes), held)  # type: ignore[arg-type]
    return Request(robot, start, share, payload, around, joints, float(rng.uniform(0.3, 2.0)), tare, times)


def answered(request: Request, **how: Any) -> tuple[list[Motion], str]:
    """The motions designed, through their files, or why there are none."""
    more = {"tare_time": request.times[1]} if request.tare == "own" else {}
    try:
        found = design_motion(
            request.constraints(), Criterion(request.arm, request.tare), request.times[0], **more, **how
        )
    except MotionError as error:
        return [], str(error)
    motions = []
    with tempfile.TemporaryDirectory() as folder:
        for motion in (found.motion, found.empty):
            if motion is not None:
                save_motion(Path(folder) / "m.json", motion)
                motions.append(load_motion(Path(folder) / "m.json"))
    return motions, ""


def objections(request: Request, motion: Motion, seed: int = 0) -> list[str]:
    """What is wrong with a motion, looked at by other code than the design's and its own check's; empty: nothing."""
    with tempfile.TemporaryDirectory() as folder:
        export_motion(motion, Path(folder) / "m.csv", "csv", rate=1000.0)
        table = np.loadtxt(Path(folder) / "m.csv", delimiter=",", skiprows=1)
    n, robot, limits, s = request.arm.n, request.arm, request.arm.limits, request.share
    t, q, dq = table[:, 0], table[:, 1 : 1 + n], table[:, 1 + n : 1 + 2 * n]
    h = np.diff(t).mean()
    out = []

    def must(name: str, size: NDArray, most: NDArray | float) -> None:
        over = (np.abs(size) / most).max()
        if over > 1.0 + _SLACK:
            out.append(f"{name} {over:.4f} of what is allowed")

    ends = np.abs(dq[[0, -1]]).max()
    if ends != 0.0 or np.abs(q[[0, -1]] - request.start).max() > 1e-9:
        out.append("not at rest at the start pose at both ends")
    if np.abs(q - request.start)[:, ~request.joints].max(initial=0.0) > 1e-9:
        out.append("a joint moves that may not")
    bounded = np.isfinite(limits.position_low) & np.isfinite(limits.position_high)
    low, high = limits.position_low[bounded], limits.position_high[bounded]
    must("position", q[:, bounded] - (low + high) / 2, s * (high - low) / 2)
    must("velocity of the positions", np.diff(q, axis=0) / h, s * limits.velocity)
    must("velocity", dq, s * limits.velocity)
    must("acceleration", np.diff(dq, axis=0) / h, s * limits.acceleration)
    # rounding to nine decimals shows in second differences over 1 ms
    must("jerk", np.maximum(np.abs(np.diff(dq, 2, axis=0)) / h**2 - 4e-9 / h**2, 0.0), s * limits.jerk)
    ddq = np.gradient(dq, h, axis=0)
    rng = np.random.default_rng(seed)
    for k in range(_PAYLOADS):
        offset = rng.choice([-1.0, 1.0], 3) if k % 2 else rng.uniform(-1, 1, 3)
        held = request.payload.payload(1.0 if k % 2 else float(rng.random()), offset)
        must("torque", robot.with_payload(held).torque(q, dq, ddq), s * limits.effort)
    places = robot.frame_pose(q)[1]
    must("tool speed", np.linalg.norm(np.diff(places, axis=0), axis=1) / h, request.speed)
    found = clearances(request.surroundings, q[::5])
    kept = np.minimum(KEPT, 0.5 * clearances(request.surroundings, request.start[None])[0])
    if isinstance(request.surroundings.held, tuple):  # its corners are farther away than it is
        kept = np.minimum(kept, request.surroundings.kept(request.start))
    for what, distance, least in zip(("floor", "itself", "boxes"), found.min(axis=0), kept, strict=True):
        if distance < least - _ALLOWANCE:
            out.append(f"{distance:.4f} m from {what}, {least:.4f} m are to be kept")
    return out


def clearances(around: Surroundings, q: NDArray) -> NDArray[np.float64]:
    """Distance to the floor, of the arm to itself, to boxes (N, 3) [m], without coal; a held box by its corners."""
    robot = around.arm
    box = around.held if isinstance(around.held, tuple) else None
    body = capsule_arm(robot, max(box) / 2 if box else around.held)  # type: ignore[arg-type]
    R, p = robot.link_poses(q)
    R = np.concatenate([np.broadcast_to(np.eye(3), (len(q), 1, 3, 3)), R], axis=1)
    p = np.concatenate([np.zeros((len(q), 1, 3)), p], axis=1)
    ends = [
        [p[:, k] + R[:, k] @ point for point in (a, b)] for k, a, b in zip(body.link, body.start, body.end, strict=True)
    ]
    last = len(ends) - 1 if box else -1
    out = np.full((len(q), 3), np.inf)
    corners = None
    if box:
        F, at = robot.frame_pose(q)
        signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)]) * np.array(box)
        corners = at[:, None] + np.einsum("tij,kj->tki", F, signs)  # (N, 8, 3)
    if around.floor is not None:
        for k in body.above:
            z = corners[:, :, 2] if k == last and corners is not None else np.stack([e[:, 2] for e in ends[k]], axis=1)
            radius = 0.0 if k == last else body.radius[k]
            out[:, 0] = np.minimum(out[:, 0], z.min(axis=1) - radius - around.floor)
    for i, j in body.pairs:
        if last in (i, j):
            continue
        apart = segments_apart(*ends[i], *ends[j]) - body.radius[i] - body.radius[j]
        out[:, 1] = np.minimum(out[:, 1], apart)
    along = np.linspace(0.0, 1.0, _POINTS)[:, None]
    for obstacle in around.boxes:
        for k in np.flatnonzero(body.link > 0):
            held = k == last and corners is not None
            points = corners if held else ends[k][0][:, None] * (1 - along) + ends[k][1][:, None] * along
            off = np.maximum(np.abs(points - np.array(obstacle.centre)) - np.array(obstacle.edges) / 2, 0.0)
            apart = np.linalg.norm(off, axis=2).min(axis=1) - (0.0 if held else body.radius[k])
            out[:, 2] = np.minimum(out[:, 2], apart)
    return out


def segments_apart(a: NDArray, b: NDArray, c: NDArray, d: NDArray) -> NDArray[np.float64]:
    """Distance (N,) of the segments a–b and c–d, (N, 3) each; Ericson, Real-Time Collision Detection, 5.1.9."""
    u, v, w = b - a, d - c, a - c
    A, E, F = (u * u).sum(1), (v * v).sum(1), (v * w).sum(1)
    B, C = (u * v).sum(1), (u * w).sum(1)
    wide = A * E - B * B
    s = np.where(wide > 1e-12, np.clip((B * F - C * E) / np.where(wide > 1e-12, wide, 1.0), 0, 1), 0.0)
    t = np.where(E > 1e-12, (B * s + F) / np.where(E > 1e-12, E, 1.0), 0.0)
    t = np.clip(t, 0, 1)
    s = np.where(A > 1e-12, np.clip((B * t - C) / np.where(A > 1e-12, A, 1.0), 0, 1), 0.0)
    return np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1)


def main() -> None:
    """Draw, design, object."""
    chosen = options(__doc__, requests=1000, first=0, thorough=False, page=False)
    if chosen.page:
        found = json.loads((RESULTS / "motion_requests.json").read_text(encoding="utf-8"))
        write_table(ROOT / "docs" / "motion.md", "motion requests", sentence(found))
        return
    how = {} if chosen.thorough else QUICK
    rejected, refused, designed, seconds, reasons = [], 0, 0, 0.0, {}
    for k in range(chosen.first, chosen.first + chosen.requests):
        request = drawn(k)
        begun = process_time()
        motions, why = answered(request, **how)
        seconds += process_time() - begun
        if not motions:
            refused += 1
            key = reason(why)
            reasons[key] = reasons.get(key, 0) + 1
        else:
            designed += 1
            wrong = [text for motion in motions for text in objections(request, motion, k)]
            if wrong:
                rejected.append({"request": k, "arm": request.arm.name, "objections": wrong})
                say(f"request {k} on {request.arm.name}: {'; '.join(wrong)}")
        if (k + 1) % 20 == 0 or k == chosen.first + chosen.requests - 1:
            say(f"{k + 1 - chosen.first} requests: {designed} designed, {refused} refused, {len(rejected)} rejected")
            RESULTS.mkdir(exist_ok=True)
            write(
                "motion_requests",
                {
                    "requests": k + 1 - chosen.first,
                    "designed": designed,
                    "refused": refused,
                    "refused_for": dict(sorted(reasons.items(), key=lambda item: -item[1])),
                    "rejected": rejected,
                    "cpu_per_request": seconds / (k + 1 - chosen.first),
                },
                None,
            )


def sentence(found: dict[str, Any]) -> str:
    """What was drawn, and what became of it."""
    short = "no motion of"  # so many seconds keeps to the constraints: a sentence of its own for each
    reasons = {name: count for name, count in found["refused_for"].items() if not name.startswith(short)}
    reasons["too little time"] = sum(n for name, n in found["refused_for"].items() if name.startswith(short))
    words = ", ".join(f"{name} {count}" for name, count in reasons.items())
    return (
        f"Of {found['requests']} requests at random (arm, pose, share, payload range, time, joints, tare, boxes,\n"
        f"held body, floor) {found['designed']} led to motions and {found['refused']} were refused\n({words}).\n"
        f"Code that shares nothing with the design or with its check rejected {len(found['rejected'])} of the motions\n"
        "(`python benchmarks/motion_requests.py`)."
    )


def reason(why: str) -> str:
    """The kind of limit that a refusal names."""
    kinds = {
        "outside": "position of the start",
        "to hold the worst payload": "torque at the start",
        "between their capsules": "something touches at the start",
        "has torque": "torque of any motion",
        "clearance": "clearance of any motion",
    }
    return next((name for words, name in kinds.items() if words in why), why)


if __name__ == "__main__":
    main()
