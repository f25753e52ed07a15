"""A trained ensemble together with the arm, the frame and the motions its answers hold for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.ensembles.compiled import Compiled
from armload.errors import ModelError
from armload.inertia import NAMES, UNITS, Z95
from armload.motion import MotionFingerprint
from armload.recording import Recording
from armload.recording.columns import column_names


@dataclass(frozen=True, eq=False)
class LearnedModel:
    """A trained ensemble with everything that says for which arm, frame and motions its answers hold.

    compiled: the members. kind: such as "tree" or "two-stage network".
    arm_name, arm_fingerprint, joint_names, frame: the arm it was trained on, and what phi is about.
    motions: fingerprints of the motions it was trained on; empty if it is not tied to any.
    dataset_hash: of the training data. payloads: which of its payloads any training or validation row is of, as
    numbers in the data set's list; None: unknown. phi_mean, phi_std: (10,) of the training payloads, by rows.
    error_std: (10,) root-mean-square error of a whole run's estimate on payloads held out from training; None: unknown.
    settings, epochs, versions, notes: how it was trained. source: the file.
    """

    compiled: Compiled
    kind: str
    arm_name: str
    arm_fingerprint: str
    joint_names: tuple[str, ...]
    frame: str
    motions: tuple[MotionFingerprint, ...]
    dataset_hash: str
    payloads: tuple[int, ...] | None
    phi_mean: NDArray[np.float64]
    phi_std: NDArray[np.float64]
    error_std: NDArray[np.float64] | None
    settings: dict[str, Any]
    epochs: list[int] | None
    versions: dict[str, str]
    notes: str
    source: str

    @property
    def features(self) -> list[str]:
        """Names of the columns of X: those of a log, with t = 0 at the first sample."""
        return column_names(len(self.joint_names))

    def predict(self, X: ArrayLike, return_std: bool = False) -> Any:
        """phi (N, 10), and with return_std its spread (N, 10), for rows X (N, 1 + 3n) of (t, q, dq, tau).

        Raises:
            ModelError: X does not have the model's columns.
        """
        X = np.asarray(X, dtype=float)
        if X.ndim != 2 or X.shape[1] != self.compiled.n_features:
            raise ModelError(
                f"X has shape {X.shape}: the model {self.source} expects {self.compiled.n_features} columns "
                f"({self.features[0]}, {self.features[1]} … {self.features[-1]})"
            )
        return self.compiled.predict(X, return_std=True) if return_std else self.compiled.predict(X)

    def check(self, arm: Arm, recording: Recording | None = None) -> None:
        """Whether the model may answer for this arm and, if given, this recording.

        Raises:
            ModelError: another arm, frame, torque channel or motion; the message names what differs.
        """
        model = f"the model {self.source}"
        if arm.name != self.arm_name or arm.n != len(self.joint_names):
            raise ModelError(
                f"{model} was trained on {self.arm_name} ({len(self.joint_names)} joints): it cannot answer for "
                f"{arm.name} ({arm.n} joints); name the right robot or train a model for it"
            )
        if arm.frame != self.frame:
            raise ModelError(
                f"{model} gives parameters about {self.frame!r}: {arm.name} is set to {arm.frame!r}; "
                "use that frame and move the result"
            )
        if arm.fingerprint != self.arm_fingerprint:
            raise ModelError(
                f"{model} was trained on another {self.arm_name}: masses, geometry, gravity or attached tool differ; "
                "use the arm as it was in training or train again"
            )
        if recording is None:
            return
        if recording.n != arm.n:
            raise ModelError(f"{recording.source} has {recording.n} joints: {model} expects {arm.n}")
        if recording.channel != "measured":
            raise ModelError(
                f"{recording.source} holds {recording.channel} torque: {model} was trained on measured torque"
            )
        if self.motions and not any(motion.matches(recording) for motion in self.motions):
            away = min(motion.distance(recording) for motion in self.motions)
            known = ", ".join(f"{motion.name}, {motion.duration:.2f} s" for motion in self.motions[:3])
            raise ModelError(
                f"{recording.source} ({recording.duration:.2f} s) does not follow a motion {model} was trained on "
                f"({known}; rms distance {away:.3g} rad): run "
                "such a motion from its start, or use least squares, which takes any"
            )

    def check_new(self, dataset_hash: str, payloads: ArrayLike) -> None:
        """Whether these payloads of a data set are new to the model; of another data set than its own they are.

        Args:
            dataset_hash: `Dataset.hash`. payloads: numbers in that data set's list.

        Raises:
            ModelError: one is among those it learned from, or it is unknown which these are.
        """
        if dataset_hash != self.dataset_hash:
            return
        if self.payloads is None:
            raise ModelError(
                f"the model {self.source} learned from this data set and does not say from which of its payloads: its "
                "errors on them may be of what it knows; train it again"
            )
        asked = np.unique(np.asarray(payloads, dtype=int))
        known = np.intersect1d(asked, self.payloads)
        if len(known):
            raise ModelError(
                f"the model {self.source} learned from {len(known)} of the {len(asked)} payloads that are to be new to "
                "it: expected one trained with the same split, by payload, and the same seed"
            )

    def __str__(self) -> str:
        rows = [
            f"{n:>5} = {m:+.5f} ± {Z95 * s:.5f} {u}"
            for n, m, s, u in zip(NAMES, self.phi_mean, self.phi_std, UNITS, strict=True)
        ]
        tied = f"{len(self.motions)} motion(s)" if self.motions else "any motion"
        return (
            f"{self.kind} ensemble of {self.compiled.n_members} for {self.arm_name}, {tied}, payload about "
            f"{self.frame}; training payloads, ± 95 %:\n" + "\n".join(rows)
        )
