"""How the logs of a survey are read and asked: the same for all of them, but for what belongs to one arm."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from armload.arms import Arm
from armload.errors import UsageError
from armload.identification.arm_options import ArmOptions
from armload.lab.cells import key_of
from armload.payloads import Payload
from armload.posterior import HybridModel, Profile, load_profile
from armload.recording import ColumnSpec, Recording, read_long
from armload.runtime.version import __version__
from armload.survey.content import file_hash
from armload.survey.logs import Log
from armload.survey.rows import columns

_ARM = "{arm}"


@dataclass(frozen=True)
class Settings(ArmOptions):
    """What is asked of every log.

    tare, profile: paths, in which `{arm}` stands for the arm's name (`Log.arm`); an arm without such a file is asked
        without.
    columns: as of `ColumnSpec.given`. topic: of bags.
    """

    columns: tuple[tuple[str, Any], ...] = ()
    topic: str | None = None

    def of_arm(self, what: str, arm: str) -> Path | None:
        """The tare or the profile of an arm; None: none was named, or this arm has none.

        Raises:
            UsageError: the file is not there, and it was to serve all arms.
        """
        template = getattr(self, what)
        if template is None:
            return None
        path = Path(template.replace(_ARM, arm))
        if path.exists():
            return path
        if _ARM in template:
            return None
        raise UsageError(f"{path} is not there: expected the --{what} of all logs; for one of each arm write {_ARM}")

    def tares_of(self, arms: Collection[str]) -> list[Path]:
        """The tares that a template names, of those arms that have one; a tare of all arms is not among them."""
        if self.tare is None or _ARM not in self.tare:
            return []
        return [path for arm in sorted(arms) if (path := self.of_arm("tare", arm)) is not None]

    def lacking(self, arm: str) -> list[str]:
        """What was named by a template, and is not there of this arm."""
        wanted = [what for what in ("tare", "profile") if getattr(self, what) is not None]
        return [f"there is no {what} of the arm {arm}" for what in wanted if self.of_arm(what, arm) is None]

    def arms_without(self, what: str, arms: Collection[str]) -> list[str]:
        """The arms of which there is no tare, or no profile, where one of each was named by a template."""
        if _ARM not in (getattr(self, what) or ""):
            return []
        return [arm for arm in sorted(arms) if self.of_arm(what, arm) is None]

    def key(self, log: Log, content: str) -> str:
        """Of all that the rows of a log depend on: its content, settings, every file they name, version and columns."""
        files = [self.of_arm("tare", log.arm), self.of_arm("profile", log.arm), *self._models()]
        named = [path for path in (self.tool, self.method, self.robot) if path is not None and Path(path).is_file()]
        hashes = [None if file is None else _hash_of(file) for file in [*files, *map(Path, named)]]
        asked = list(columns(self.arm().n))
        return key_of(__version__, asked, content, log.name, log.arm, log.episode, asdict(self), hashes)

    def _models(self) -> list[Path]:
        """The shipped model's file, where one may answer."""
        found = HybridModel.shipped(self.arm()) if self.method in (None, "hybrid") else None
        return [found] if found is not None and found.is_file() else []

    def arm(self) -> Arm:
        """The arm, built once for each process."""
        return _arm(self)

    def recording(self, log: Log, path: Path, episode: int | None = None) -> Recording:
        """Read a log, or one episode of it, from where it lies on this machine."""
        from armload.recording import has_topics

        wanted = log.episode if episode is None else episode
        spec = ColumnSpec.of(dict(self.columns))
        columns = spec.of_values if has_topics(path) else spec.over(episode=wanted)
        topic = self.topic if has_topics(path) else None
        return read_long(path, self.arm(), topic=topic, columns=columns)

    def mounted(self) -> Payload | None:
        """The tool that is mounted, read once for each process."""
        return _tool(self)

    def tare_of(self, arm: str) -> Recording | None:
        """The arm's tare, read once for each process."""
        path = self.of_arm("tare", arm)
        return None if path is None else _tare(self, arm, path, _hash_of(path))

    def profile_of(self, arm: str) -> Profile | None:
        """The arm's profile, read once for each process."""
        path = self.of_arm("profile", arm)
        return None if path is None else _profile(path, _hash_of(path))


def _hash_of(path: Path) -> str:
    files = sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
    return key_of([file_hash(file) for file in files])


@lru_cache(maxsize=2)
def _arm(settings: Settings) -> Arm:
    return settings.bare_arm()


@lru_cache(maxsize=2)
def _tool(settings: Settings) -> Payload | None:
    return settings.tool_on(settings.arm())


@lru_cache(maxsize=2)  # logs come sorted by arm
def _tare(settings: Settings, arm: str, path: Path, _: str) -> Recording:
    return settings.recording(Log(str(path), arm), path)


@lru_cache(maxsize=2)
def _profile(path: Path, _: str) -> Profile:
    return load_profile(path)
