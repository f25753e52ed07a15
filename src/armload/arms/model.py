"""A serial arm: bare torque, momentum, limits, and the motion of the payload frame, by Pinocchio (`rigid_body.py`)."""

from __future__ import annotations

import hashlib
import threading
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from armload.arms.description import read_chain
from armload.arms.given import check_ends, check_limits, check_number, gravity_of
from armload.arms.limits import Limits
from armload.arms.rigid_body import Body, BodyMotion, body_motions, built, carrier_pose, placement_of
from armload.errors import ArmError
from armload.inertia import InertialParameters, Inexact, from_order, parameters_only
from armload.runtime.real_numbers import own_reals, reals

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
# one `link_spread`: standard deviation of a link's mass [1], centre of mass [m] and inertia [1]
LINK_SPREAD = (0.02, 0.002, 0.05)


@dataclass(frozen=True, eq=False)
class Arm:
    """A serial arm, the frame its payload is about, and the gravity at its base. Threads may share one.

    >>> from armload.arms import arm
    >>> panda = arm("panda")
    >>> panda.n, panda.frame
    (7, 'panda_link8')
    >>> panda.torque([0, 0, 0, -1.5, 0, 1.5, 0])[1].round(2)  # joint 2 holds the forearm up [N·m]
    np.float64(-24.87)

    Args:
        name: what the arm is called, in a log's header and in a model's artefact.
        urdf: text of a URDF; meshes are ignored, joints off the chain to `frame` are fixed at zero.
        frame: link whose frame the payload is about; None: the last link.
        gravity: gravity in the base's axes (3,) [m/s²]; a tilted base has a tilted gravity.
        attached: a payload that counts as part of the arm (a hand, say), about `frame`; from another frame of the last
            link that it names it is moved there.
        attached_error: how far that may be off; None: not at all. Torque and limits do not depend on it.
        links: inertial parameters (n, 10) of the moving links about their joint frames, where they are to differ from
            the URDF's.
        rated_payload: the maker's rated payload [kg], if known.
        acceleration, jerk: limits (n,) that a URDF cannot hold; those of joints beyond `frame` are passed over.
        velocity_ends: of an arm that is to be slower near the ends of its range the four rows of `VelocityEnds`.
        link_spread: how far the description's link parameters may be off, in units of 2 % of mass, 2 mm of CoM and 5 %
            of inertia (1 sigma): 1 for an identified model, 10 for nominal figures of unknown quality.
        motor_torque: whether the torque is known to be motor current times a constant, with all of the gear's friction
            in it; where it is not known, each log tells.
        gear_loss: standard deviation of the share of the torque that a joint rubs away, where torque is measured
            behind the gears; 0: nothing (`regression.mismatch`).
        torque_gain_std: relative standard deviation of the torque's scale, before a known weight was hung on; None:
            what is usual for a sensor of its side (`posterior.problem.GAIN_STD`).
        known_as: which built-in arm it is, whatever the file that describes it is called.
    """

    name: str
    urdf: str = field(repr=False)
    frame: str | None = None
    gravity: tuple[float, float, float] = STANDARD_GRAVITY
    attached: InertialParameters | None = field(default=None, repr=False)
    attached_error: Inexact | None = field(default=None, repr=False)
    links: NDArray[np.float64] | None = field(default=None, repr=False)
    rated_payload: float | None = field(default=None, repr=False)
    acceleration: tuple[float, ...] | None = field(default=None, repr=False)
    jerk: tuple[float, ...] | None = field(default=None, repr=False)
    velocity_ends: tuple[tuple[float, ...], ...] | None = field(default=None, repr=False)
    link_spread: float = field(default=10.0, repr=False)
    motor_torque: bool = field(default=False, repr=False)
    gear_loss: float = field(default=0.0, repr=False)
    torque_gain_std: float | None = field(default=None, repr=False)
    known_as: str | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "gravity", gravity_of(self.gravity))
        check_number(self.rated_payload, "the rated payload [kg]", zero=False)
        check_number(self.link_spread, "the spread of the links", zero=True)
        check_number(self.gear_loss, "the share that the gears rub away", zero=True)
        check_number(self.torque_gain_std, "the standard deviation of the torque's scale", zero=False)
        chain = read_chain(self.urdf, self.frame, self.name)
        object.__setattr__(self, "urdf", chain.xml)
        object.__setattr__(self, "frame", chain.frame)
        object.__setattr__(self, "_joint_names", chain.joint_names)
        object.__setattr__(self, "_frames", chain.frames)
        object.__setattr__(self, "_rigid", chain.rigid)
        object.__setattr__(self, "_held", chain.held)
        if self.attached is not None and self.attached.frame in set(chain.frames) - {chain.frame}:
            object.__setattr__(self, "attached", replace(self, attached=None).in_frame(self.attached))
        if self.attached is None:
            object.__setattr__(self, "attached_error", None)
        check_limits(self.acceleration, "the acceleration limit", self.n)
        check_limits(self.jerk, "the jerk limit", self.n)
        check_ends(self.velocity_ends, self.n)
        _ = self._model  # fail now, not at the first sample

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k not in ("_model", "_of_threads", "limits")}

    # ------------------------------------------------------------------ what it is

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the moving joints, from the base to the payload frame; the order of every q, dq and tau."""
        return self._joint_names  # type: ignore[attr-defined]

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all links, each a possible payload frame if joints move it."""
        return self._frames  # type: ignore[attr-defined]

    @property
    def fixed_frames(self) -> tuple[str, ...]:
        """Names of the links that move with the payload frame: no joint lies between."""
        return self._rigid  # type: ignore[attr-defined]

    @property
    def held(self) -> tuple[tuple[str, int], ...]:
        """Joints off the chain, which count as standing at zero; how many of the arm's joints carry each of them."""
        return self._held  # type: ignore[attr-defined]

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the masses, geometry, frame and gravity: two arms with the same one give the same torques."""
        model = self._model
        digest = hashlib.sha256()
        for joint in range(1, self.n + 1):
            digest.update(np.round(model.jointPlacements[joint].homogeneous, 9).tobytes())
            kind = model.joints[joint]
            digest.update(kind.shortname().encode())
            if kind.shortname().endswith("Unaligned"):
                digest.update((np.round(kind.extract().axis, 9) + 0.0).tobytes())
            digest.update(np.round(model.inertias[joint].toDynamicParameters(), 9).tobytes())
        digest.update(np.round(self._frame_placement.homogeneous, 9).tobytes())
        digest.update(np.round(self.gravity, 6).tobytes())
        return digest.hexdigest()

    @cached_property
    def limits(self) -> Limits:
        """Joint limits, from the URDF and, for what that cannot hold, from the arm's sheet."""
        return Limits.of(self._model, self.acceleration, self.jerk, self.velocity_ends)

    @property
    def link_parameters(self) -> NDArray[np.float64]:
        """Inertial parameters (n, 10) of the moving links about their joint frames, the attached payload included."""
        return np.array(
            [from_order(self._model.inertias[k].toDynamicParameters(), "pinocchio").phi for k in range(1, self.n + 1)]
        )

    @property
    def base_pose(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rotation (3, 3) and position (3,) [m] of the link that carries the first joint, in the root of the file."""
        return carrier_pose(self._model)

    @property
    def horizontal(self) -> NDArray[np.float64]:
        """Two axes (2, 3) of the base, normal to gravity and to each other: x and y where gravity is along −z."""
        up = -np.asarray(self.gravity) / np.linalg.norm(self.gravity)
        first = np.eye(3)[np.argmin(np.abs(up))]
        first = first - (first @ up) * up
        first /= np.linalg.norm(first)
        return np.array([first, np.cross(up, first)], dtype=np.float64)

    # ------------------------------------------------------------------ other arms made from it

    def leaning(self, angles: ArrayLike) -> Arm:
        """The arm with gravity turned about the axes of `horizontal` by angles (2,) [rad]."""
        both = own_reals(angles, "the angles of gravity", ArmError)
        if both.shape != (2,):
            raise ArmError(f"the angles of gravity have shape {both.shape}: expected (2,), in rad")
        turned = pin.exp3(both @ self.horizontal) @ np.asarray(self.gravity)
        return replace(self, gravity=tuple(turned.tolist()))

    def with_payload(self, payload: InertialParameters, error: Inexact | None = None) -> Arm:
        """The arm with a payload counted as part of it; payloads add up.

        Args:
            payload: about `frame`, or about another frame of the last link that it names.
            error: how far it may be off, about `frame`; None: not at all.

        Raises:
            ArmError: joints lie between the frame that it names and `frame`.
        """
        held, before = self.as_payload(payload), self.attached_error
        off = before if error is None else error if before is None else before + error
        return replace(self, attached=held if self.attached is None else self.attached + held, attached_error=off)

    def with_links(self, links: ArrayLike) -> Arm:
        """The arm with other inertial parameters (n, 10) of its moving links, before any attached payload."""
        links = own_reals(links, "the table of link parameters", ArmError)
        if links.shape != (self.n, 10) or not np.isfinite(links).all():
            raise ArmError(f"link parameters have shape {links.shape}: expected ({self.n}, 10), all finite")
        return replace(self, links=links)

    def parted(self, links: ArrayLike) -> Arm:
        """The same arm with these parameters (n, 10) of its moving links and, attached, what the last has beyond."""
        links = np.asarray(links, dtype=float)
        beyond = InertialParameters(self.link_parameters[-1] - links[-1])
        joint = self._frame_placement.inverse()  # as the payload frame sees it
        return replace(self.with_links(links), attached=beyond.moved(joint.rotation, joint.translation, self.frame))

    def in_frame(self, parameters: InertialParameters) -> InertialParameters:
        """The same body about this arm's payload frame, from any frame fixed to the arm's last moving link.

        Raises:
            ArmError: the parameters' frame is not a frame of this arm, or joints lie between.
        """
        there = parameters_only(parameters).frame
        if there is None or there == self.frame:
            return InertialParameters(parameters.phi, self.frame)
        if there not in self.frames:
            raise ArmError(f"{self.name} has no frame {there!r}: expected one of {', '.join(self.frames)}")
        if there not in self.fixed_frames:
            raise ArmError(
                f"frame {there!r} does not move with {self.frame!r}, joints lie between the two: a payload must sit "
                "behind the last joint"
            )
        index = self._model.getFrameId(there, pin.FrameType.BODY)
        offset = self._frame_placement.actInv(self._model.frames[index].placement)
        return parameters.moved(offset.rotation, offset.translation, self.frame)

    def as_payload(self, parameters: InertialParameters) -> InertialParameters:
        """The same body about the payload frame; a frame that the arm does not know is understood as that one.

        Raises:
            ArmError: joints lie between the two.
        """
        known = parameters_only(parameters).frame in self.frames
        return self.in_frame(parameters if known else InertialParameters(parameters.phi))

    # ------------------------------------------------------------------ rigid-body dynamics

    def torque(self, q: ArrayLike, dq: ArrayLike | None = None, ddq: ArrayLike | None = None) -> NDArray[np.float64]:
        """Joint torque the bare arm needs: tau = M(q)·ddq + C(q, dq)·dq + g(q) (recursive Newton–Euler) [N·m].

        Args:
            q, dq, ddq: (n,) or (N, n) [rad, rad/s, rad/s²]; dq and ddq default to zero.
        """
        rows = zip(*self._samples(q, dq, ddq), strict=True)
        out = np.array([pin.rnea(self._model, self._data, *row) for row in rows]).reshape(-1, self.n)
        return out if np.ndim(q) == 2 else out[0]

    def mass_matrix(self, q: ArrayLike) -> NDArray[np.float64]:
        """Joint-space inertia M(q) (n, n) of one position q (n,) [kg·m²]."""
        q, _, _ = self._samples(q, None, None)
        if len(q) != 1:
            raise ArmError(f"{len(q)} positions were given: expected one, {self.name} has {self.n} joints")
        M = np.triu(pin.crba(self._model, self._data, q[0]))
        return M + np.triu(M, 1).T

    def momentum(self, q: ArrayLike, dq: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Generalised momentum and its drift, (N, n) each: p = M·dq and g − Cᵀ·dq, so that tau = dp/dt + g − Cᵀ·dq.

        Source: De Luca, Albu-Schäffer, Haddadin, Hirzinger, IROS 2006 (the momentum observer).
        """
        q, dq, _ = self._samples(q, dq, None)
        p, drift = np.empty_like(q), np.empty_like(q)
        model, data, rest = self._model, self._data, np.zeros(self.n)
        for k in range(len(q)):
            gravity = pin.computeGeneralizedGravity(model, data, q[k])
            C = pin.computeCoriolisMatrix(model, data, q[k], dq[k])
            drift[k] = gravity - C.T @ dq[k]
            p[k] = pin.rnea(model, data, q[k], rest, dq[k]) - gravity  # M·dq, sooner than by M
        return p, drift

    def frame_motion(self, q: ArrayLike) -> BodyMotion:
        """Jacobian and gravity in the payload frame for samples q (N, n)."""
        placement = self._frame_placement
        return self._motions(q, [Body(self.n, placement.rotation, placement.translation)])[0]

    def link_motions(self, q: ArrayLike) -> list[BodyMotion]:
        """Jacobian and gravity in the joint frame of each moving link for samples q (N, n)."""
        return self._motions(q, [Body(k, np.eye(3), np.zeros(3)) for k in range(1, self.n + 1)])

    def frame_pose(self, q: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rotation (N, 3, 3) and position (N, 3) [m] of the payload frame in the base."""
        q = self._samples(q, None, None)[0]
        R, p = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
        model, data, last, frame = self._model, self._data, self.n, self._frame_placement
        for k in range(len(q)):
            pin.forwardKinematics(model, data, q[k])
            placement = data.oMi[last] * frame
            R[k], p[k] = placement.rotation, placement.translation
        return R, p

    def link_poses(self, q: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rotation (N, n, 3, 3) and position (N, n, 3) [m] of the joint frame of each moving link in the base."""
        q = self._samples(q, None, None)[0]
        R, p = np.empty((len(q), self.n, 3, 3)), np.empty((len(q), self.n, 3))
        for k in range(len(q)):
            pin.forwardKinematics(self._model, self._data, q[k])
            for joint in range(self.n):
                placement = self._data.oMi[joint + 1]
                R[k, joint], p[k, joint] = placement.rotation, placement.translation
        return R, p

    # ------------------------------------------------------------------ inside

    @cached_property
    def _model(self) -> pin.Model:
        about = (self.name, self.urdf, self.joint_names, str(self.frame), self.gravity)
        return built(*about, self.links, self.attached)

    @cached_property
    def _of_threads(self) -> threading.local:
        return threading.local()

    @property
    def _data(self) -> pin.Data:
        """Where Pinocchio writes: each thread's own, as what a call wrote is read after it."""
        own = self._of_threads.__dict__
        return own["data"] if "data" in own else own.setdefault("data", self._model.createData())

    @property
    def _frame_placement(self) -> pin.SE3:
        return placement_of(self._model, str(self.frame))

    def _samples(self, q: ArrayLike, dq: ArrayLike | None, ddq: ArrayLike | None) -> tuple[NDArray[np.float64], ...]:
        try:
            q = reals(q)
            rows = [q, np.zeros_like(q) if dq is None else reals(dq), np.zeros_like(q) if ddq is None else reals(ddq)]
        except ValueError as error:
            raise ArmError(f"a joint array is {error}: expected real numbers ({self.n},) or (N, {self.n})") from None
        out = tuple(np.ascontiguousarray(np.atleast_2d(x)) for x in rows)
        if any(x.shape != out[0].shape for x in out) or out[0].shape[1:] != (self.n,):
            raise ArmError(f"joint arrays have shapes {[x.shape for x in out]}: {self.name} has {self.n} joints")
        return out

    def _motions(self, q: ArrayLike, bodies: list[Body]) -> list[BodyMotion]:
        return body_motions(self._model, self._data, self.gravity, self._samples(q, None, None)[0], bodies)
