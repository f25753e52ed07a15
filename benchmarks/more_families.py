"""Add the families of `lab/training/added_families.py`, and narrower inertias of light ones, to the shipped hybrids.

    python benchmarks/more_families.py [--robot NAME]

Nothing is simulated and nothing else of a model changes: kappa, the widths c and what the training found stay. A model
that has the families already is left alone. `armload train` does the same of itself.
"""

from __future__ import annotations

from dataclasses import replace

from script import options, say

from armload import arm
from armload.lab.training.added_families import LIGHT, WIDE, with_added
from armload.posterior.calibration import LIGHT_MASS
from armload.posterior.hybrid import shipped_model
from armload.posterior.model_file import SHIPPED, HybridModel


def main() -> None:
    asked = options(__doc__, robot="")
    for name in [asked.robot] if asked.robot else SHIPPED:
        robot = arm(name)
        model, path = shipped_model(robot), HybridModel.shipped(robot)
        if path is None or "wide" in model.prior.families:
            say(f"{name}: as it is")
            continue
        prior = with_added(model.prior_for(robot), robot)
        light = LIGHT_MASS * float(prior.std[0])
        about = model.provenance | {"added since": {"wide": WIDE, "light": LIGHT, "m_0 [kg]": round(light, 4)}}
        calibration = replace(model.calibration, light=light)
        replace(model, prior=prior, calibration=calibration, provenance=about).save(path)
        say(f"{name}: {len(prior.weights)} components, m_0 {light:.3f} kg")


if __name__ == "__main__":
    main()
