"""UFACTORY's form for an xArm: the arguments of `set_tcp_load`.

The load is everything on the flange, tool and object. Its centre of gravity is in the default tool coordinate system,
at the centre of the flange (`link_eef`), in millimetres; there is no inertia. Sources: xArm-Python-SDK, `set_tcp_load`;
UFACTORY, user manual: TCP payload.
"""

from __future__ import annotations

from armload.devices.load import Load, counted_numbers


def set_tcp_load_text(load: Load) -> str:
    """Python for `arm`, an `XArmAPI`."""
    mass, *com = counted_numbers(load.parameters, "ur")[:4]
    millimetres = [round(1e3 * x, 9) + 0.0 for x in com]
    return "\n".join(
        [
            *(f"# {line}" for line in load.description()),
            f"arm.set_tcp_load({mass!r}, {millimetres!r})  # [kg], [mm] from the flange; at rest only",
            "",
        ]
    )
