"""What a service is to do: arms and their sources, and whom to tell, from a TOML file."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.devices import has_controller
from armload.errors import IdentificationError, UsageError
from armload.identification.arm_options import ArmOptions
from armload.identification.known_options import KnownOptions, centre, weighed
from armload.recording.growing_file import RECORDS
from armload.service.access import is_loopback, read_token
from armload.service.idle import check_arm, check_service
from armload.service.mqtt import checked
from armload.service.old_states import digest_of, state_file
from armload.service.webhook import check_webhook

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.inertia import InertialParameters

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")  # a file's name has room for more beside it
_LEAST_EVERY = 0.02  # [s] more lines are more than anybody reads
READ = ("tare", "profile", "tool", "mounted", "body")  # files that an arm's process reads
_PATHS = (*READ, "save", "record")
NO_FILES = ("franka-hand", "test", "nothing")  # in the place of a payload's file
_NAMES_OR_PATHS = ("robot", "method")  # a path has a suffix or a folder, a name has neither
TOOL_OR_TARE = (  # but for a tare that is taken on the stream itself
    "whether the tool was mounted at the tare, or in the profile's logs, cannot be found out on a stream: give the "
    "tool, or the tare or profile"
)
_RATE = 1000.0  # [Hz] of the simulator, as of `open_source`
_NOT_IN_FILES = ("arms", "duration", "token")  # of `ServiceSettings`, which no file says
_READ_ELSEWHERE = ("token_file",)  # a token has a file of its own, which is checked
# what an arm's state says or does not change: the state goes on where one of these is another
_BESIDE_STATE = ("save", "record", "rating", "com_range", "apply", "mounted")
# settings that stand in the name of a state whatever they are; any other does where it is given, so that a state of a
# version that had no such setting goes on
_IN_STATE = (
    *("name", "source", "robot", "frame", "gravity", "method"),
    *("tare", "profile", "tool", "loop", "rate"),
)
_RANGES = {  # what numbers may be: in words, and between which two
    "every": ("a time above 0 s", 0.0, math.inf),
    "rating": ("a mass above 0 kg", 0.0, math.inf),
    "com_range": ("a length above 0 m", 0.0, math.inf),
    "rate": ("a rate above 0 Hz", 0.0, math.inf),
    "port": ("a port from 0 to 65535", -1, 65536),
}
_KINDS = {  # of a field: what TOML may give for it, and in words
    "str": (str, "a text"),
    "float": ((int, float), "a number"),
    "bool": (bool, "true or false"),
    "int": (int, "a whole number"),
    "tuple": (list, "a list"),
    "dict": (dict, "a table"),
}


@dataclass(frozen=True, kw_only=True)
class ArmSettings(ArmOptions, KnownOptions):
    """One arm.

    name: in lines and addresses. source: see `open_source`. save: the folder of its state; None: nothing is kept.
    record: a `.csv` or `.mcap` file; if it exists, the next name that is free is taken. rating: the most it may hold
    [kg]; None: what the arm is rated for.
    com_range: the farthest its payload's centre of mass may be [m]. loop: replay a log again and again.
    rate: of the simulator [Hz]; None: 1000.
    apply: "auto": what is identified is told to the robot's controller (`Feedback`).
    mounted: path of what was on the flange at the tare or profile, or "nothing"; for `apply`.
    tare_age: [s], in a file also "1d"; None: by the tare's clock.
    steady: whether velocities are told by the positions, too (`devices.Steadied`).
    """

    name: str
    source: str
    save: str | None = None
    record: str | None = None
    rating: float | None = None
    com_range: float | None = None
    loop: bool = False
    rate: float | None = None
    apply: str | None = None
    mounted: str | None = None
    steady: bool = False
    tare_age: float | None = None

    def __post_init__(self) -> None:
        if self.tare_age is not None and self.tare is None:
            raise UsageError(f"{self.name}: tare_age says how old a tare is, but there is no tare")
        if self.tare_age is not None and not 0.0 <= self.tare_age < math.inf:
            raise UsageError(f"{self.name}: tare_age is {self.tare_age:g} s: expected a time of 0 or more")
        if self.tool is not None and (self.tare is not None or self.profile is not None):
            raise UsageError(f"{self.name}: {TOOL_OR_TARE}")
        if self.record is not None and Path(self.record).suffix.lower() not in RECORDS:
            raise UsageError(f"{self.name}: record is {self.record}: expected a name that ends in .csv or .mcap")
        if self.steady and self.profile is not None:
            raise UsageError(
                f"{self.name}: steady and profile: a profile is learned from velocities as they come; leave one out"
            )
        for text, read in ((self.mass, weighed), (self.com, centre)):
            if text is not None:
                try:
                    read(text)
                except IdentificationError as error:
                    raise UsageError(f"{self.name}: {error}") from None
        if self.apply not in (None, "auto"):
            raise UsageError(f'{self.name}: apply is {self.apply!r}: expected "auto"')
        check_arm(self)
        if self.apply is not None and not has_controller(self.source):
            raise UsageError(
                f"{self.name}: no load can be written to {self.source}: expected fr3://, panda:// or ur://"
            )

    @property
    def replays(self) -> bool:
        """Whether the source is a log."""
        return self.source != "sim" and "://" not in self.source

    @property
    def state(self) -> Path | None:
        """The file of the identifier's state. Other settings have another name: a state with another tare is none.

        Raises:
            UsageError: a file that it names cannot be read.
        """
        if self.save is None:
            return None
        given = {f.name for f in dataclasses.fields(self) if f.name in _IN_STATE or getattr(self, f.name) != f.default}
        asked = {key: value for key, value in self.to_dict().items() if key in given - {*_BESIDE_STATE}}
        asked["rate"] = _RATE if self.rate is None else self.rate  # as versions wrote it that had no other word for it
        for key in ("tare", "profile", "tool", "body"):
            if asked.get(key) is not None and ((path := Path(asked[key])).is_file() or path.is_dir()):
                asked[key] = [asked[key], digest_of(key, path)]
        return state_file(self.save, self.name, asked)

    def mounted_on(self, bare: Arm) -> InertialParameters | None:
        """What is on the flange that answers lack; None: nobody says.

        Raises:
            PayloadError: its file is missing or none.
        """
        from armload.inertia import InertialParameters  # slow to load, and the supervisor needs none
        from armload.payloads import NOTHING

        if self.mounted == NOTHING:
            return InertialParameters.zero(bare.frame)
        tool = dataclasses.replace(self, tool=self.mounted or self.tool).tool_on(bare)
        return None if tool is None else tool.parameters

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return dataclasses.asdict(self)


@dataclass(frozen=True)
class ServiceSettings:
    """The whole service.

    arms: one process each. every: [s] between two lines of an arm. host, port: of the endpoint; host None: this
    machine alone, port None: there is none. token: what a request must bring; required beyond loopback.
    webhook: where alarms go. headers: sent with them. mqtt: a broker they go to. duration: end after so long [s].
    spare: whether a process is kept ready for the arm whose process ends next.
    """

    arms: tuple[ArmSettings, ...]
    every: float = 0.1
    host: str | None = None
    port: int | None = None
    token: str | None = None
    webhook: str | None = None
    headers: dict[str, str] = field(default_factory=dict)
    mqtt: str | None = None
    duration: float | None = None
    spare: bool = True

    def __post_init__(self) -> None:
        names = [arm.name for arm in self.arms]
        if not names:
            raise UsageError("no arm is named: expected a source, or a file with [[arm]] tables")
        if doubled := sorted({name for name in names if names.count(name) > 1}):
            raise UsageError(f"two arms are called {doubled[0]!r}: give each a name of its own")
        records = [arm.record for arm in self.arms if arm.record is not None]
        if doubled := sorted({record for record in records if records.count(record) > 1}):
            raise UsageError(f"two arms are recorded in {doubled[0]}: give each a file of its own")
        check_service(self)
        if not _LEAST_EVERY <= self.every < math.inf:
            raise UsageError(f"every is {self.every:g} s: expected at least {_LEAST_EVERY} s between two lines")
        if self.webhook is not None:
            check_webhook(self.webhook, self.headers)
        if self.mqtt is not None:
            checked(self.mqtt)
        if self.token is None and self.host is not None and not is_loopback(self.host):
            raise UsageError(
                f"the endpoint at {self.host} can be reached from other machines: "
                "give it a token, or the host 127.0.0.1"
            )


def read_settings(path: str | Path, **over: Any) -> ServiceSettings:
    """The settings in a TOML file; paths in it are relative to its folder.

    Args:
        path: the file. over: settings of the service that take the place of the file's.

    Raises:
        UsageError: the file is missing or none, or says what nobody knows.
    """
    path = Path(path)
    try:
        said = tomllib.loads(path.read_text(encoding="utf-8-sig"))  # some editors begin a text with a mark
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UsageError(f"{path} is no TOML: {error}") from None
    tables = said.pop("arm", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise UsageError(f"{path}: arm is no list of tables: expected [[arm]] before each")
    file = said.pop("token_file", None)
    arms = tuple(_arm(table, path) for table in tables)
    service = _checked(said, ServiceSettings, f"{path}", _NOT_IN_FILES, _READ_ELSEWHERE)
    if file is not None:
        service["token"] = read_token(path.parent / str(file))
    return ServiceSettings(arms, **{**service, **over})


def _arm(table: dict[str, Any], path: Path) -> ArmSettings:
    where = f"{path}, arm {table.get('name', '?')!r}"
    if isinstance(table.get("tare_age"), str):
        table = {**table, "tare_age": _seconds(table["tare_age"], where)}
    settings = _checked(table, ArmSettings, where)
    for key in ("name", "source", "robot"):
        if key not in settings:
            raise UsageError(f"{where}: there is no {key}: expected name, source and robot for each arm")
    for key in _PATHS:
        if key in settings and settings[key] not in NO_FILES:
            settings[key] = str(path.parent / settings[key])
    for key in _NAMES_OR_PATHS:
        said = Path(settings.get(key, ""))
        if said.suffix or len(said.parts) > 1:
            settings[key] = str(path.parent / said)
    if "://" not in settings["source"] and settings["source"] != "sim":
        settings["source"] = str(path.parent / settings["source"])
    if "gravity" in settings:
        if len(settings["gravity"]) != 3:
            raise UsageError(f"{where}: gravity has {len(settings['gravity'])} numbers: expected three, in m/s²")
        if not all(isinstance(x, (int, float)) and math.isfinite(x) for x in settings["gravity"]):
            raise UsageError(f"{where}: gravity is {settings['gravity']}: expected three numbers, in m/s²")
        settings["gravity"] = tuple(float(x) for x in settings["gravity"])
    if not _NAME.fullmatch(settings["name"]):
        raise UsageError(f"{where}: the name is expected to be of at most 100 letters, digits, '-', '_' and '.'")
    return ArmSettings(**settings)


def _seconds(text: str, where: str) -> float:
    from armload.identification.tare_age import seconds_of  # slow to load, and the supervisor needs none

    try:
        return seconds_of(text)
    except IdentificationError as error:
        raise UsageError(f"{where}: tare_age: {error}") from None


def _checked(
    said: dict[str, Any], kind: type, where: str, without: tuple[str, ...] = (), also: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Known keys with values of their types; `also` are read elsewhere."""
    fields = {f.name: str(f.type).split(" | ")[0].split("[")[0] for f in dataclasses.fields(kind)}
    for key, value in said.items():
        if key not in fields or key in without:
            known = ", ".join([*(name for name in fields if name not in without), *also])
            if kind is ServiceSettings:
                known += "; settings of an arm below [[arm]]"
            of_service = {f.name for f in dataclasses.fields(ServiceSettings)} - {*_NOT_IN_FILES} | {*_READ_ELSEWHERE}
            if kind is ArmSettings and key in of_service:  # TOML counts what follows [[arm]] to that arm
                raise UsageError(f"{where}: {key} is of the service: write it above the first [[arm]]")
            raise UsageError(f"{where}: unknown setting {key!r}: expected some of {known}")
        expected, words = _KINDS[fields[key]]
        if not isinstance(value, expected) or (isinstance(value, bool) and fields[key] != "bool"):
            raise UsageError(f"{where}: {key} is {json.dumps(value, default=str)}: expected {words}")
        if isinstance(value, str) and "\0" in value:
            raise UsageError(f"{where}: {key} is {value!r}: expected a text without a zero byte")
        if key in _RANGES:
            words, below, above = _RANGES[key]
            if not below < value < above:
                raise UsageError(f"{where}: {key} is {value}: expected {words}")
    return dict(said)
