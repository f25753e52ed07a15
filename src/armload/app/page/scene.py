"""The picture in three dimensions: the arm, what it holds as it is believed to be, and as it is where that is known."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.app.page.drawing import Box, arm_parts, com_region, edges, ellipsoid, equivalent_box, frame_poses, has_com
from armload.arms import Arm
from armload.inertia import InertialParameters
from armload.online import OnlineEstimate
from armload.recording import Sample

LINK, JOINT, BASE = (221, 224, 229), (112, 121, 135), (70, 76, 86)
HELD, VAGUE, TRUTH, REGION = (230, 159, 0), (150, 150, 150), (0, 128, 96), (190, 20, 20)
ARM_MIDDLE = np.array([0.15, 0.0, 0.32])  # [length of all links] of what is looked at if that is the whole arm
_THINNEST, _WIDEST = 0.004, 0.6  # [m] of a side of the payload as it is drawn
_SMALLEST, _LARGEST = 0.005, 0.25  # [m] of a semi-axis of the centre of mass: smaller ones as a dot, larger ones not


class DrawnArm:
    """Handles of an arm on its floor; `stand` moves its joints, `shift` arm and floor.

    Args:
        scene: viser's scene.
        arm: that is drawn.

    Attributes:
        reach: length of all links [m].
    """

    def __init__(self, scene: Any, arm: Arm) -> None:
        self._arm = arm
        reach = self.reach = float(
            np.linalg.norm(np.diff(frame_poses(self._arm, np.zeros(arm.n))[1], axis=0), axis=1).sum()
        )
        scene.configure_default_lights(cast_shadow=False)  # a shadow costs more than all the rest without a GPU
        self._floor = scene.add_grid(
            "/floor",
            width=4.0 * reach,
            height=4.0 * reach,
            cell_size=0.1,
            section_size=0.5,
            cell_color=(228, 230, 233),
            section_color=(200, 203, 208),
            shadow_opacity=0.18,
        )
        self._whole = scene.add_frame("/arm", show_axes=False)
        self.frames = [scene.add_frame(f"/arm/{k}", show_axes=False) for k in range(arm.n + 1)]
        self.frames.append(
            scene.add_frame("/arm/flange", axes_length=0.03 * reach, axes_radius=0.003 * reach, origin_radius=0.0)
        )
        for number, part in enumerate(arm_parts(self._arm)):
            scene.add_mesh_simple(
                f"/arm/{part.frame}/{part.kind}{number}",
                part.mesh.vertices,
                part.mesh.faces,
                color=LINK if part.kind == "link" else JOINT if part.frame else BASE,
            )

    def stand(self, q: NDArray[np.float64]) -> None:
        """Put the arm where its joints (n,) [rad] are; what is no pose leaves it where it was."""
        if q.shape == (self._arm.n,) and np.all(np.isfinite(q)):
            R, p = frame_poses(self._arm, q)
            for frame, turn, place in zip(self.frames, _wxyz(R), p, strict=True):
                frame.wxyz, frame.position = turn, place

    def shift(self, point: NDArray[np.float64]) -> None:
        """Bring a point (3,) [m] of the arm's base frame to the middle of the picture."""
        self._whole.position = self._floor.position = -point

    @property
    def flange(self) -> NDArray[np.float64]:
        """Where the payload frame is (3,) [m], in the base."""
        return np.asarray(self.frames[-1].position, dtype=float)


class Scene:
    """Handles of everything drawn; `show` moves them.

    Args:
        scene: viser's scene.
        arm: whose joints are streamed.

    Attributes:
        reach: length of all links [m]. close: whether the flange stays in the middle, or the base where it is.
    """

    def __init__(self, scene: Any, arm: Arm) -> None:
        self._arm = DrawnArm(scene, arm)
        self.reach, self.close = self._arm.reach, True
        self._payload = scene.add_box("/arm/flange/payload", HELD, (0.1, 0.1, 0.1), opacity=0.6, visible=False)
        small = ellipsoid(np.full(3, 1e-3))
        self._region = scene.add_mesh_simple(
            "/arm/flange/region", small.vertices, small.faces, color=REGION, visible=False
        )
        self._truth = scene.add_line_segments(
            "/arm/flange/truth", edges((0.1, 0.1, 0.1)), TRUTH, thickness=2.5, thickness_units="screen", visible=False
        )
        self._outlined: NDArray | None = None

    def show(self, sample: Sample, estimate: OnlineEstimate | None, truth: InertialParameters | None) -> None:
        """Where the arm is, and what it holds; None: the last answer says nothing of the present."""
        self._arm.stand(np.asarray(sample.q, dtype=float))  # a pose that was left out: the arm stays where it was
        self._arm.shift(self._arm.flange if self.close else ARM_MIDDLE * self.reach)
        self._show_payload(estimate)
        self._show_truth(truth)

    def _show_payload(self, estimate: OnlineEstimate | None) -> None:
        there = estimate is not None and has_com(estimate)
        self._payload.visible = there
        drawn = False
        if estimate is not None and there:
            box = equivalent_box(estimate.parameters)
            _place(self._payload, box)
            self._payload.dimensions = tuple(np.clip(box.lengths, _THINNEST, _WIDEST).tolist())
            known = bool(estimate.determined.all())
            self._payload.color, self._payload.opacity = (HELD, 0.6) if known else (VAGUE, 0.35)
            region = com_region(estimate.phi, estimate.covariance)
            if drawn := float(region.lengths.max()) < _LARGEST:
                _place(self._region, region)
                self._region.vertices = ellipsoid(np.maximum(region.lengths, _SMALLEST)).vertices.astype(np.float32)
        self._region.visible = drawn

    def _show_truth(self, truth: InertialParameters | None) -> None:
        self._truth.visible = truth is not None and truth.mass > 0
        if (
            truth is None
            or truth.mass <= 0
            or (self._outlined is not None and np.array_equal(truth.phi, self._outlined))
        ):
            return
        box = equivalent_box(truth)
        _place(self._truth, box)
        self._truth.points = edges(np.maximum(box.lengths, _THINNEST)).astype(np.float32)
        self._outlined = truth.phi


def _place(handle: Any, box: Box) -> None:
    handle.wxyz, handle.position = _wxyz(box.axes[None])[0], box.centre


def _wxyz(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternions (N, 4), scalar first, of rotations (N, 3, 3)."""
    from viser.transforms import SO3

    return np.asarray(SO3.from_matrix(R).wxyz, dtype=np.float64)
