"""Payloads: the paper's container and its 77 loadings, the Franka Hand, solids, meshes, random families, files.

A payload is about the origin and in the axes of the arm's payload frame.
"""

from armload.payloads.container import container, container_loadings, test_payload
from armload.payloads.families import FAMILIES, draw_payload, random_payload, random_payloads
from armload.payloads.hand import franka_hand, hand_on
from armload.payloads.mesh import from_mesh
from armload.payloads.payload import INERTIA_ASSUMED, Box, Payload
from armload.payloads.payload_file import NOTHING, read_payload, write_payload

__all__ = [
    "FAMILIES",
    "INERTIA_ASSUMED",
    "NOTHING",
    "Box",
    "Payload",
    "container",
    "container_loadings",
    "draw_payload",
    "franka_hand",
    "from_mesh",
    "hand_on",
    "random_payload",
    "random_payloads",
    "read_payload",
    "test_payload",
    "write_payload",
]
