"""Kinova's form for a Gen3: the tool that the Kortex API is told of.

The tool is everything on the interface module. Its mass centre is in that module's frame (`end_effector_link`), in
metres; there is no inertia. A payload of its own (`PayloadInformation`) is counted from the tool's frame instead, which
is not known here. Source: Kinova, Kortex API: ControlConfig, ToolConfiguration and PayloadInformation.
"""

from __future__ import annotations

from armload.devices.load import Load, counted_numbers


def tool_configuration_text(load: Load) -> str:
    """Python for `control_config`, a `ControlConfigClient` of the Kortex API; the tool's transform stays as it is."""
    mass, x, y, z = counted_numbers(load.parameters, "ur")[:4]
    return "\n".join(
        [
            *(f"# {line}" for line in load.description()),
            "tool = control_config.GetToolConfiguration()",
            f"tool.tool_mass = {mass!r}  # [kg] everything on the interface module",
            f"tool.tool_mass_center.x = {x!r}  # [m] from the interface module",
            f"tool.tool_mass_center.y = {y!r}",
            f"tool.tool_mass_center.z = {z!r}",
            "control_config.SetToolConfiguration(tool)  # at rest only",
            "",
        ]
    )
