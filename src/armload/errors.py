"""Every exception armload raises on purpose. Each message says what was found, what was expected and what to do."""

from typing import Any


def one_line(error: Exception) -> str:
    """The message of another library's exception on one line; its type where it has no message."""
    return " ".join(str(error).split()) or type(error).__name__


class ArmloadError(Exception):
    """Base of all errors a user can cause or mend; the command line prints it as one sentence and exits with 2."""


class InertiaError(ArmloadError, ValueError):
    """Inertial parameters that cannot be read, converted or combined."""


class ArmError(ArmloadError, ValueError):
    """An unknown robot or frame, or a robot description that cannot be used."""


class MotionError(ArmloadError, ValueError):
    """A motion that cannot be read, or that the arm must not run."""


class PayloadError(ArmloadError, ValueError):
    """A payload that cannot be built or read."""


class RecordingError(ArmloadError, ValueError):
    """A log that is missing, unreadable, malformed or not plausible for the arm."""


class NoEpisodesError(RecordingError):
    """A file without episodes, of which one was named."""


class EpisodesError(RecordingError):
    """A file of several episodes, of which none was named; `episodes` are those there are."""

    def __init__(self, message: str, episodes: tuple[int, ...]) -> None:
        super().__init__(message)
        self.episodes = episodes

    def __reduce__(self) -> tuple[Any, ...]:  # a pool of processes hands errors over, and breaks where it cannot
        return type(self), (str(self), self.episodes)


class DatasetError(ArmloadError, ValueError):
    """A data set that is incomplete, damaged or of another arm or motion."""


class ModelError(ArmloadError, ValueError):
    """A learned model that is damaged or belongs to another arm, motion or frame."""


class IdentificationError(ArmloadError, ValueError):
    """An identification that cannot be made from what was given."""


class SourceError(ArmloadError, ConnectionError):
    """A robot, topic or file that cannot be opened as a stream, or that was lost."""


class SourceSetupError(SourceError):
    """A source that can never be opened as it was asked for, whatever its robot does: waiting for it is of no use."""


class SafetyError(ArmloadError, RuntimeError):
    """A movement that must not begin, or that was stopped."""


class SinkError(ArmloadError, ValueError):
    """A payload that cannot be exported, or must not be written to a robot."""


class SentError(SinkError):
    """A payload that was sent to a robot which counts another one now, or does not say which."""


class ClusterError(ArmloadError, ConnectionError):
    """A cluster that is gone, or that has no worker."""


class UsageError(ArmloadError):
    """A command line that cannot be understood."""


class ReportError(ArmloadError, ValueError):
    """A report that cannot be written."""
