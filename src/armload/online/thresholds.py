"""The numbers that decide what is said of a stream, each with its unit, its reason and where the evidence is.

Those that decide about changes of payload were set on seeds of `benchmarks/events.py` below 10 000 and are measured on
others (`benchmarks/results/events.json`). What half and twice each one would do: docs/constants.md. The limits of
single samples stand in `gate.py`, whose compiled code holds them.
"""

from __future__ import annotations

import numpy as np

from armload.estimators.recursive import AT_REST
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH

# ---------------------------------------------------------------------- the detector, `changes.py`

# [rows] over which explanations are weighed, 0.08 and 0.24 s: a large change shows in the one, a light one in the other
WINDOWS = (16, 48)
# [rows] that are kept, and taken back from a run that ends: a change is there for so long before it is noticed
LONGEST = max(WINDOWS)
# [nat] of a payload's likelihood ratio over nothing, in either window: under noise as modelled it is reached with a
# probability below exp(−12), once in half a day of windows that do not overlap
ALARM = 12.0
# [nat] of a payload's ratio over a push's, in the window that alarms: odds of 400 to 1, as nearly all pushes look a
# little like a payload (test_a_push_that_ends_gives_the_estimate_back)
OVER_PUSH = 6.0
# [nat] the same in the short window: it has a third of the rows, and so about half of what the long one tells
OVER_PUSH_LATELY = 3.0
# [rows] in a row that alarm, 0.03 s: a push that begins looks like a payload for some rows; the median delay is 0.08 s
ALARM_ROWS = 6
# [nat] of either ratio in the short window: where nothing explains the rows best, they may be believed again
CALM = 0.0
# [payloads] sizes of a change, in half of what the arm is rated for, a factor of 2.6 apart: 0.3 to 2 kg of a Panda
BODY_SIZES = np.array([0.2, 0.53, 1.33])
# [effort limits] sizes of a push, a factor of 3 apart: 2 to 17 N·m of a Panda's large joints
PUSH_SIZES = np.array([0.02, 0.06, 0.2])
# [m] standard deviation of a body's centre of mass along each axis: √3 times that is the weak prior's reach, twice that
# of the simulated families (0.075 m rms)
BODY_COM = 0.085
# [m] a body's radius of gyration: the simulated families' median is 0.057 m
BODY_GYRATION = 0.06
# [of the expected noise] where the level begins: rows of a short run fit worse than they will
LEVEL = 2.0
# [of the expected noise] the least level: the posterior expects no more than it has reason to
LOWEST_LEVEL = 1.0
# share of a new window in the mean level: it follows within twenty windows, 5 s
LEVEL_SHARE = 0.05
# [levels] that one window counts at most: a light change must not raise the level and hide itself. A stated guard for
# streams of minutes, no scene or test depends on it
LEVEL_OUTLIER = 8.0

# ---------------------------------------------------------------------- the phases of a run, `watch.py`

# [s] of a run with a tare before which no change is looked for: the tare has told most of what the arm does wrong
FIRST_TARED = 0.5
# [s] the same without a tare: the arm's offsets and friction must have been seen before anything can be unlike them
FIRST_UNTARED = 2.0
# [s] left out after a change: four times the lag of the regression, 2 % of the old torque is left
TRANSIENT = 4.0 / GAIN
# [s] of a run not judged yet, below which it may have been a push: the run before it may come back. Pushes last up to
# 3 s (`benchmarks/events.py`)
PASSING = 3.0
# [s] of a new run from which its kind is told: before, the prior alone says whether something is held
KIND_FROM = 0.25
# [s] of a new run after which its kind is told, however little is known of the mass
KIND_LATEST = 1.5
# [s] of a new run within which it may be recognised as an earlier one: twice the longest push
# (test_what_is_put_down_is_gone_and_what_is_taken_up_again_is_recognised)
RETURN_UNTIL = 6.0
# [payloads] standard deviation of the mass with which a kind is told: 50 g of a Panda, a light payload held or not
KIND_STD = 0.033
# [payloads] the same to tell one payload from an earlier one: 15 g of a Panda
RETURN_STD = 0.01
# [s] of rows that do not fit, within which a change of payload shows: two and a half long windows
DECIDED = 4.0
# [s] of such rows shortly after a change, after which it may be over, as a push is: one lag of the regression
# (test_a_push_that_ends_gives_the_estimate_back)
BACK_AFTER = 1.0 / GAIN
# [nat] of what was held before over what is held now: as sure as a payload has to be over a push
# (test_a_push_that_ends_gives_the_estimate_back)
BACK = 6.0
# [s] of a run that knows its arm as if it had a tare: what does not fit is then not the arm for longer.
# A stated guard: the scenes are shorter
LEARNT = 10.0
# [s] that such a run leaves out at most (any other: `DECIDED`), longer than a push. Then what does not fit is believed
# (test_a_pose_first_seen_shortly_after_a_change_is_not_another_change)
PATIENCE = 10.0

# ---------------------------------------------------------------------- which run is which, `runs.py` and `step.py`

# [squared standard deviations] of mass and first moments: nine of ten runs of the same payload lie within
# (test_another_payload_of_another_mass_is_no_return)
SAME_RUN = 7.779440339734858  # the 90 % quantile of a chi-square distribution of four degrees of freedom
# [s] an empty run must have lasted to be a tare: with less it knows the arm no better than the prior
TARE_FROM = 3.0
# [payloads] standard deviation of the change of mass, below which the first guess is replaced: 150 g of a Panda
# (test_the_mass_of_a_change_is_what_the_runs_tell_once_its_kind_is_known)
STEP_STD = 0.1

# ---------------------------------------------------------------------- notes, `online_identifier.py`, `listening.py`

# [rad/s] of any joint: an arm that is slower stands (test_a_standing_arm_says_so_and_claims_no_inertia)
MOVING = AT_REST
# [s] within which the arm was seen to move: a motion that turns round stands for less
RECENT = 0.5
# [s] of rows that count for nothing: with the time that one pose counts, as long at rest as `RECENT`
STANDS = RECENT - SMOOTH.block
# [s] without a usable sample that are told: a pause of this length (`recording.GAP`) ends the filters' memory
# (test_an_answer_ages_and_says_why_while_no_sample_can_be_used)
SILENT = 0.1
# [samples] in a row that are told where their times are bad, too: 0.1 s at 500 Hz, 1 s at the lowest rate
# (test_a_stream_of_which_nothing_can_be_used_says_why)
BAD_IN_A_ROW = 50
# [pauses] in a row, no two samples between them that belong together: one or two are a robot's, five are a wrong unit
PAUSES_IN_A_ROW = 5

# ---------------------------------------------------------------------- what a profile learns, `learning.py`

# [s] of a run of the empty arm, at least, that a profile learns from: as long as a tare is asked for
LEARN_FROM = 20.0

# ---------------------------------------------------------------------- modes
CONTACT_LASTS = 1.0
CONTACT_VARIES = 0.5
HANDED_OVER = 0.5
LEVEL_BLOCK = 0.24
RARE = 100.0
SAME_ERROR = 0.1
STARTS = np.array([0.05, 0.1, 0.2, 0.4, 0.8, 1.6])
SURE = 0.99
UNSURE = 0.5
LIGHT = 0.05
LAG = 0.1
SETTLED = 0.9
LONGEST_HANDOVER = 10.0
STEADY = 0.9
DRIFT_SIZE = 0.005
DRIFT_VARIES = 5.0
LASTING = 0.3
AFTER_CONTACT = 0.3
LONG_ENOUGH = 1.0
HANDING_VARIES = np.array([5.0, 1.5, 0.5])
