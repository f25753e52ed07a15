"""How often the shipped intervals hold on episodes that no training, calibration or cross-validation has touched.

The cross-validation that `armload train` prints sets each quarter's widths on the other three, so that its shares lie
near 95 % whatever the luck of the draw. Here the finished model answers new episodes of `broad`, of another seed.

    python benchmarks/fresh_intervals.py [--robot panda] [--episodes 2000] [--jobs 2] [--work out/fresh-panda]

writes benchmarks/results/fresh_intervals_ROBOT.json. About a second of one core for each episode; goes on from --work.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from armload import arm
from armload.atomic import replacing
from armload.cli.printing import console
from armload.cli.train_hybrid import cells_table, episodes_shown, summary, versions
from armload.hybrid import shipped_model
from armload.hybrid.training import coverage_on, episode_records

SEED = 1  # trainings have seed 0
RESULTS = Path(__file__).parent / "results"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="panda")
    parser.add_argument("--episodes", type=int, default=2000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--work", type=Path)
    options = parser.parse_args()
    robot = arm(options.robot)
    model = shipped_model(robot)
    work = options.work or Path(f"out/fresh-{robot.name}")
    with episodes_shown() as progress:
        records = episode_records(
            robot, episodes=options.episodes, seed=SEED, folder=work, jobs=options.jobs, progress=progress
        )
    found = coverage_on(records, model.prior_for(robot), model.calibration)
    console().print(cells_table(found))
    print(f"pooled: {100 * found.pooled:.1f} %")
    result = {
        "command": " ".join(["python benchmarks/fresh_intervals.py", *sys.argv[1:]]),
        "population": "broad",
        "seed": SEED,
        "trained": {key: model.provenance[key] for key in ("population", "episodes", "seed")},
        **summary(robot, found),
        "versions": versions(),
    }
    path = RESULTS / f"fresh_intervals_{robot.name}.json"
    with replacing(path) as part:
        part.write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
