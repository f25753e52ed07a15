"""Logs of an arm of which one thing is not as `armload.identify` assumes, and sound ones: cases of wrong_logs.py."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from bodies import body_of
from numpy.typing import NDArray
from tare_drift import before

from armload import Recording, arm
from armload.arms import Arm, rated_mass
from armload.devices import Simulator
from armload.inertia import InertialParameters
from armload.lab.episodes import Episode, draw_episodes, simulate_episodes
from armload.lab.episodes.motion_kinds import MotionSource
from armload.motion import Motion
from armload.payloads import draw_payload, franka_hand
from armload.posterior import Profile, learn_profile, with_known_weight
from armload.simulation import Run, Sensors, simulate_many
from armload.simulation.resolution import COARSE

TILT = 5.0  # [°]
RATE = 200.0  # [Hz]
STEP = 1e-3  # [s] of what moves beside the arm
LIGHT, WEIGHT = 0.2 / 3.0, 2.0 / 3.0  # of what an arm is rated for: something light, a known weight


class Wrong(NamedTuple):
    """A run, its tare or a profile, and the truth phi (10,) that `identify` promises: what was added since."""

    run: Recording
    tare: Recording | None
    truth: NDArray[np.float64]
    profile: Profile | None = None


@cache
def episodes(robot: str, count: int, seed: int, population: str = "reference") -> tuple[Episode, ...]:
    """Those that are made wrong."""
    return tuple(draw_episodes(arm(robot), population, count, 300 + seed, motions=max(6, count // 4)))


def simulated(changed: list[Episode]) -> Iterator[Wrong]:
    """As they stand."""
    for logs in simulate_episodes(changed):
        yield Wrong(logs.run, logs.tare, logs.truth.phi)


def sound(population: str, robot: str, count: int, seed: int) -> Iterator[Wrong]:
    """Nothing is wrong."""
    return simulated(list(episodes(robot, count, seed, population)))


# ---------------------------------------------------------------------- the arm and its tare


def changed(change: str | float, robot: str, count: int, seed: int) -> Iterator[Wrong]:
    """The arm was another at its tare, as in tare_drift.py."""
    return simulated([before(e, change, k) for k, e in enumerate(episodes(robot, count, seed))])


def tool_off(hand: bool, robot: str, count: int, seed: int) -> Iterator[Wrong]:
    """A tool was on at the tare and is off in the run: the truth is the payload less the tool, or less the hand."""
    drawn, rated = episodes(robot, count, seed), rated_mass(arm(robot))
    tools = [franka_hand() if hand else draw_payload("tools", 900 + seed + k, 0.6 * rated) for k in range(count)]
    with_tool = simulate_episodes([replace(e, tool=tool) for e, tool in zip(drawn, tools, strict=True)])
    for logs, off, tool in zip(simulate_episodes(drawn), with_tool, tools, strict=True):
        yield Wrong(logs.run, off.tare, logs.truth.phi - tool.parameters.phi)


def gain(size: float, each: bool, robot: str, count: int, seed: int) -> Iterator[Wrong]:
    """The torque's scale is off by a share: by the same of all joints, or by up to so much and a third at least."""
    for k, log in enumerate(sound("reference", robot, count, seed)):
        rng = np.random.default_rng([seed, k, 7])
        n = log.run.n
        by = rng.choice([-1.0, 1.0], n) * rng.uniform(size / 3.0, size, n) if each else np.full(n, size)
        run, tare = (replace(x, tau=x.tau * (1.0 + by)) for x in (log.run, log.tare) if x is not None)
        yield Wrong(run, tare, log.truth)


def weighed(size: float, each: bool, robot: str, count: int, seed: int) -> Iterator[Wrong]:
    """The same, but the arm has a profile of four empty logs of one session, and a weight was hung on for 20 s.

    It weighs two thirds of what the arm is rated for, 2.000 kg of a Panda's 3, and is known to 2 g.
    """
    known_arm, source = arm(robot), MotionSource(arm(robot), 0.0)
    mass, n = WEIGHT * rated_mass(known_arm), known_arm.n
    weight = InertialParameters.from_com(mass, (0.0, 0.0, 0.08), mass * np.diag([2e-3, 2e-3, 1e-3]))
    drawn = episodes(robot, count, seed)
    for k, (e, log) in enumerate(zip(drawn, gain(size, each, robot, count, seed), strict=True)):
        rng, around = np.random.default_rng([seed, k, 7]), source.centre(e.motion)
        by = rng.choice([-1.0, 1.0], n) * rng.uniform(size / 3.0, size, n) if each else np.full(n, size)
        motions = [source.draw("long", rng, 20.0, f"{k}-{i}", around, 0.3) for i in range(5)]
        runs = [Run(motion, None, e.world, e.sensors, e.seed + i, e.gains) for i, motion in enumerate(motions)]
        runs[-1] = replace(runs[-1], payload=weight)
        logs = simulate_many(known_arm, runs, rate=RATE, duration=20.0, workers=1, resolution=COARSE)
        *empty, loaded = (replace(x, tau=x.tau * (1.0 + by)) for x in logs)
        known = learn_profile(known_arm, empty, sessions=[0] * len(empty))
        yield Wrong(log.run, None, log.truth, with_known_weight(known, known_arm, loaded, mass, 0.002))


def tilted(degrees: float, tared: bool, robot: str, count: int, seed: int) -> Iterator[Wrong]:
    """The base leans, in any direction, and nobody said so: at the tare and in the run."""
    leaning = []
    for k, e in enumerate(episodes(robot, count, seed)):
        way, angle = np.random.default_rng([seed, k, 8]).uniform(0.0, 2.0 * np.pi), np.radians(degrees)
        gravity = 9.81 * np.array([np.sin(angle) * np.cos(way), np.sin(angle) * np.sin(way), -np.cos(angle)])
        leans = replace(e.arm, gravity=tuple(gravity.tolist()))
        leaning.append(replace(e, arm=leans, tare_motion=e.tare_motion if tared else None))
    return simulated(leaning)


# ---------------------------------------------------------------------- the logger


def logged(
    fault: Callable[[Recording, np.random.Generator], Recording], robot: str, count: int, seed: int
) -> Iterator[Wrong]:
    """A sensor, its cable or the logger's columns are at fault, at the tare and in the run alike."""
    for k, log in enumerate(sound("reference", robot, count, seed)):
        assert log.tare is not None
        run, tare = (fault(each, np.random.default_rng([seed, k, 10])) for each in (log.run, log.tare))
        yield Wrong(run, tare, log.truth)


def stuck(log: Recording, rng: np.random.Generator) -> Recording:
    """One of the torques stays what it is after a third of the log, for a third."""
    tau, joint, first = log.tau.copy(), rng.integers(log.n), len(log) // 3
    tau[first : 2 * first, joint] = tau[first, joint]
    return replace(log, tau=tau)


def limited(log: Recording, rng: np.random.Generator) -> Recording:
    """One of the torques of the joints that bear most ends at three quarters of its largest."""
    tau, joint = log.tau.copy(), (1, 3)[rng.integers(2)] if log.n == 7 else rng.integers(1, 3)
    most = 0.75 * np.abs(tau[:, joint]).max()
    tau[:, joint] = np.clip(tau[:, joint], -most, most)
    return replace(log, tau=tau)


def turned(log: Recording, rng: np.random.Generator) -> Recording:
    """The torque of one of the last three joints has the opposite sign."""
    sign = np.ones(log.n)
    sign[-rng.integers(1, 4)] = -1.0
    return replace(log, tau=log.tau * sign)


def exchanged(i: int, j: int, log: Recording, _: np.random.Generator) -> Recording:
    """Two joints are in each other's place, in q, dq and tau, and nothing names them."""
    order = np.arange(log.n)
    order[[i, j]] = order[[j, i]]
    q, dq, tau = (x[:, order] for x in (log.q, log.dq, log.tau))
    return replace(log, q=q, dq=dq, tau=tau, joint_names=None)


def late(seconds: float, log: Recording, _: np.random.Generator) -> Recording:
    """The torques are so much late."""
    tau = np.column_stack([np.interp(log.t - seconds, log.t, one) for one in log.tau.T])
    return replace(log, tau=tau)


def crosstalk(share: float, log: Recording, rng: np.random.Generator) -> Recording:
    """Each torque holds up to such a share of either neighbour's, and a third of it at least, one way or the other."""
    shares = rng.choice([-1.0, 1.0], (2, log.n)) * rng.uniform(share / 3.0, share, (2, log.n))
    before, after = (np.zeros_like(log.tau) for _ in range(2))
    before[:, 1:], after[:, :-1] = log.tau[:, :-1], log.tau[:, 1:]
    return replace(log, tau=log.tau + shares[0] * before + shares[1] * after)


def misaligned(off: float, log: Recording, rng: np.random.Generator) -> Recording:
    """Each encoder's zero is off by so much [rad], 1 sigma."""
    return replace(log, q=log.q + off * rng.normal(size=log.n))


# ---------------------------------------------------------------------- the payload


def taken_up(light: bool, robot: str, count: int, seed: int, throughout: bool = False) -> Iterator[Wrong]:
    """Taken up or put down at once in the middle of the log: the truth is what is held at the end.

    light: it weighs a fifteenth of what the arm is rated for, 0.2 kg of a Panda's 3. throughout: only those where
    something is taken up, and it is held from the start: nothing changes.
    """
    drawn, mass = episodes(robot, count, seed), LIGHT * rated_mass(arm(robot))
    for k, (e, log) in enumerate(zip(drawn, sound("reference", robot, count, seed), strict=True)):
        rng = np.random.default_rng([seed, k, 3])
        payload = body_of(mass, seed + k) if light else e.payload
        when, up = float(rng.uniform(1.5, 4.5)), rng.random() < 0.5
        held = [(0.0, None), (when, payload)] if up else [(0.0, payload), (when, None)]
        if throughout:
            held = [(0.0, payload)]
        if not up and throughout:
            continue
        yield Wrong(holding(e, held), log.tare, payload.parameters.phi if up else np.zeros(10))


def holding(e: Episode, held: list[tuple[float, Any]]) -> Recording:
    """The run of an episode, whose arm holds something else from some times on."""
    how = {"world": e.world, "sensors": e.sensors, "rate": RATE}
    source = Simulator(e.arm, e.motion, held, speed=None, duration=6.0, seed=e.seed, **how)
    return Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]


def slipped(by: float, robot: str, count: int, seed: int) -> Iterator[Wrong]:
    """A part of what is held slips by so much [m] in the middle of the log, and the mass stays: a finger that opens.

    The part weighs a fifteenth of what the arm is rated for, and is 8 cm from the flange. The truth is of the end.
    """
    mass = LIGHT * rated_mass(arm(robot))
    for k, (e, log) in enumerate(
        zip(episodes(robot, count, seed), sound("reference", robot, count, seed), strict=True)
    ):
        rng, frame = np.random.default_rng([seed, k, 14]), e.payload.parameters.frame
        when, angle = float(rng.uniform(1.5, 4.5)), rng.uniform(0.0, 2.0 * np.pi)
        before, after = (
            InertialParameters(e.payload.parameters.phi, frame)
            + InertialParameters.from_com(mass, (x * np.cos(angle), x * np.sin(angle), 0.08), np.zeros((3, 3)), frame)
            for x in (0.0, by)
        )
        yield Wrong(holding(e, [(0.0, before), (when, after)]), log.tare, after.phi)


def moving(robot: str, count: int, seed: int, liquid: bool) -> Iterator[Wrong]:
    """30 % of the payload's mass hangs on a string of 5–15 cm, or is held by a spring of 1.5–4 Hz, damped by 3–20 %.

    The log is that of the rigid payload, and what the moving part does differently is added: the arm's controller is
    stiff. The first moments' truth is that of the part's mean place.
    """
    for k, (e, log) in enumerate(
        zip(episodes(robot, count, seed), sound("reference", robot, count, seed), strict=True)
    ):
        rng = np.random.default_rng([seed, k, 9])
        frequency = rng.uniform(1.5, 4.0) if liquid else np.sqrt(9.81 / rng.uniform(0.05, 0.15)) / (2.0 * np.pi)
        part = Part(0.3 * log.truth[0], 2.0 * np.pi * frequency, rng.uniform(0.03, 0.2), liquid)
        torque, shift = part.beside(e.arm, e.motion, log.truth[1:4] / log.truth[0], log.run.t)
        truth = log.truth.copy()
        truth[1:4] += part.mass * shift
        yield Wrong(replace(log.run, tau=log.run.tau + torque), log.tare, truth)


class Part(NamedTuple):
    """A point mass [kg] about a point of the payload: natural frequency [rad/s], damping, spring or string."""

    mass: float
    omega: float
    damping: float
    spring: bool

    def beside(
        self, robot: Arm, motion: Motion, centre: NDArray, t: NDArray
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The torque (N, n) beyond that of the same mass at rest at `centre`, and the mean shift (3,) in its frame.

        x'' + 2·zeta·omega·x' + omega²·x = −a, x the displacement in the base's axes, a the acceleration of the rest
        point; a spring's rest point is where it holds the part. A string pulls at `centre`, with no moment about it,
        and x is horizontal: the arm feels the part at the string's end, wherever it hangs.
        """
        step = STEP
        clock = np.arange(0.0, t[-1] + step, step)
        q = motion.position(np.minimum(clock, motion.duration))
        R, p = robot.frame_pose(q)
        point = p + R @ centre
        acceleration = np.gradient(np.gradient(point, step, axis=0), step, axis=0)
        across = np.ones(3) if self.spring else np.array([1.0, 1.0, 0.0])
        x, v, shift = np.zeros(3), np.zeros(3), np.empty_like(point)
        for i, a in enumerate(acceleration):  # semi-implicit Euler, a thousandth of a period or less
            v = v + step * across * (-a - 2.0 * self.damping * self.omega * v - self.omega**2 * x)
            x = x + step * v
            shift[i] = x
        extra = torque_beside(robot, q, self.mass, centre, shift, acceleration, self.spring)
        at = np.clip(np.searchsorted(clock, t), 0, len(clock) - 1)
        return extra[at], self.spring * np.einsum("nji,nj->ni", R, shift)[at].mean(axis=0)


def torque_beside(
    robot: Arm, q: NDArray, mass: float, centre: NDArray, shift: NDArray, acceleration: NDArray, held: bool
) -> NDArray[np.float64]:
    """The torque (N, n) of a point mass beyond that at rest at `centre`, each millisecond.

    shift: of it from there, in the base's axes (N, 3) [m]. acceleration: of the rest point (N, 3) [m/s²]. held: whether
    the arm feels it where it is; if not, at `centre`.
    """
    relative = np.gradient(np.gradient(shift, STEP, axis=0), STEP, axis=0)
    gravity, R = np.array([0.0, 0.0, -9.81]), robot.frame_pose(q)[0]
    force = -mass * relative  # on the arm, beyond what a part at rest exerts
    moment = held * np.cross(shift, mass * (gravity - acceleration - relative))
    turned = [np.einsum("nji,nj->ni", R, f) for f in (force, moment)]  # in the frame's axes
    turned[1] = turned[1] + np.cross(centre, turned[0])
    jacobian = robot.frame_motion(q).jacobian
    return -np.einsum("nij,ni->nj", jacobian, np.hstack([turned[1], turned[0]]))


class Play(NamedTuple):
    """A mass [kg] that slides without friction between two stops, `gap` [m] either way along an axis of the frame (3,).

    x'' = u·(g − a) between the stops; beyond them, a spring of 30 Hz, damped by 30 %, holds it: a stiff finger.
    """

    mass: float
    gap: float
    axis: NDArray[np.float64]

    def beside(self, robot: Arm, motion: Motion, centre: NDArray, t: NDArray) -> NDArray[np.float64]:
        """The torque (N, n) beyond that of the same mass fixed midway between the stops."""
        clock = np.arange(0.0, t[-1] + STEP, STEP)
        q = motion.position(np.minimum(clock, motion.duration))
        R, p = robot.frame_pose(q)
        acceleration = np.gradient(np.gradient(p + R @ centre, STEP, axis=0), STEP, axis=0)
        along = R @ self.axis
        pull = np.einsum("ni,ni->n", along, np.array([0.0, 0.0, -9.81]) - acceleration)
        omega, damping, gap = 2.0 * np.pi * 30.0, 0.3, self.gap
        x, v, places = float(np.copysign(gap, pull[0])), 0.0, []
        for a in pull.tolist():  # semi-implicit Euler
            beyond = x - min(max(x, -gap), gap)
            v += STEP * (a - omega**2 * beyond - (2.0 * damping * omega * v if beyond else 0.0))
            x += STEP * v
            places.append(x)
        shift = np.array(places)[:, None] * along
        extra = torque_beside(robot, q, self.mass, centre, shift, acceleration, True)
        return extra[np.clip(np.searchsorted(clock, t), 0, len(clock) - 1)]


def drifting(share: float, robot: str, count: int, seed: int) -> Iterator[Wrong]:
    """Within the run each torque drifts by a share of its effort limit, evenly, one way or the other."""
    effort = arm(robot).limits.effort
    for k, log in enumerate(sound("reference", robot, count, seed)):
        way = np.random.default_rng([seed, k, 13]).choice([-1.0, 1.0], len(effort))
        t = log.run.t
        drift = np.outer((t - t[0]) / (t[-1] - t[0]), share * way * effort)
        yield log._replace(run=replace(log.run, tau=log.run.tau + drift))


# ---------------------------------------------------------------------- another simulator


def other_simulator(robot: str, count: int, seed: int) -> Iterator[Wrong]:
    """Sound logs of an arm that follows its motion exactly, by Pinocchio: other links, friction and pose errors.

    Links differ by 2 % of mass and 2 mm of centre, times the arm's `link_spread`; friction has a Stribeck peak; the
    pose's torque is that of steps, tanh(2·sin(q_j + a) + cos(2·q_k + b)), of 0.3 % of the effort limit, not the smooth
    waves of `JointFeatures`. Where torque is motor current, friction is six times as large, and gears lose 2–8 %.
    """
    known = arm(robot)
    n, effort, spread = known.n, known.limits.effort, known.link_spread
    rubs, loses = (6.0, (0.02, 0.08)) if known.motor_torque else (1.0, (0.0, 0.0))
    for k, e in enumerate(episodes(robot, count, seed)):
        rng = np.random.default_rng([seed, k, 11])
        links = known.link_parameters * (1.0 + 0.02 * spread * rng.normal(size=(n, 1)))
        links[:, 1:4] += links[:, :1] * 0.002 * spread * rng.normal(size=(n, 3))
        actual = known.with_links(links)
        a, b, other = rng.uniform(0, 2 * np.pi, n), rng.uniform(0, 2 * np.pi, n), rng.permutation(n)
        level, peak = 0.01 * rubs * effort * rng.uniform(0.3, 1.0, n), rng.uniform(0.0, 0.3, n)
        offset, viscous = 0.003 * effort * rng.normal(size=n), 0.004 * rubs * effort * rng.uniform(0.2, 1.0, n)
        lost, logs = np.random.default_rng([seed, k, 12]).uniform(*loses, n), []
        for part, motion, seconds in ((e.payload, e.motion, 6.0), (None, e.tare_motion, e.tare_duration)):
            t = np.arange(round(seconds * RATE)) / RATE
            q, dq, ddq = motion(t)
            body = actual if part is None else actual.with_payload(InertialParameters(part.parameters.phi))
            torque = body.torque(q, dq, ddq)
            size = level * (1.0 + peak * np.exp(-((dq / 0.1) ** 2))) + lost * np.abs(torque)
            steps = 0.004 * effort * np.tanh(2.0 * np.sin(q + a) + np.cos(2.0 * q[:, other] + b))
            exact = Recording(t, q, dq, torque + np.tanh(dq / 0.05) * size + viscous * dq + steps + offset)
            logs.append(Sensors.of(known).observe(exact, int(rng.integers(1 << 30))))
        yield Wrong(logs[0], logs[1], e.payload.parameters.phi)


CASES: dict[str, Callable[[str, int, int], Iterator[Wrong]]] = {
    "nothing": partial(sound, "reference"),
    "nothing, everyday motions": partial(sound, "everyday"),
    "nothing, tare elsewhere": partial(sound, "elsewhere"),
    "nothing, other shapes": partial(sound, "shapes"),
    "nothing, same motion": partial(sound, "same-motion"),
    "nothing, arms beyond": partial(sound, "beyond"),
    "nothing, no tare": partial(sound, "untared"),
    "nothing, another simulator": other_simulator,
    "taken up or put down": partial(taken_up, False),
    "the same, something light": partial(taken_up, True),
    "tare of another arm": partial(changed, "other"),
    "tool off since the tare": partial(tool_off, False),
    "hand off since the tare": partial(tool_off, True),
    "old tare": partial(changed, 1.0),
    "torque gain +3 %": partial(gain, 0.03, False),
    "torque gain ±1–3 % by joint": partial(gain, 0.03, True),
    "torque gain +3 %, known weight": partial(weighed, 0.03, False),
    "torque gain ±1–3 %, known weight": partial(weighed, 0.03, True),
    "base tilted by 5°": partial(tilted, TILT, True),
    "base tilted by 5°, no tare": partial(tilted, TILT, False),
    "base tilted by 2°": partial(tilted, 2.0, True),
    "a torque stands still": partial(logged, stuck),
    "a torque at its sensor's limit": partial(logged, limited),
    "a wrist torque's sign turned": partial(logged, turned),
    "joints 1 and 3 exchanged": partial(logged, partial(exchanged, 0, 2)),
    "the last two joints exchanged": partial(logged, partial(exchanged, -1, -2)),
    "torques 60 ms late": partial(logged, partial(late, 0.06)),
    "torques drift by 1 %": partial(drifting, 0.01),
    "torques drift by 2 %": partial(drifting, 0.02),
    "30 % of the mass swings": partial(moving, liquid=False),
    "30 % of the mass sloshes": partial(moving, liquid=True),
}
# Of a Panda alone: its own hand
PANDAS = ("hand off since the tare",)
# To compare with: the same logs as in a case, sound
CONTROLS: dict[str, Callable[[str, int, int], Iterator[Wrong]]] = {
    "held throughout": partial(taken_up, False, throughout=True),
    "held throughout, something light": partial(taken_up, True, throughout=True),
}
# What nothing in a log tells, or hardly: limits of docs/hybrid.md, which are asked by name
LIMITS: dict[str, Callable[[str, int, int], Iterator[Wrong]]] = {
    "a part slips by 4 cm": partial(slipped, 0.04),
    "torques hold 2 % of their neighbours'": partial(logged, partial(crosstalk, 0.02)),
    "encoders' zeros off by 2 mrad": partial(logged, partial(misaligned, 2e-3)),
    "encoders' zeros off by 10 mrad": partial(logged, partial(misaligned, 1e-2)),
}
