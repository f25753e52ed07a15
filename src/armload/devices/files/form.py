"""The load as a link of a robot description: URDF, MJCF and SDF.

In all three the inertia is about the centre of mass and in the axes of the frame the load is about:

| form | element | pose of the inertia | off-diagonal entries |
|---|---|---|---|
| URDF | `<link><inertial>` and a fixed joint to the frame | `origin xyz`, `rpy="0 0 0"` | ixy ixz iyz |
| MJCF | `<body><inertial>` | `pos` | `fullinertia`: xx yy zz xy xz yz |
| SDF | `<model><link><inertial>` | `pose` | ixy ixz iyz |
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

from armload.devices.load import Load, numbers_of
from armload.errors import SinkError

_SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def urdf_text(load: Load, name: str = "payload") -> str:
    """A link and a fixed joint under a `<robot>`, to be copied into the arm's URDF or included with xacro.

    Raises:
        SinkError: the load does not name the frame the joint hangs on.
    """
    if load.frame is None:
        raise SinkError("the payload does not name its frame: a URDF needs the link it is fixed to; give --frame")
    mass, *rest = _numbers(load, "urdf")
    root = _document("robot", load, "copy both into the arm's URDF, or include this file with xacro", name=name)
    link = ET.SubElement(root, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=" ".join(rest[:3]), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=mass)
    ET.SubElement(inertial, "inertia", dict(zip(_SIX, rest[3:], strict=True)))
    joint = ET.SubElement(root, "joint", name=f"{name}_joint", type="fixed")
    ET.SubElement(joint, "origin", xyz="0 0 0", rpy="0 0 0")
    ET.SubElement(joint, "parent", link=load.frame)
    ET.SubElement(joint, "child", link=name)
    return _text(root)


def mjcf_text(load: Load, name: str = "payload") -> str:
    """A MuJoCo model with one body: attach it (`MjSpec.attach`), or copy the body into the flange's."""
    mass, *rest = _numbers(load, "mujoco")
    root = _document("mujoco", load, "copy the body into that of the flange, without a joint", model=name)
    body = ET.SubElement(ET.SubElement(root, "worldbody"), "body", name=name)
    ET.SubElement(body, "inertial", pos=" ".join(rest[:3]), mass=mass, fullinertia=" ".join(rest[3:]))
    return _text(root)


def sdf_text(load: Load, name: str = "payload") -> str:
    """An SDF model with one link: include it in a world or a robot's model and fix it to the flange."""
    mass, *rest = _numbers(load, "urdf")
    root = _document("sdf", load, "fix the link to the flange with a joint of type fixed", version="1.7")
    link = ET.SubElement(ET.SubElement(root, "model", name=name), "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "pose").text = " ".join([*rest[:3], "0 0 0"])
    ET.SubElement(inertial, "mass").text = mass
    inertia = ET.SubElement(inertial, "inertia")
    for key, value in zip(_SIX, rest[3:], strict=True):
        ET.SubElement(inertia, key).text = value
    return _text(root)


def _numbers(load: Load, order: str) -> list[str]:
    return [repr(x) for x in numbers_of(load.parameters, order)]


def _document(tag: str, load: Load, use: str, **attributes: str) -> ET.Element:
    root = ET.Element(tag, attributes)
    for line in (*load.description(), use):
        root.append(ET.Comment(f" {line} "))
    return root


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
