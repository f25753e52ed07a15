"""Sources by name: what the command line and a reader's own process are given."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import parse_qs, urlsplit

from armload.arms import Arm, rated_mass
from armload.devices.detached import Detached
from armload.devices.files.source import Replay
from armload.devices.franka import source as franka
from armload.devices.franka.source import FrankaSource
from armload.devices.recorder import Recorded
from armload.devices.ros2.effort import Effort
from armload.devices.ros2.source import Ros2Source
from armload.devices.source import Source
from armload.devices.ur import source as ur
from armload.devices.ur.source import URSource
from armload.errors import SourceError, SourceSetupError
from armload.recording import ColumnSpec

SCHEMES = ("fr3", "panda", "ur", "ros2")
# what may follow an address: of a UR joint torque per current, of ROS 2 what `effort` is, and who moves the arm
_OPTIONS = {"ur": ("torque_constants",), "ros2": ("torque_constants", "compensated", "controller")}
_DETACHED = ("fr3", "panda", "ur")  # read in a process of their own by default


def open_source(
    spec: str | Path,
    arm: Arm,
    *,
    record: str | Path | None = None,
    detached: bool | None = None,
    speed: float | None = 1.0,
    loop: bool = False,
    topic: str | None = None,
    columns: ColumnSpec | Mapping[str, Any] | None = None,
    torque_constants: Sequence[float] | None = None,
    payloads: Sequence[tuple[float, Any]] | None = None,
    world: str = "real-like",
    sensors: bool = True,
    rate: float = 1000.0,
    duration: float | None = None,
    seed: int = 0,
) -> Source:
    """Open a robot, a simulator or a recording as a stream of samples.

    | spec | what |
    |---|---|
    | `run.csv` (or any other recording) | replay |
    | `sim` | the simulator |
    | `fr3://ADDRESS`, `panda://ADDRESS` | a Franka robot |
    | `ur://ADDRESS`, `ur://ADDRESS?torque_constants=12,12,10,11,11,11` | a UR arm |
    | `ros2:///joint_states`, with `?torque_constants=…` or `?compensated=nothing` | a ROS 2 topic (`ros2.Effort`) |

    >>> from armload.arms import arm
    >>> with open_source("sim", arm("panda"), speed=None, duration=0.01) as source:
    ...     source.name, sum(1 for _ in source) > 5
    ('simulated panda', True)

    Args:
        spec: see the table.
        arm: whose samples they are.
        record: a `.csv` or `.mcap` file to keep every sample in (`Recorder`).
        detached: read in a process of its own (`Detached`); None: Franka and UR robots are.
        speed: of a replay or the simulator: 1 real time, None as fast as possible.
        loop: replay again and again.
        topic: of a bag.
        columns: of a recording, where its header leaves them open.
        torque_constants: of a UR arm (6,) [N·m/A].
        payloads: of the simulator: (time [s], payload) pairs; None: another one every 20 s for an hour, with pauses.
        world: of the simulator: "nominal", "real-like" or "beyond".
        sensors: of the simulator: what real sensors add; False: ideal ones.
        rate, duration, seed: of the simulator: [Hz], [s] (None: for ever), of world, sensors and payloads.

    Raises:
        SourceError: no such source, it cannot be reached, or its client is not installed.
        RecordingError: the recording cannot be read, or the record not be written.
    """
    name = str(spec)
    scheme = _scheme(name)
    timing = {"rate": rate, "speed": speed, "duration": duration, "seed": seed}
    simulator = partial(_simulator, arm, payloads, world, sensors, **timing)
    if detached or (detached is None and scheme in _DETACHED):
        simulated = simulator() if name == "sim" else None  # the same simulator, never run here: it knows the truth
        return Detached(
            name,
            arm,
            twin=simulated,
            record=record,
            speed=speed,
            loop=loop,
            topic=topic,
            columns=ColumnSpec.of(columns).given(),
            torque_constants=None if torque_constants is None else [float(x) for x in torque_constants],
            payloads=payloads,
            world=world,
            sensors=sensors,
            rate=rate,
            duration=duration,
            seed=seed,
        )
    if scheme:
        source = _robot(name, arm, torque_constants)
    elif name == "sim":
        source = simulator()
    else:
        source = Replay(name, arm, speed=speed, loop=loop, topic=topic, columns=columns)
    if record is None:
        return source
    try:
        return Recorded(source, record, arm)
    except BaseException:
        source.close()
        raise


def check_spec(spec: str) -> None:
    """See that something is named that there can be, without looking for it.

    Raises:
        SourceError: no such kind of source, no address, or an option that there is not.
    """
    if _scheme(spec):
        address_of(spec)


def _scheme(name: str) -> str:
    """That of a robot's address, "" of anything else."""
    scheme = name.partition("://")[0].lower() if "://" in name else ""
    if scheme and scheme not in SCHEMES:
        raise SourceSetupError(
            f"{name}: unknown kind of source {scheme!r}: expected {', '.join(f'{s}://' for s in SCHEMES)}, sim, or the "
            "path of a recording"
        )
    return scheme


def prepare(spec: str) -> str | None:
    """Load the client a robot is read through, ahead of `open_source`: loading may take seconds, an answer does not.

    Returns:
        The error message for a robot that then does not answer; None: no limit, or no client.
    """
    silent = "it does not answer"
    with contextlib.suppress(SourceError):  # raised again when the source is opened
        if _scheme(spec) not in _DETACHED:
            return None
        address = address_of(spec)
        if address.scheme == "ur":
            ur.load_client()
            return ur.unreachable(address.host, silent)
        franka.load_client(address.scheme)
        return franka.unreachable(address.host, silent, address.scheme)
    return None


class Address(NamedTuple):
    """A robot's, from scheme://HOST?torque_constants=… [N·m/A]; of ROS 2 `host` is the topic, as is ros2://TOPIC."""

    scheme: str
    host: str
    torque_constants: list[float] | None
    compensated: str | None = None
    controller: str | None = None

    def effort(self, arm: Arm, torque_constants: Sequence[float] | None = None) -> Effort:
        """What `effort` is on its topic."""
        return Effort(arm, self.torque_constants or torque_constants, self.compensated)


def written(scheme: str) -> str:
    """How a robot's address is written, for messages.

    >>> written("fr3"), written("ros2")
    ('fr3://ADDRESS', 'ros2://TOPIC')
    """
    return f"{scheme}://{'TOPIC' if scheme == 'ros2' else 'ADDRESS'}"


def address_of(name: str) -> Address:
    """What a robot's address says.

    Raises:
        SourceSetupError: it names no robot, has an option that there is not, or says what no client can use: a port.
    """
    try:
        parts = urlsplit(name)
        host = parts.netloc + parts.path if parts.scheme == "ros2" else parts.hostname
    except ValueError as error:
        raise SourceSetupError(f"{name} is no address ({error}): expected a host's name or IP address") from None
    if host is None or not host.strip("/"):
        no, such = ("topic", "/joint_states") if parts.scheme == "ros2" else ("robot", "172.16.0.2")
        raise SourceSetupError(
            f"{name} names no {no}: expected {written(parts.scheme)}, such as {parts.scheme}://{such}"
        )
    if parts.scheme != "ros2" and (parts.netloc.strip("[]").lower() != host.lower() or parts.path.strip("/")):
        raise SourceSetupError(
            f"{name} says more than where the robot is: expected {parts.scheme}://{host}; its ports are fixed"
        )
    asked = parse_qs(parts.query, keep_blank_values=True)
    options = _OPTIONS.get(parts.scheme, ())
    stray = [key for key in asked if key not in options]
    if stray:
        said = " or ".join(f"?{key}=…" for key in options)
        raise SourceSetupError(f"{name}: unknown option {stray[0]!r}: expected the address{said and f', with {said}'}")
    given = asked.get("torque_constants", [""])[-1]
    try:
        constants = [float(x) for x in given.split(",")] if "torque_constants" in asked else None
    except ValueError:
        raise SourceSetupError(
            f"{name}: torque_constants are {given!r}: expected one in N·m/A for each joint"
        ) from None
    of_ros2 = {key: values[-1] for key, values in asked.items() if key != "torque_constants"}
    return Address(parts.scheme, host, constants, **of_ros2)


def _robot(name: str, arm: Arm, torque_constants: Sequence[float] | None) -> Source:
    address = address_of(name)
    if address.scheme == "ros2":
        return Ros2Source(address.host, arm, effort=address.effort(arm, torque_constants))
    if address.scheme == "ur":
        return URSource(address.host, arm, address.torque_constants or torque_constants)
    return FrankaSource(address.host, arm, address.scheme)


def _simulator(
    arm: Arm, payloads: Sequence[tuple[float, Any]] | None, world: str, sensors: bool, seed: int, **more: Any
) -> Source:
    from armload.devices.simulator.source import Simulator  # a robot's reader starts without a simulator
    from armload.payloads import draw_payload
    from armload.simulation import Sensors, World

    worlds = {"nominal": World.nominal, "real-like": partial(World.real_like, seed=seed)}
    worlds["beyond"] = partial(World.beyond, seed=seed)
    if world not in worlds:
        raise SourceError(f"there is no world {world!r}: expected one of {', '.join(worlds)}")
    if payloads is None:
        rated, payloads = rated_mass(arm), []
        for k in range(180):
            payloads += [(5.0 + 20.0 * k, draw_payload("boxes", seed + k, rated=rated)), (20.0 + 20.0 * k, None)]
    seen = Sensors.of(arm) if sensors else None
    return Simulator(arm, payloads=payloads, world=worlds[world](arm), sensors=seen, seed=seed, **more)
