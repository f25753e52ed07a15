"""A payload from a CAD mesh: the role that CAD software has in the paper (Section IV)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from armload.errors import PayloadError
from armload.inertia import InertialParameters
from armload.payloads.payload import Payload
from armload.payloads.solids import mass_of, placed, positive

_LONGEST = 5.0  # [m] a part longer than this was drawn in millimetres or inches
_MESHES = (".stl", ".obj", ".ply", ".off", ".3mf", ".glb", ".gltf", ".dae")
_SOLIDS = (".step", ".stp", ".iges", ".igs", ".sldprt", ".ipt", ".f3d", ".fcstd", ".dxf")  # no triangles


def from_mesh(
    path: str | Path,
    *,
    density: float | None = None,
    mass: float | None = None,
    scale: float = 1.0,
    rotation: ArrayLike | None = None,
    translation: ArrayLike | None = None,
    name: str | None = None,
) -> Payload:
    """A homogeneous payload whose surface is a closed triangle mesh (STL, OBJ, PLY, ...).

    Volume, centre and second moments are exact surface integrals over the triangles (divergence theorem).

    Args:
        path: the mesh file.
        density: [kg/m³]; give either density or mass.
        mass: [kg].
        scale: metres per unit of the file; 0.001 for a mesh in millimetres.
        rotation: R_ab (3, 3), the axes of the mesh file in the payload frame. Default: aligned.
        translation: p_ab (3,), the origin of the mesh file in the payload frame [m], not scaled. Default: the origin.
        name: what to call it. Default: the file's name.

    Raises:
        PayloadError: unreadable or open mesh, implausible size, both or neither of density and mass.
        InertiaError: rotation or translation is not one.
    """
    path = Path(path)
    scale = positive(scale, "scale of the mesh")
    mass_of(f"mesh {path}", 1.0, mass, density)  # ask for the right arguments before a long file is read
    mesh = _closed_mesh(path)
    longest = float(mesh.extents.max()) * scale
    if longest > _LONGEST:
        raise PayloadError(
            f"mesh {path} is {longest:.3g} m long: expected at most {_LONGEST:g} m; give scale=0.001 if it is drawn in "
            "millimetres"
        )
    volume = float(mesh.volume) * scale**3
    m = mass_of(f"mesh {path}", volume, mass, density)
    mesh.density = 1.0
    unit = np.asarray(mesh.moment_inertia) * scale**5 / volume  # inertia about the CoM per kilogram [m²]
    about_mesh = InertialParameters.from_com(m, np.asarray(mesh.center_mass) * scale, m * 0.5 * (unit + unit.T))
    return Payload(name or path.stem, placed(about_mesh, rotation, translation))


def require_no_drawing(path: Path) -> None:
    """Say how a drawing becomes a payload file, where one was given in its place.

    Raises:
        PayloadError: by its suffix it is one.
    """
    ending = path.suffix.lower()
    if ending in (*_MESHES, *_SOLIDS):
        mesh = path.name if ending in _MESHES else f"{path.stem}.stl"
        first = "" if ending in _MESHES else f"save it as a mesh ({mesh}), and "
        raise PayloadError(
            f"{path} is a drawing: expected a payload file that names its mesh; {first}write beside it a file such as "
            f'{path.stem}.json: {{"mesh": "{mesh}", "scale": 0.001, "mass": 0.4, "frame": "tool0"}}, its mass in kg, '
            "scale in metres per unit of the mesh"
        )


def _closed_mesh(path: Path):
    """The mesh in a file as one `trimesh.Trimesh` with positive volume."""
    import trimesh

    if not path.is_file():
        raise PayloadError(f"mesh file {path} does not exist: expected a triangle mesh such as STL, OBJ or PLY")
    try:
        mesh = trimesh.load_mesh(str(path))
        if isinstance(mesh, trimesh.Scene):
            mesh = mesh.to_mesh()
    except Exception as error:  # the readers of a dozen formats raise whatever they like
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise PayloadError(
            f"mesh file {path} cannot be read ({reason}): expected a triangle mesh such as STL, OBJ or PLY"
        ) from None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise PayloadError(f"mesh file {path} holds no triangles: expected the closed surface of a solid")
    if not np.all(np.isfinite(mesh.vertices)):
        raise PayloadError(f"mesh file {path} has a vertex that is not finite: expected finite coordinates")
    if not mesh.is_watertight:
        raise PayloadError(
            f"mesh file {path} is not watertight: its volume is undefined; close its holes (most CAD programs export "
            "a solid, not a surface, on request)"
        )
    if not mesh.is_winding_consistent:
        raise PayloadError(
            f"mesh file {path} has triangles that face different ways: its volume is undefined; make its normals "
            "consistent and export it again"
        )
    if mesh.volume < 0:  # all triangles face inwards: the same solid, turned inside out
        mesh.invert()
    if not mesh.volume > 0:
        raise PayloadError(f"mesh file {path} encloses no volume: expected the closed surface of a solid")
    return mesh
