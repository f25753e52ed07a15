"""Train a small bag of trees, use it on a run it may answer for, and see it refuse one it may not.

python examples/learn_and_refuse.py [FOLDER]
"""

import sys
from pathlib import Path

from armload import ArmloadError, arm
from armload.ensembles import BaggingEnsemble, save_model
from armload.identification import identify
from armload.lab.dataset import build_dataset, split_payloads
from armload.lab.evaluation import held_out_error
from armload.motion import random_motion, taie2024
from armload.payloads import container_loadings
from armload.simulation import Sensors, World, simulate

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/learn")
panda, motion = arm("panda"), taie2024()
world, sensors = World.real_like(panda, seed=1), Sensors.panda(panda)

loadings = container_loadings()[::4]
dataset = build_dataset(
    folder / "dataset", panda, [motion], loadings, worlds=[world], sensors=sensors, rows_per_run=200, progress=False
)
split = split_payloads(dataset, seed=1)
ensemble = BaggingEnsemble("tree", members=5, seed=1).fit(dataset.X[split.train], dataset.y[split.train])
path = folder / "trees.safetensors"
error = held_out_error(ensemble, dataset, split.test)  # what its error bars rest on
about = {"dataset_hash": dataset.hash, "payloads": dataset.payload[split.train]}  # what it learned from
save_model(path, ensemble, arm=panda, motion=motion, error_std=error, **about)

# a loading that was held out, on the motion of the training
unseen = loadings[dataset.payload[split.test[0]]]
log = simulate(panda, motion, unseen, world=world, sensors=sensors, rate=200.0, seed=7)
print(f"truth:  {unseen.parameters.mass:.3f} kg")
print(f"trees:  {identify(log, panda, method=path).mass:.3f} kg")
print(f"hybrid: {identify(log, panda).mass:.3f} kg")

# the same payload on another motion: the trees do not know it and say so
other = simulate(panda, random_motion(panda, seed=2), unseen, world=world, sensors=sensors, rate=200.0, seed=8)
try:
    identify(other, panda, method=path)
except ArmloadError as refusal:
    print(f"trees:  {refusal}")
print(f"hybrid: {identify(other, panda).mass:.3f} kg")
