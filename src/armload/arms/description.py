"""Reading a robot description: a URDF becomes a plain chain of moving joints that both engines read alike."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from math import hypot, isfinite

from armload.errors import ArmError

_MOVING = ("revolute", "continuous", "prismatic")
_BOUNDED = ("revolute", "prismatic")  # moving joints whose limits hold
_TYPES = (*_MOVING, "fixed", "floating", "planar")
_ENDLESS = "1e4"  # [rad] limit given to a continuous joint, so that both engines treat it as one angle
HELD = "held"  # marks a joint that could move, but does not move the payload frame, and is fixed at zero
_NUMBERS = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "limit": ("lower", "upper", "effort", "velocity"),
}
# [m] from the first joint of an arm to its frame along the links, at most: almost three times the space station's arm
# of 17.6 m, and a quarter of what an arm of 20 cm is in millimetres
# (test_a_description_in_millimetres_is_refused_by_its_lengths)
_LONGEST = 50.0
_VECTORS = ("xyz", "rpy")  # of three numbers; every other attribute is one


@dataclass(frozen=True)
class Chain:
    """A URDF without meshes whose only moving joints lead from the root to the payload frame.

    rigid: the links that move with the payload frame, all joints between fixed.
    held: the joints that could move beside it, and how many of the chain's joints move what carries each of them.
    """

    name: str
    xml: str
    frame: str
    joint_names: tuple[str, ...]
    frames: tuple[str, ...]
    rigid: tuple[str, ...]
    held: tuple[tuple[str, int], ...]


@lru_cache(maxsize=16)  # an arm with another payload or gravity asks for the same
def read_chain(xml: str, frame: str | None, where: str) -> Chain:
    """The serial chain of a URDF that carries `frame`; every joint off the chain (fingers, say) is fixed at zero.

    Such a joint is marked `HELD`: what it carries does not move with the payload frame.

    Args:
        xml: the text of a URDF file.
        frame: the link whose frame the payload is about. None: the last link, that is the leaf behind the most moving
            joints, then the deepest, then the last in the file.
        where: how to name the description in an error.

    Raises:
        ArmError: not a URDF, no tree of links, no moving joint, an unknown frame, none named where several ends lie
            behind as many moving joints, a joint of the chain that mimics another, or numbers that no body or joint can
            have, lengths among them.
    """
    try:
        root = ET.fromstring(xml)
    except ET.ParseError as error:
        raise ArmError(f"{where} is not a URDF (XML error: {error})") from None
    if root.tag != "robot":
        raise ArmError(f"{where} is not a URDF: its root element is <{root.tag}>, expected <robot>")
    _check_expanded(root, where)
    _strip(root)
    _check_numbers(root, where)
    links = [str(link.get("name")) for link in root.findall("link")]
    joints, parents = _tree(root, links, where)

    def path(link: str) -> list[ET.Element]:
        chain: list[ET.Element] = []
        while link in joints and len(chain) <= len(links):
            chain.append(joints[link])
            link = parents[link]
        return chain[::-1]

    if frame is None:
        leaves = [link for link in links if link not in parents.values()]
        if not leaves:
            raise ArmError(f"the joints of {where} run in a circle: expected a tree from the base to the tool")

        moved = {link: [j for j in path(link) if j.get("type") in _MOVING] for link in leaves}
        most = max(map(len, moved.values()))
        behind = {chain[-1]: leaf for leaf, chain in moved.items() if chain and len(chain) == most}  # by the last joint
        if len(behind) > 1:
            first, second = list(behind.values())[:2]
            raise ArmError(
                f"{where} has {len(behind)} ends behind as many moving joints ({most}), {first!r} and {second!r} among "
                "them: name the link that carries the payload with --frame, such as an arm's flange"
            )
        frame = max(leaves, key=lambda link: (len(moved[link]), len(path(link)), links.index(link)))
    elif frame not in links:
        near = get_close_matches(frame, links, 1, cutoff=0.7)  # the links of an arm are called alike
        raise ArmError(
            f"unknown frame {frame!r} in {where}: expected one of {', '.join(links)}"
            + (f"; did you mean {near[0]!r}?" if near else "")
        )

    chain = path(frame)
    moving = [j for j in chain if j.get("type") in _MOVING]
    if not moving:
        raise ArmError(f"no joint of {where} moves the frame {frame!r}: choose a frame behind the arm's joints")
    _check_moving(moving, frame, where)
    _check_lengths(chain[chain.index(moving[0]) + 1 :], frame, where)
    for joint in joints.values():
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
        if joint not in moving:
            if joint.get("type") in _MOVING:
                joint.set(HELD, "true")
            joint.set("type", "fixed")
        elif joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ET.SubElement(joint, "limit", effort="0", velocity="0")
            limit.set("lower", "-" + _ENDLESS)
            limit.set("upper", _ENDLESS)

    def base(link: str) -> str | None:
        """What a link is rigidly part of: the last moving or held joint before it."""
        while link in joints and joints[link] not in moving and HELD not in joints[link].attrib:
            link = parents[link]
        return joints[link].get("name") if link in joints else None

    def carried(link: str) -> int:
        return sum(joint in moving for joint in path(link))

    return Chain(
        name=root.get("name") or "robot",
        xml=ET.tostring(root, encoding="unicode"),
        frame=frame,
        joint_names=tuple(str(j.get("name")) for j in moving),
        frames=tuple(links),
        rigid=tuple(link for link in links if base(link) == moving[-1].get("name")),
        held=tuple((str(j.get("name")), carried(parents[k])) for k, j in joints.items() if HELD in j.attrib),
    )


def _tree(root: ET.Element, links: list[str], where: str) -> tuple[dict[str, ET.Element], dict[str, str]]:
    """The joint that carries each link, and the link that carries it, by the links carried."""
    joints: dict[str, ET.Element] = {}
    parents: dict[str, str] = {}
    for joint in root.findall("joint"):
        if joint.get("type") not in _TYPES:
            raise ArmError(
                f"joint {joint.get('name')!r} of {where} has the type {joint.get('type')!r}: expected one of "
                f"{', '.join(_TYPES)}"
            )
        ends = []
        for end in ("parent", "child"):
            element = joint.find(end)
            link = None if element is None else element.get("link")
            if link not in links:
                raise ArmError(f"joint {joint.get('name')!r} of {where} has no <{end}> among the links of the file")
            ends.append(link)
        parent, child = ends
        if child in joints:
            raise ArmError(
                f"the link {child!r} of {where} is carried by two joints, {joints[child].get('name')!r} and "
                f"{joint.get('name')!r}: expected a tree from the base to the tool, without closed loops"
            )
        parents[child], joints[child] = parent, joint
    if not joints:
        raise ArmError(f"{where} has no joints: expected a URDF of a robot arm")
    return joints, parents


def _check_expanded(root: ET.Element, where: str) -> None:
    """Refuse a xacro file: what its macros would add is missing from it."""
    for element in root.iter():
        space, _, tag = element.tag.rpartition("}")
        if "xacro" in space:
            raise ArmError(
                f"{where} holds <xacro:{tag}>: expected a plain URDF; expand it first, with `xacro FILE > arm.urdf`"
            )


def _strip(root: ET.Element) -> None:
    """Remove what dynamics does not need: meshes, materials, transmissions, simulator settings and damping."""
    for child in list(root):
        if child.tag not in ("link", "joint"):
            root.remove(child)
            continue
        for part in list(child):
            if part.tag in ("visual", "collision", "safety_controller", "calibration", "dynamics"):
                child.remove(part)


def _check_numbers(root: ET.Element, where: str) -> None:
    """Refuse what is no number or too few, a negative mass and an axis without direction.

    Pinocchio's reader takes some of it, and leaves out the body that holds it.
    """
    for part in root:
        for element in part.iter():
            for key in _NUMBERS.get(element.tag, ()):
                if element.get(key) is None:
                    continue
                numbers = _numbers(element.get(key) or "")
                if numbers is None:
                    expected = "finite numbers"
                elif len(numbers) != (3 if key in _VECTORS else 1):
                    expected = "three numbers" if key in _VECTORS else "a number"
                elif element.tag == "mass" and numbers[0] < 0:
                    expected = "a mass of at least 0"
                elif element.tag == "axis" and part.get("type") in _MOVING and not any(numbers):
                    expected = "a direction"
                else:
                    continue
                raise ArmError(
                    f"{where}: <{element.tag}> of {part.tag} {part.get('name')!r} has {key} = {element.get(key)!r}, "
                    f"expected {expected}"
                )


def _check_moving(moving: list[ET.Element], frame: str, where: str) -> None:
    """Refuse a joint of the chain that another one drives, and limits that no joint can have."""
    for joint in moving:
        mimic, limit = joint.find("mimic"), joint.find("limit")
        if mimic is not None:
            raise ArmError(
                f"joint {joint.get('name')!r} of {where}, which moves the frame {frame!r}, mimics "
                f"{mimic.get('joint')!r}: expected joints with drives of their own; choose a frame before it"
            )
        if limit is None:
            continue
        lower, upper, effort, velocity = (float(limit.get(key) or 0) for key in _NUMBERS["limit"])
        if min(effort, velocity) < 0 or (joint.get("type") in _BOUNDED and lower > upper):
            raise ArmError(
                f"{where}: <limit> of joint {joint.get('name')!r} has lower = {lower:g}, upper = {upper:g}, effort = "
                f"{effort:g} and velocity = {velocity:g}, expected lower below upper and no negative limit"
            )


def _check_lengths(joints: list[ET.Element], frame: str, where: str) -> None:
    """Refuse lengths that no arm has; joints: those of the chain behind the first that moves."""
    origins = [origin.get("xyz") or "" for joint in joints for origin in joint.findall("origin")]
    length = sum(hypot(*(_numbers(xyz) or [])) for xyz in origins)
    if length > _LONGEST:
        raise ArmError(
            f"the links of {where} are {length:.0f} m long together, from the first joint to {frame!r}: expected "
            f"{_LONGEST:g} m at most, as a URDF is in metres; are these mm?"
        )


def _numbers(text: str) -> list[float] | None:
    """The numbers of an attribute; None if a word of it is no finite number."""
    try:
        numbers = [float(word) for word in text.replace("_", "?").split()]  # Python alone reads 1_000
    except ValueError:
        return None
    return numbers if all(map(isfinite, numbers)) else None
