"""Populations of episodes by name: what is drawn, and from what.

| population       | arm                | payload     | motion               | tare                       |
|------------------|--------------------|-------------|----------------------|----------------------------|
| `reference`      | `World.real_like`  | boxes       | reference            | bare, 20 s, another motion |
| `beyond`         | `World.beyond`     | boxes       | reference            | as reference               |
| `container`      | `World.real_like`  | container   | reference            | as reference               |
| `shapes`         | `World.real_like`  | shapes      | reference            | as reference               |
| `odd`            | `World.real_like`  | odd         | reference            | as reference               |
| `everyday`       | `World.real_like`  | boxes       | stops, slow, partial | as reference               |
| `same-motion`    | `World.real_like`  | boxes       | reference            | bare, 6 s, the same motion |
| `untared`        | `World.real_like`  | boxes       | reference            | none                       |
| `same-place`     | `World.real_like`  | boxes       | reference            | bare, 20 s, the same place |
| `elsewhere`      | `World.real_like`  | boxes       | reference            | bare, 20 s, another place  |
| `tool`           | `World.real_like`  | boxes       | reference            | as reference, tool mounted |
| `broad`          | half and half      | all but odd | every kind           | any, or none; tool or not  |

`reference` is the population that methods are compared on; the others change one thing each; `broad` is for training;
`odd` holds payloads unlike any that training sees.
A tare's motion is another one near the run's mean pose, as of an arm that works in one place; `same-place` has it about
that very pose, `elsewhere` about a pose of its own, where an arm's residual, of a length scale of about 1 rad, is
hardly the same. In `broad`, payloads are also lighter, and sensors, log rates and the controller's stiffness vary.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from armload.errors import ArmError
from armload.lab.episodes.motion_kinds import KINDS
from armload.payloads import FAMILIES

WORLDS = ("real_like", "beyond")
LIGHTEST = 0.25  # of the rated payload, where payloads are scaled down
TOOL_SHARE = 0.6  # of the rated payload, which a tool is drawn for


@dataclass(frozen=True)
class Recipe:
    """What to draw episodes from; one of a tuple of names is taken with equal chance, repeat one to favour it.

    worlds: of `WORLDS`; payloads: of `payloads.FAMILIES`; motions, tares: of `episodes.motions.KINDS`.
    duration: of the run [s]; tare_duration: from, to [s]; the shorter the likelier.
    untared: share of the episodes with no tare; same_motion: of those with one, share on the run's own motion;
        elsewhere: share of the tares about any mean pose; the others are about the run's.
    near: how near, standard deviation of each joint's mean pose [rad].
    tool: share of the episodes with a tool on the arm, in the run and in the tare.
    elapsed: from the start of the tare to the start of the run, from, to [s].
    rates: of the logs [Hz].
    stiffness: factor on the controller's, from, to.
    vary_sensors: whether noise, lag, jitter and losses vary.
    lighter: share of the episodes whose payload is scaled down, to a quarter of what the arm is rated for at least.

    Raises:
        ArmError: a name that is not known, or nothing to choose from.
    """

    worlds: tuple[str, ...] = ("real_like",)
    payloads: tuple[str, ...] = ("boxes",)
    motions: tuple[str, ...] = ("reference",)
    tares: tuple[str, ...] = ("long",)
    duration: float = 6.0
    tare_duration: tuple[float, float] = (20.0, 20.0)
    untared: float = 0.0
    same_motion: float = 0.0
    elsewhere: float = 0.0
    near: float = 0.3
    tool: float = 0.0
    elapsed: tuple[float, float] = (60.0, 60.0)
    rates: tuple[float, ...] = (200.0,)
    stiffness: tuple[float, float] = (1.0, 1.0)
    vary_sensors: bool = False
    lighter: float = 0.0

    def __post_init__(self) -> None:
        known = {"worlds": WORLDS, "payloads": FAMILIES, "motions": KINDS, "tares": KINDS}
        for name, allowed in known.items():
            stray = set(getattr(self, name)) - set(allowed)
            if stray or not getattr(self, name):
                raise ArmError(f"{name} of the recipe are {getattr(self, name)}: expected some of {', '.join(allowed)}")


REFERENCE = Recipe()
POPULATIONS: dict[str, Recipe] = {
    "reference": REFERENCE,
    "beyond": replace(REFERENCE, worlds=("beyond",), elapsed=(30.0, 600.0)),
    "container": replace(REFERENCE, payloads=("container",)),
    "shapes": replace(REFERENCE, payloads=("shapes",)),
    "odd": replace(REFERENCE, payloads=("odd",)),
    "everyday": replace(REFERENCE, motions=("point-to-point", "pick-and-place", "slow", "partial")),
    "same-motion": replace(REFERENCE, same_motion=1.0),
    "untared": replace(REFERENCE, untared=1.0),
    "same-place": replace(REFERENCE, near=0.0),
    "elsewhere": replace(REFERENCE, elsewhere=1.0),
    "tool": replace(REFERENCE, tool=1.0),
    "broad": Recipe(
        worlds=WORLDS,
        payloads=(*2 * ("boxes",), *3 * ("shapes",), "tools", *2 * ("container",), "nothing", "light"),
        motions=("reference", "reference", *KINDS),
        tares=("long", "long", *KINDS),
        tare_duration=(2.0, 30.0),
        untared=0.3,
        same_motion=0.15,
        elsewhere=0.3,
        tool=0.2,
        elapsed=(30.0, 600.0),
        rates=(100.0, 200.0, 200.0, 500.0, 1000.0),
        stiffness=(0.5, 2.0),
        vary_sensors=True,
        lighter=0.5,
    ),
}
