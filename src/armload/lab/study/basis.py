"""What the study rests on: the two data sets, and the runs on which every method is measured."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from armload.arms import Arm, arm, payload_regressor
from armload.errors import DatasetError, RecordingError
from armload.inertia import InertialParameters
from armload.lab.dataset import Dataset, build_dataset
from armload.lab.evaluation import EvaluationRun
from armload.lab.study.spec import NOMINAL, REAL, SEMI_REAL
from armload.motion import Motion, excitation, random_motion
from armload.payloads import Payload, container_loadings, draw_payload, random_payloads, test_payload
from armload.recording import Recording, read_recording
from armload.simulation import Run, Sensors, World, simulate_many

# Seeds of what is drawn: kept apart, so that no run shares its noise with the training data.
NOISE, WORLDS, FAMILY, MOTIONS, TARE, LOADINGS = 5000, 100, 7000, 300, 900, 20_000
_WINDOWS, _WINDOW = (10.0, 12.0, 14.0), 6.0  # [s] of the real log: where its windows begin, and how long they last
_SMOOTHED, _DEGREE = 0.05, 3  # [s] half the window of the real log's acceleration, and the degree of its polynomial
PANDA, CONTAINER = "panda", "container"  # the paper's arm and payloads


@dataclass(frozen=True)
class Size:
    """How much is measured: every n-th loading, rows per run, runs of each protocol; caps (None: the cell's own)."""

    every: int
    rows: int
    worlds: int
    payloads: int
    motions: int
    max_epochs: int | None
    members: int | None
    hidden: int | None


FULL = Size(every=1, rows=3244, worlds=5, payloads=20, motions=5, max_epochs=None, members=None, hidden=None)
QUICK = Size(every=7, rows=120, worlds=2, payloads=3, motions=2, max_epochs=3, members=2, hidden=32)


@dataclass(frozen=True, eq=False)
class Basis:
    """Arm, motion, data sets and evaluation runs of the study.

    Args:
        folder: where the data sets are built.
        size: `FULL` (the paper's 249 788 rows) or `QUICK`.
        real_log: an unloaded log of a real Panda, for the semi-real runs; None: there are none.
        robot: the arm by name; the paper's is a Panda.
        payloads: "container", the paper's, or a family of `draw_payload`.
    """

    folder: Path
    size: Size = FULL
    real_log: Path | None = None
    robot: str = PANDA
    payloads: str = CONTAINER

    @property
    def rests_on(self) -> tuple[Path, Size, Path | None, str, str]:
        """What `basis_of_process` makes the same basis of."""
        return self.folder, self.size, self.real_log, self.robot, self.payloads

    @cached_property
    def arm(self) -> Arm:
        """The nominal arm, bare to its flange."""
        return arm(self.robot)

    @cached_property
    def motion(self) -> Motion:
        """The excitation: a re-design for the Panda, the paper's coefficients being unpublished; else a random one."""
        return excitation(self.arm)

    @cached_property
    def loadings(self) -> list[Payload]:
        """The training payloads; of a random family as many as the paper's."""
        paper = container_loadings()
        if self.payloads != CONTAINER:
            paper = [draw_payload(self.payloads, LOADINGS + k) for k in range(len(paper))]
        return paper[:: self.size.every]

    @cached_property
    def truth(self) -> InertialParameters:
        """The test payload, which is not among the loadings (the role of the paper's Table I)."""
        payload = test_payload() if self.payloads == CONTAINER else draw_payload(self.payloads, LOADINGS - 1)
        return InertialParameters(payload.parameters.phi, self.arm.frame)

    @cached_property
    def sensors(self) -> Sensors:
        """Those of the arm's sheet, or the like."""
        return Sensors.of(self.arm)

    def dataset(self, sensors: str, progress: bool = False) -> Dataset:
        """The data set with "ideal" sensors or those of a real "panda"; built where it is not there yet."""
        return build_dataset(
            self.folder / f"data-{sensors}",
            self.arm,
            [self.motion],
            self.loadings,
            sensors=None if sensors == "ideal" else self.sensors,
            rows_per_run=self.size.rows,
            progress=progress,
        )

    @property
    def fingerprint(self) -> str:
        """SHA-256 of what the numbers depend on besides the method's own settings."""
        parts = [
            self.arm.fingerprint,
            self.motion.name,
            repr(self.size),
            repr([p.parameters.phi for p in self.loadings]),
        ]
        parts += [repr(np.round(self.motion(np.linspace(0, 6, 25))[0], 9).tolist()), repr(self.truth.phi.tolist())]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()

    @cached_property
    def runs(self) -> dict[str, list[EvaluationRun]]:
        """The runs by protocol, their tares on another motion; every method gets the same runs.

        test_payload_nominal: the test payload on the nominal arm with real sensors, three noise seeds.
        test_payload_real_like: on arms that differ from the model as real ones do; the stand-in for the real robot.
        off_family: random payloads outside the container's family, nominal arm.
        other_motion: the test payload on other motions, nominal arm.
        test_payload_semi_real: the test payload's torque added to a real unloaded log, which shows another motion.
        """
        return self._simulated(same_motion=False) | self._on_real_log()

    @cached_property
    def runs_with_own_motion_tared(self) -> dict[str, list[EvaluationRun]]:
        """The same runs, their tares on each run's own motion (Kurdas et al. 2022); a real log has none of those."""
        return self._simulated(same_motion=True) | self._on_real_log()

    def _simulated(self, same_motion: bool) -> dict[str, list[EvaluationRun]]:
        robot, size, sensors = self.arm, self.size, self.sensors
        nominal = World.nominal(robot)
        worlds = [World.real_like(robot, WORLDS + k) for k in range(size.worlds)]
        family = [
            InertialParameters(p.parameters.phi, robot.frame) for p in random_payloads(size.payloads, seed=FAMILY)
        ]
        others = [random_motion(robot, MOTIONS + k) for k in range(size.motions)]
        plan: dict[str, list[tuple[str, Motion, InertialParameters, World]]] = {
            NOMINAL: [(f"noise {k}", self.motion, self.truth, nominal) for k in range(3)],
            REAL: [(w.name, self.motion, self.truth, w) for w in worlds],
            "off_family": [(f"random payload {k}", self.motion, p, nominal) for k, p in enumerate(family)],
            "other_motion": [(m.name, m, self.truth, nominal) for m in others],
        }
        out: dict[str, list[EvaluationRun]] = {}
        for protocol, rows in plan.items():
            first = NOISE + 1000 * len(out)
            log_of = [Run(m, p, w, sensors, first + k) for k, (_, m, p, w) in enumerate(rows)]
            # the tare is the empty arm in the same world
            other = random_motion(robot, TARE, duration=20.0, harmonics=10)
            tare_of = [
                Run(m if same_motion else other, None, w, sensors, first + 500 + k)
                for k, (_, m, _, w) in enumerate(rows)
            ]
            rate = size.rows / self.motion.duration
            logs = simulate_many(robot, log_of, rate=rate)
            tares = simulate_many(robot, tare_of, rate=rate if same_motion else 200.0)
            out[protocol] = [
                EvaluationRun(log, truth, label, tare, first + k)
                for k, ((label, _, truth, _), log, tare) in enumerate(zip(rows, logs, tares, strict=True))
            ]
        return out

    def _on_real_log(self) -> dict[str, list[EvaluationRun]]:
        return {} if self.real_recording is None else {SEMI_REAL: self._semi_real(self.real_recording)}

    @cached_property
    def real_recording(self) -> Recording | None:
        """The real log, long enough for its windows; None: there is none.

        Raises:
            DatasetError: it cannot be read by its own header, or is too short.
        """
        path = self.real_log
        if path is None:
            return None
        try:
            log = read_recording(path, self.arm)
        except RecordingError as error:
            raise DatasetError(
                f"the real log {path} cannot be read: expected a recording that "
                f"`armload identify {path} --robot {self.robot}` reads without --columns"
            ) from error
        if log.duration < _WINDOWS[-1] + _WINDOW:
            raise DatasetError(
                f"the real log {path} lasts {log.duration:.1f} s: expected at least {_WINDOWS[-1] + _WINDOW:g} s, of "
                f"which the first {_WINDOWS[0]:g} s are the tare"
            )
        return log

    def _semi_real(self, log: Recording) -> list[EvaluationRun]:
        """Three 6 s windows of the real log with the payload's torque added; its first 10 s are the tare."""
        from scipy.signal import savgol_filter

        window = 2 * max(_DEGREE, round(_SMOOTHED * log.rate)) + 1
        ddq = np.asarray(savgol_filter(log.dq, window, _DEGREE, deriv=1, delta=1.0 / log.rate, axis=0))
        added = payload_regressor(self.arm.frame_motion(log.q), log.dq, ddq) @ self.truth.phi
        loaded = Recording(log.t, log.q, log.dq, log.tau + added, source="semi-real")
        start = float(log.t[0])
        tare = log.between(start, start + _WINDOWS[0])
        windows = [(w, loaded.between(start + w, start + w + _WINDOW)) for w in _WINDOWS]
        return [EvaluationRun(window, self.truth, f"real log from {w:g} s", tare) for w, window in windows]


@lru_cache(maxsize=1)
def basis_of_process(
    folder: Path, size: Size, real_log: Path | None = None, robot: str = PANDA, payloads: str = CONTAINER
) -> Basis:
    """One for all cells that a process measures, so that its runs are simulated once."""
    return Basis(folder, size, real_log, robot, payloads)
