"""The streams that `events.py` measures: real-like arms whose payload changes in every way a cell knows.

A scene is made from its part and its seed alone. What is changed at once is held by the simulated arm itself, with all
that does to its motion; what is handed over slowly is added to the sensors' torque as share(t)·W(q, dq, ddq)·phi.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from real_logs import data
from scipy.signal import savgol_filter

from armload import Recording, arm, read_recording
from armload.arms import Arm, payload_regressor
from armload.devices import Simulator
from armload.inertia import InertialParameters
from armload.motion import Motion, random_motion, taie2024
from armload.payloads import Payload, draw_payload
from armload.simulation import Sensors, World

FAMILIES = ("boxes", "shapes", "container")
STEP = 0.2  # [kg] a change of at least, but for light ones and slow ones
RAMPS = {"ramps_0.1": 0.1, "ramps_0.5": 0.5, "ramps_1": 1.0, "ramps_2": 2.0, "ramps_5": 5.0}  # [s]
LOOKED = (0.5, 1.0, 2.0, 5.0)  # [s] after the end of a change
RATES = {"rate_25": 25.0, "rate_50": 50.0, "rate_100": 100.0, "rate_500": 500.0, "rate_1000": 1000.0}  # [Hz]
PARTS = (
    "steps", *RAMPS, "slow", "standing", "early", "swaps", "light", "drop", "shift", "cycles", *RATES,
    "drift", "quiet", "pushes", "real", "real_tared", "real_motor", "real_as_is",
)  # fmt: skip
# log, arm, what is bolted to it [kg]; None: nobody says
REAL = (
    ("panda_unloaded_1khz.csv", "panda", 0.0),
    ("ur10e_unloaded.csv", "ur10e.urdf", 0.0),
    ("ur10e_loaded_2805g.csv", "ur10e.urdf", 2.805),
    ("ur10_ros2_bag.db3", "ur10", None),
    ("kuka_lwr_100hz.csv", "iiwa14", None),
)


@dataclass(frozen=True)
class Scene:
    """One stream: its part, and its seed, odd for the published motion."""

    part: str
    seed: int

    @property
    def own(self) -> int:
        """A seed that no scene of another part has."""
        return self.seed + 1000 * PARTS.index(self.part)


@dataclass(frozen=True)
class Change:
    """What is held becomes phi (10,) within `seconds` from `start` [s]."""

    start: float
    seconds: float
    phi: NDArray[np.float64]


@dataclass(frozen=True)
class Stream:
    """A log with all that is true of it.

    base: what is held before the first change [kg]; None: nobody says. counted: which changes the part is about.
    """

    robot: Arm
    log: Recording
    changes: list[Change]
    counted: list[bool]
    pushes: list[Push]
    base: float | None = 0.0
    tare: Recording | None = None

    def held(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """phi (N, 10) of what is held beside `base` at times (N,) [s]."""
        out, before = np.zeros((len(t), 10)), np.zeros(10)
        for change in self.changes:
            share = np.clip((t - change.start) / max(change.seconds, 1e-9), 0.0, 1.0)
            out += share[:, None] * (change.phi - before)
            before = change.phi
        return out


@dataclass(frozen=True)
class Push:
    """A force F (3,) [N] on a link, in the base's axes, from start to end [s]."""

    start: float
    end: float
    link: str
    force: NDArray[np.float64]

    def torque(self, t: NDArray, q: NDArray) -> NDArray[np.float64]:
        """What it adds to the joints' sensors (N, n): −J(q)ᵀ·F, rising and falling over a third of it each."""
        robot = arm("panda", frame=self.link)
        edge = (self.end - self.start) / 3.0
        rise = np.clip(np.minimum(t - self.start, self.end - t) / edge, 0.0, 1.0)
        size = 0.5 - 0.5 * np.cos(np.pi * rise)
        moved = q[:, : robot.n]  # joints beyond the link feel nothing of it
        J = robot.frame_motion(moved).jacobian[:, 3:]  # (N, 3, n) linear, in the link's axes
        rotation = robot.frame_pose(moved)[0]  # (N, 3, 3) link to base
        along = np.einsum("nji,j->ni", rotation, self.force)
        out = np.zeros_like(q)
        out[:, : robot.n] = -size[:, None] * np.einsum("nij,ni->nj", J, along)
        return out


class Resting(Motion):
    """A motion q(s(t)) that comes to rest at each of `stops` [s] within a second, and goes on five seconds later."""

    name = "resting"

    def __init__(self, motion: Motion, stops: tuple[float, ...], rounds: int = 7) -> None:
        self.motion, self.stops, self.rounds = motion, stops, rounds

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.motion.n

    @property
    def duration(self) -> float:
        """So many rounds of the motion, and the stops [s]."""
        return self.rounds * self.motion.duration + 5.0 * len(self.stops)

    def _clock(self, t: NDArray, order: int) -> NDArray:
        """s(t) and its derivatives: the pace falls from 1 to 0 and rises again along 1 − 3x² + 2x³."""
        out = t.copy() if order == 0 else np.full_like(t, float(order == 1))
        for stop in self.stops:
            for start, sign in ((stop, 1.0), (stop + 5.0, -1.0)):
                x = np.clip(t - start, 0.0, 1.0)
                within = (x > 0.0) & (x < 1.0)
                lost = (
                    np.where(t > start + 1.0, t - start - 0.5, x**3 - 0.5 * x**4),
                    3.0 * x**2 - 2.0 * x**3,
                    np.where(within, 6.0 * x - 6.0 * x * x, 0.0),
                    np.where(within, 6.0 - 12.0 * x, 0.0),
                )[order]
                out = out - sign * lost
        return out

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of the given order (0 to 3) at times t (N,); (N, n)."""
        q = [self.motion.derivative(self._clock(t, 0), k) for k in range(order + 1)]
        s = [self._clock(t, k)[:, None] for k in range(4)]
        if order < 2:
            return q[0] if order == 0 else q[1] * s[1]
        if order == 2:
            return q[2] * s[1] ** 2 + q[1] * s[2]
        return q[3] * s[1] ** 3 + 3.0 * q[2] * s[1] * s[2] + q[1] * s[3]


def body(rng: np.random.Generator, least: float = STEP) -> NDArray[np.float64]:
    """phi (10,) of a payload of at least so many kg."""
    rated = float(np.exp(rng.uniform(np.log(0.4), np.log(3.0))))
    while True:
        payload = draw_payload(FAMILIES[rng.integers(len(FAMILIES))], int(rng.integers(1 << 30)), rated)
        if payload.parameters.mass >= least:
            return payload.parameters.phi


def streamed(scene: Scene) -> Stream:
    """The samples of a scene, and what is true of them."""
    rng = np.random.default_rng([scene.own, 7])
    if scene.part.startswith("real"):
        return _real(scene, rng)
    seconds = {"early": 9.0, "rate_500": 30.0, "rate_1000": 30.0}.get(scene.part, 40.0)
    changes, counted = _changes(scene, rng, seconds)
    added = scene.part in RAMPS or scene.part == "slow"
    log = _simulated(scene, seconds, [] if added else changes)
    panda, pushed, tau = arm("panda"), [], log.tau
    if scene.part == "drop":  # where the arm is quickest: it is all simulated once more
        speed = np.linalg.norm(log.dq, axis=1)
        for k in range(1, len(changes), 2):
            near = np.abs(log.t - changes[k].start) < 1.0
            changes[k] = Change(float(log.t[near][speed[near].argmax()]), 0.0, changes[k].phi)
        log = _simulated(scene, seconds, changes)
        tau = log.tau
    if added:
        tau = tau + torque_of(panda, log, Stream(panda, log, changes, counted, []))
    if scene.part == "drift":
        tau = tau + np.sin(2.0 * np.pi * log.t / 80.0)[:, None] * rng.choice([-0.5, 0.5], panda.n)
    if scene.part == "pushes":
        pushed = _pushes(rng, seconds)
        for push in pushed:
            tau = tau + push.torque(log.t, log.q)
    log = Recording(log.t, log.q, log.dq, tau)
    return Stream(panda, _thinned(log, scene.part, rng), changes, counted, pushed)


def _changes(scene: Scene, rng: np.random.Generator, seconds: float) -> tuple[list[Change], list[bool]]:
    """What is taken up and put down in turn, and which of it the part is about."""
    nothing, part, out, t = np.zeros(10), scene.part, [], 5.0 + rng.uniform(0.0, 1.0)
    if part == "drift" or part in ("pushes", "quiet"):
        loaded = part != "drift" and scene.seed % 2
        return ([Change(4.0, 0.0, body(rng))], [False]) if loaded else ([], [])
    if part == "cycles":
        phi, times = body(rng), np.arange(5.0, seconds - 1.0, 0.5 * taie2024().duration)
        return [Change(float(x), 0.0, nothing if k % 2 else phi) for k, x in enumerate(times)], [True] * len(times)
    if part == "early":
        return [Change(float(rng.uniform(0.3, 2.0)), 0.0, body(rng))], [True]
    if part == "standing":
        times = [stop + rng.uniform(2.0, 3.5) for stop in _STOPS]
        phi = body(rng)
        return [Change(x, 0.0, nothing if k % 2 else phi) for k, x in enumerate(times)], [True] * len(times)
    while True:
        before, took = out[-1].phi if out else nothing, RAMPS.get(part, 0.0)
        loaded = before[0] > 0.0
        if part == "swaps" and loaded:
            while abs((new := body(rng))[0] - before[0]) < STEP:
                pass
        elif part == "shift" and loaded:
            new = _shifted(before, rng)
        elif loaded:
            new = nothing
        else:
            new = body(rng)
            if part == "light":
                new = new * (rng.uniform(0.03, 0.2) / new[0])
            if part == "slow":
                new = new * (rng.uniform(0.2, 0.6) / new[0])
        if part == "slow":
            took = abs(new[0] - before[0]) / rng.uniform(0.04, 0.1)
        if t + took + LOOKED[-1] > seconds:
            about = {"swaps": slice(1, None), "shift": slice(1, None), "drop": slice(1, None, 2)}.get(part, slice(None))
            counted = [False] * len(out)
            counted[about] = [True] * len(counted[about])
            return out, counted
        out.append(Change(t, took, new))
        t += took + 5.6 + rng.uniform(0.0, 1.5)


def _shifted(phi: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """The same body 2 to 6 cm away."""
    way = rng.normal(size=3)
    way *= rng.uniform(0.02, 0.06) / np.linalg.norm(way)
    return InertialParameters(phi).moved(np.eye(3), way).phi


def _pushes(rng: np.random.Generator, seconds: float) -> list[Push]:
    out, t = [], 9.0
    while t < seconds - 5.0:
        length, force = rng.uniform(0.3, 3.0), rng.normal(size=3)
        link = ("panda_link8", "panda_link8", "panda_link4")[rng.integers(3)]
        out.append(Push(t, t + length, link, force * rng.uniform(10.0, 60.0) / np.linalg.norm(force)))
        t += length + rng.uniform(3.0, 5.0)
    return out


_STOPS = (5.0, 14.0, 23.0, 32.0)  # [s] where an arm comes to rest for five seconds


def _simulated(scene: Scene, seconds: float, held: list[Change]) -> Recording:
    panda, random = arm("panda"), random_motion(arm("panda"), scene.own)
    motion: Motion = taie2024() if scene.seed % 2 or scene.part == "cycles" else random
    if scene.part == "standing":
        motion = Resting(random, _STOPS)
    source = Simulator(
        panda,
        motion,
        [(x.start, Payload("held", InertialParameters(x.phi)) if x.phi[0] > 0.0 else None) for x in held],
        world=World.real_like(panda, scene.own),
        sensors=Sensors.panda(panda),
        rate=max(200.0, 1000.0 * (scene.part in ("rate_500", "rate_1000"))),
        speed=None,
        duration=seconds,
        seed=scene.own,
    )
    return Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]


def torque_of(robot: Arm, log: Recording, stream: Stream) -> NDArray[np.float64]:
    """What the payloads of a stream add to a log's torque (N, n)."""
    step = float(np.median(np.diff(log.t)))
    even = np.arange(log.t[0], log.t[-1] + 0.5 * step, step)
    dq = np.array([np.interp(even, log.t, column) for column in log.dq.T])
    length = max(5, 2 * int(0.05 / step) + 1)
    ddq = np.asarray(savgol_filter(dq, length, 3, deriv=1, delta=step, axis=1))
    ddq = np.array([np.interp(log.t, even, row) for row in ddq]).T
    W = payload_regressor(robot.frame_motion(log.q), log.dq, ddq)
    return np.einsum("nij,nj->ni", W, stream.held(log.t))


def _thinned(log: Recording, part: str, rng: np.random.Generator) -> Recording:
    """As many samples as a part's rate asks for, their distances scattered by a fifth or more."""
    rate = RATES.get(part, 200.0)
    if rate in (200.0, 1000.0):
        return log
    if rate == 500.0:
        kept = np.flatnonzero(rng.random(len(log.t)) < 0.5)
    else:
        step = 200.0 / rate
        at = np.arange(0.0, len(log.t) - step, step)
        kept = np.unique(np.round(at + step * rng.uniform(-0.2, 0.2, len(at))).clip(0).astype(int))
    return Recording(log.t[kept], log.q[kept], log.dq[kept], log.tau[kept])


def _real(scene: Scene, rng: np.random.Generator) -> Stream:
    """A real log as it is, or with a payload's torque added and taken away, or so with a tare of the same arm."""
    which = {"real_tared": 0, "real_motor": 1 + scene.seed % 2}.get(scene.part, scene.seed % len(REAL))
    name, robot, base = REAL[which]
    known = arm(data() / robot, "tool0") if robot.endswith(".urdf") else arm(robot)
    log, tare = read_recording(data() / name, known), None
    if scene.part == "real_as_is":
        return Stream(known, log, [], [], [], base)
    first, end, phi, changes = 5.0, log.t[-1] - 2.0, np.zeros(10), []
    if scene.part == "real_tared":
        cut = log.t[0] + 10.0
        log, tare, first = log.between(cut, log.t[-1]), log.between(log.t[0], cut), 2.5
    elif scene.part == "real_motor" and base:
        tare = read_recording(data() / REAL[1][0], known)
    elif scene.part == "real_motor":
        cut = 0.5 * (log.t[0] + log.t[-1])
        log, tare = log.between(cut, log.t[-1]), log.between(log.t[0], cut)
    t = log.t[0] + first + rng.uniform(0.0, 1.5)
    while t < end:
        phi = body(rng) if phi[0] == 0.0 else np.zeros(10)
        changes.append(Change(float(t), 0.0, phi))
        t += rng.uniform(4.0, 6.0)
    stream = Stream(known, log, changes, [True] * len(changes), [], base, tare)
    loaded = Recording(log.t, log.q, log.dq, log.tau + torque_of(known, log, stream))
    return Stream(known, loaded, changes, stream.counted, [], base, tare)
