"""What is known of each built-in arm and no URDF says: one sheet per arm, `descriptions/NAME.toml`, with its sources.

An arm is added by its sheet and its `descriptions/NAME.urdf`; no other code names it but the list of arms whose hybrid
is shipped (`armload.posterior.model_file`). A key carries its unit, a table its source:

    [payload]
    "rated [kg]" = 3.0
    source = "data sheet"

What a sheet leaves out is not known, and each user's rule for unknown arms holds (`strength.py`).
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from importlib import resources
from types import MappingProxyType
from typing import Any, NamedTuple

from armload.errors import ArmError

_SHEETS = "descriptions"


def _fact(table: str, key: str, default: Any = MISSING) -> Any:
    """A fact of the sheet: its table, its key with the unit, and its default if it may be left out."""
    return field(default=default, metadata={"table": table, "key": key})


class Capsule(NamedTuple):
    """All points within `radius` [m] of a segment that is fixed to a link (0 is the base), in its joint frame [m]."""

    link: int
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float


@dataclass(frozen=True, kw_only=True)
class ArmFacts:
    """One arm's sheet. Figures per joint are (n,), units stand in the keys; None: not known."""

    name: str  # of the arm, its sheet and its description
    product: str = _fact("arm", "product")
    joints: int = _fact("arm", "joints")
    weight: float | None = _fact("arm", "weight [kg]", None)  # of the whole arm with its base
    flange: str = _fact("flange", "frame")  # what its maker counts payloads from
    flange_ending: str = _fact("flange", "ending")  # what every such flange is called behind a prefix
    hand: str | None = _fact("flange", "hand", None)  # the built-in tool that sits on it
    rated_payload: float = _fact("payload", "rated [kg]")
    torque_side: str = _fact("torque", "side")  # of the gear on which torque is measured: "link" or "motor"
    gain_std: float | None = _fact("gain", "std [1]", None)  # of the torque's scale, before a known weight was hung on
    link_spread: float = _fact("links", "spread")  # see `Arm`
    acceleration: tuple[float, ...] | None = _fact("limits", "acceleration [rad/s²]", None)
    jerk: tuple[float, ...] | None = _fact("limits", "jerk [rad/s³]", None)
    # less velocity near the ends of the range, at most √(slope·(end − q)) − reserve: all four or none
    end_low: tuple[float, ...] | None = _fact("limits", "end_low [rad]", None)
    end_high: tuple[float, ...] | None = _fact("limits", "end_high [rad]", None)
    end_slope: tuple[float, ...] | None = _fact("limits", "end_slope [rad/s²]", None)
    end_reserve: tuple[float, ...] | None = _fact("limits", "end_reserve [rad/s]", None)
    position_stiffness: tuple[float, ...] | None = _fact("control", "position_stiffness [N·m/rad]", None)
    impedance_stiffness: tuple[float, ...] | None = _fact("control", "impedance_stiffness [N·m/rad]", None)
    offset: tuple[float, ...] | None = _fact("mismatch", "offset [N·m]", None)
    friction: tuple[float, ...] | None = _fact("mismatch", "friction [N·m]", None)
    residual: tuple[float, ...] | None = _fact("mismatch", "residual [N·m]", None)
    torque_noise: tuple[float, ...] | None = _fact("sensors", "torque_noise [N·m]", None)
    velocity_noise: tuple[float, ...] | None = _fact("sensors", "velocity_noise [rad/s]", None)
    position_noise: tuple[float, ...] | None = _fact("sensors", "position_noise [rad]", None)
    vibration: tuple[float, ...] | None = _fact("sensors", "vibration [N·m]", None)
    torque_quantum: tuple[float, ...] | None = _fact("sensors", "torque_quantum [N·m]", None)
    command_lag: float | None = _fact("sensors", "command_lag [s]", None)
    torque_skew: float | None = _fact("sensors", "torque_skew [s]", None)
    jitter: float | None = _fact("sensors", "jitter [s]", None)
    lost: float | None = _fact("sensors", "lost [1]", None)
    capsules: tuple[Capsule, ...] | None = _fact("collision", "capsules [m]", None)  # its outer size
    excitation: str | None = _fact("motion", "excitation", None)  # the shipped motion that was designed for it
    log_names: tuple[tuple[str, ...], ...] | None = _fact("logs", "joint_names", None)  # of its joints in others' logs
    scheme: str | None = _fact("connection", "scheme", None)  # of its address as a live source
    controller: str | None = _fact("connection", "controller", None)  # whose forms of a load it takes
    torque_constants: tuple[float, ...] | None = _fact("current", "torque_constants [N·m/A]", None)

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            rows = value if entry.name == "log_names" and value is not None else (value,)
            for row in rows:
                if isinstance(row, tuple) and entry.name != "capsules" and len(row) != self.joints:
                    raise ArmError(
                        f"{entry.name} of the sheet of {self.name} has {len(row)} entries: expected {self.joints}, one "
                        "per joint"
                    )
        if self.torque_side not in ("link", "motor"):
            raise ArmError(f"torque side of the sheet of {self.name} is {self.torque_side!r}: expected link or motor")

    @property
    def of_arm(self) -> dict[str, Any]:
        """The fields of `Arm` that the sheet fills."""
        ends = self.end_low, self.end_high, self.end_slope, self.end_reserve
        return {
            "rated_payload": self.rated_payload,
            "acceleration": self.acceleration,
            "jerk": self.jerk,
            "velocity_ends": None if None in ends else ends,
            "link_spread": self.link_spread,
            "torque_gain_std": self.gain_std,
            "motor_torque": self.torque_side == "motor",
            "known_as": self.name,
        }

    @property
    def sensors(self) -> dict[str, Any] | None:
        """What its sensors add, by the names of `armload.simulation.Sensors`; None: not measured."""
        of_sensors = [entry.name for entry in fields(self) if entry.metadata.get("table") == "sensors"]
        found = {name: getattr(self, name) for name in of_sensors if getattr(self, name) is not None}
        return found or None


def read_sheet(name: str, text: str) -> ArmFacts:
    """The facts of one arm from the text of its sheet.

    Raises:
        ArmError: not TOML, a table without its source, a key or unit that is not known, or a fact that is missing.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ArmError(f"the sheet of {name} is not TOML: {error}") from None
    places = {(f.metadata["table"], f.metadata["key"]): f for f in fields(ArmFacts) if f.metadata}
    facts: dict[str, Any] = {"name": name}
    for table, entries in tables.items():
        if not isinstance(entries, dict) or not entries.get("source"):
            raise ArmError(f"[{table}] of the sheet of {name} has no source: say where its figures are from")
        for key, value in entries.items():
            if key == "source":
                continue
            if (table, key) not in places:
                known = ", ".join(repr(k) for t, k in places if t == table) or "another table"
                raise ArmError(f"[{table}] of the sheet of {name} has {key!r}: expected {known}")
            facts[places[table, key].name] = _frozen(value)
    required = [(table, key) for (table, key), f in places.items() if f.default is MISSING]
    missing = [f"{key!r} in [{table}]" for table, key in required if places[table, key].name not in facts]
    if missing:
        raise ArmError(f"the sheet of {name} lacks {missing[0]}: every sheet needs it")
    if "capsules" in facts:
        facts["capsules"] = tuple(Capsule(*capsule) for capsule in facts["capsules"])
    return ArmFacts(**facts)


def _read_all() -> Mapping[str, ArmFacts]:
    sheets = sorted(resources.files("armload.arms").joinpath(_SHEETS).iterdir(), key=lambda file: file.name)
    found = {file.name.removesuffix(".toml"): file for file in sheets if file.name.endswith(".toml")}
    return MappingProxyType({name: read_sheet(name, file.read_text(encoding="utf-8")) for name, file in found.items()})


def description_of(name: str) -> str:
    """The URDF of a built-in arm."""
    return resources.files("armload.arms").joinpath(_SHEETS, f"{name}.urdf").read_text(encoding="utf-8")


def _frozen(value: Any) -> Any:
    return tuple(_frozen(x) for x in value) if isinstance(value, list) else value


ARMS: Mapping[str, ArmFacts] = _read_all()  # the built-in arms: their facts, by name
