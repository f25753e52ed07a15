"""Identify the payload of a log, and swap the method by changing one line.

python examples/identify_a_log.py [LOG.csv]        (a Panda's log; without one, a run is simulated)
"""

import sys

from armload import FilteredRecursiveLeastSquares, HybridIdentifier, arm, read_recording
from armload.identification import identify
from armload.motion import taie2024
from armload.payloads import test_payload
from armload.simulation import simulate

panda = arm("panda")
if len(sys.argv) > 1:
    log = read_recording(sys.argv[1], panda)
else:
    log = simulate(panda, taie2024(), test_payload(), rate=200.0)

# one answer for a whole log, with 95 % intervals and what the motion could not tell
print(identify(log, panda))

# the same on a stream: a sample in, an estimate out
for identifier in (HybridIdentifier(panda), FilteredRecursiveLeastSquares(panda)):
    identifier.reset()
    for sample in log.between(log.t[0], log.t[0] + 2.0):
        estimate = identifier.update(sample)
    print(f"{identifier.name}: {estimate.parameters.mass:.3f} kg after {estimate.t - log.t[0]:.2f} s")
