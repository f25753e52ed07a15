"""Torque from which a controller has taken gravity: what it took is put back.

A controller that reports tau_c = tau_J − g(q), with g of the arm and of the payload it was set to, says that a joint at
rest carries nothing. tau_J = tau_c + g(q) is again what the rest of armload takes for measured torque. What the
controller's own model of the arm has of gravity is not known: where the description here differs from it, the
difference is an error of the links, which a tare shows.
"""

from __future__ import annotations

from dataclasses import replace

from armload.arms import Arm
from armload.errors import RecordingError
from armload.inertia import InertialParameters
from armload.payloads import NOTHING, read_payload
from armload.recording.recording import Recording


def arm_as_set(arm: Arm, carries: str) -> Arm:
    """The bare arm with what its controller is set to carry: a payload's file, or `NOTHING`.

    Raises:
        PayloadError: the file cannot be read, or is about another frame.
    """
    bare = replace(arm, attached=None)
    return bare if carries == NOTHING else bare.with_payload(bare.in_frame(read_payload(carries).parameters))


def with_gravity(recording: Recording, arm: Arm, payload: InertialParameters | None = None) -> Recording:
    """The recording with g(q) of the arm, and of the payload its controller was set to, added to its torque.

    >>> import numpy as np
    >>> from armload.arms import arm
    >>> panda, still = arm("panda"), np.zeros((2, 7))
    >>> log = Recording(np.array([0.0, 0.1]), still, still, still)
    >>> bool(np.allclose(with_gravity(log, panda).tau, panda.torque(still)))
    True

    Args:
        recording: of torque without gravity [N·m]. arm: with its base's orientation.
        payload: about the arm's payload frame; None: the controller was set to none.

    Raises:
        RecordingError: it was put back already.
    """
    if recording.gravity_of is not None:
        raise RecordingError(f"{recording.source}: `compensated` is said twice: leave one of them out")
    loaded = arm if payload is None else arm.with_payload(payload)
    tau = recording.tau + loaded.torque(recording.q)
    return replace(recording, tau=tau, channel="measured", gravity_of=loaded)
