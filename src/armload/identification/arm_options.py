"""The options that name an arm and what its answers are relative to: the same for a service and for a survey."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.payloads import Payload


@dataclass(frozen=True)
class ArmOptions:
    """An arm, its tare or profile, its tool, and the method, by names and paths.

    robot, frame, gravity: as of `armload.arms.arm`; None: its defaults.
    tare, profile: paths of a log and of a profile. tool: path of a mounted tool's file, or franka-hand.
    method: as of `identify`.
    """

    robot: str
    frame: str | None = None
    gravity: tuple[float, float, float] | None = None
    tare: str | None = None
    profile: str | None = None
    tool: str | None = None
    method: str | None = None

    def bare_arm(self) -> Arm:
        """The arm without its tool.

        Raises:
            ArmError: there is no such arm, frame or gravity.
        """
        from armload.arms import arm  # slow to load, and whoever supervises other processes needs none

        return arm(self.robot, self.frame, **({} if self.gravity is None else {"gravity": self.gravity}))

    def tool_on(self, bare: Arm) -> Payload | None:
        """The tool that is mounted on the arm; None: there is none.

        Raises:
            PayloadError: its file is missing or none.
        """
        if self.tool is None:
            return None
        from armload.payloads import hand_on, read_payload

        return hand_on(bare) if self.tool == "franka-hand" else read_payload(self.tool)
