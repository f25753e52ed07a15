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

# ---------------------------------------------------------------------- the hypotheses, `modes.py`

# [s] correlation times of bodies of `BODY_SIZES` that are handed over: a heavy one is seen at once, whatever its pace.
# Without the slow one of 0.2, what is handed over within 1 to 2 s is told as two (seeds 95000 to 95003); if the
# lightest were as slow, a drift would be taken for it
HANDING_TIMES = np.array([1.5, 5.0, 1.5, 0.5])
# [effort limits] sizes of a contact, a factor of 3 apart: 2 to 17 N·m of a Panda's large joints
PUSH_SIZES = np.array([0.02, 0.06, 0.2])
# [s] correlation time of a contact's torque: of what a hand does, which changes within half a second
CONTACT_TIME = 0.5
# [payloads' weights] standard deviations of the force of a hand that pulls at the payload frame, along each axis: 4 and
# 15 N of a Panda
HAND_SIZES = np.array([0.25, 1.0])
# [s] correlation time of that force: a push that rises within a second is smoother than an Ornstein–Uhlenbeck process
# of one second. With 1 s and twice the sizes hardly a push is known for one (seeds 5008 to 5050 of the pushes)
HAND_TIME = 4.0
# [m] how far from the frame's origin a hand takes hold
HAND_LEVER = 0.1
# [s] mean time between such pulls: one in two working weeks. A payload's weight is a force, too: where a hand is
# expected as often as a change, those at once are sure 0.1 s later and some are missed (seeds 5000 to 5003); with one
# in a day 0.3 kg took half a second
# (test_a_cycle_in_step_with_the_motion_stays_as_good_in_its_second_half_as_in_its_first)
HAND_RARE = 288000.0
# [s] mean duration of a contact: pushes last 0.3 to 3 s (`benchmarks/events.py`)
CONTACT_LASTS = 1.0
# [effort limits] size of a drift: 0.9 N·m of a Panda's large joints, 0.1 N·m of its wrist, whose torque sensors may
# move by more than their size says (seeds 95000 to 95003 of the drift scene)
DRIFT_SIZE = 0.01
# [s] correlation time of a drift: longer than all that a payload or a hand does
DRIFT_TIME = 20.0
# [s] mean time between drifts, ten times what they last: an arm that has warmed up seldom drifts
DRIFT_RARE = 1000.0
# [s] mean time between changes, and between contacts: between a cell that works and an arm that stands for hours
RARE = 100.0
# [s] mean time between changes in the first seconds of a stream: it is begun as something is to be done, and nothing
# that was seen before speaks against it. With 100 s 81, 88, 95 and 92 % of the masses are inside 0.5, 1, 2 and 5 s
# after a change within the first 2 s, with 5 s 91, 95, 97 and 97 %; 2.5 s does no more (96 streams, seeds 95000 to
# 95015). Not where torque is measured at the motors: what starts from rest looks like a change there
# (test_an_empty_arm_that_starts_from_rest_is_no_change_of_payload)
EARLY_RARE = 5.0
# [s] that the first seconds of a stream are: the arm is known well enough then for a third of a kilogram to show
EARLY = 2.0
# [s] mean duration of a hand-over: steps take one lag of the regression, slow ones seconds
HANDED_OVER = 0.5
# share of hand-overs that end in what was held before, whatever seemed to be handed over: a hand that lets go. With
# none, the end of a push stays a hand-over for seconds (test_a_push_of_half_a_minute_leaves_the_run_as_it_was); with
# all, a light change is not sure (test_what_is_steadily_another_payload_s_torque_is_not_thought_to_have_gone_again)
LETS_GO = 0.03
# [s] how far apart the moments lie from which another body is weighed: a heavy one shows in a tenth of a second, one of
# 50 g in two seconds
STARTS = np.array([0.05, 0.1, 0.2, 0.4, 0.8, 1.6])
# [s] for which what a run foresees is wrong by about the same, when it is not told: a pose does not stay longer
SAME_ERROR = 0.1
# [of the expected noise] where the level begins: rows of a short run fit worse than they will
LEVEL = 2.0
# [blocks] that the level's beginning counts for: one block shows as much. If it were forgotten no faster than later on,
# 21 of 64 changes within the first 2 s of a stream would be missed instead of 13, with 4 blocks 16. With a level that
# begins at 1 they are 10, but then sound arms beyond their worlds are doubted in 19 % of the moments instead of 5, and
# with an old tare ten changes are seen that are none instead of three (seeds 95000 to 95063;
# `benchmarks/wrong_streams.py`)
LEVEL_BEGINS = 1.0
# [of the expected noise] the least level: the posterior expects no more than it has reason to
LOWEST_LEVEL = 1.0
# [s] of rows that say once how large the noise is: noise that is correlated for less shows in full
LEVEL_BLOCK = 0.24
# share of a new block in the mean level, later on: it follows within twenty blocks, 5 s
LEVEL_SHARE = 0.05
# [levels] that one block counts at most: a light change must not raise the level and hide itself. A stated guard for
# streams of minutes, no scene or test depends on it
LEVEL_OUTLIER = 8.0

# ---------------------------------------------------------------------- joints that stick at rest, `sticking.py`

# [Coulomb frictions] how far they may, a factor of two apart
STICKING_SHARES = np.array([0.25, 0.5, 1.0])
# probability beforehand that they do: friction is smooth of the two Pandas that were measured, of other arms nobody
# knows. If one arm in twenty is taken to stick, the first rows of one that does look like changes, and nothing is
# learned from them (test_joints_that_stick_are_no_change_of_payload_and_hide_none)
STICKS = 0.5
# [log likelihood] that an explanation is behind at most: joints may begin to stick
STICKS_BEHIND = 20.0

# --------------------------------------------------------------------- the phases of a run, `watch.py`; a change's name

# probability of a payload that changes or has changed, from which it is an event: one in a thousand may be none, and
# friction of gears is not what the hypotheses know (test_a_real_arm_that_breaks_away_from_rest_is_no_change_of_payload)
SURE = 0.999
# [s] for which it has to be so sure, or what would be held have no mass that can be: one lag of the regression, as
# gears that break away look like a payload for less
HOLDS = 1.0 / GAIN
# probability of what is taken for so: of a steady arm whose intervals are the calibrated ones, of a payload that stays
LIKELY = 0.9
# probability that is left out of a 95 % interval: of a change that is likelier, the interval is that of both payloads
UNLIKELY = 0.05
# [s] that another payload stays at least until its run begins: twice the lag of the regression
LAG = 2.0 / GAIN
# [s] that it stays at most until then, however slowly it may be changing: 50 g within two seconds would show
LONG_ENOUGH = 2.0
# [s] that another payload stays before it is believed when something has touched the arm: what a hand leaves behind
# it is over by then
AFTER_CONTACT = 0.3
# [payloads] below nothing that a mass may seem to be: a tool or a light thing, 75 g of a Panda, may have been held from
# the start and be part of the empty arm
LIGHT = 0.05
# [s] of rows that do not fit that are left out at most where nothing touches the arm, and of a hand-over. Then what
# does not fit is believed: it may be the arm (test_a_pose_first_seen_shortly_after_a_change_is_not_another_change)
PATIENCE = 10.0
# [s] of rows of a contact that are left out at most: nobody leads or leans on an arm for longer, while one that was
# knocked stays as it is, and what was taken off since the tare stays off
# (test_an_offset_that_jumps_and_stays_is_believed_at_last, test_a_push_of_half_a_minute_leaves_the_run_as_it_was)
CONTACT_LONGEST = 60.0
# [s] before a change that are taken back from the run that ends, at least as long as it took to notice it: what a
# payload does before it shows (test_a_cycle_in_step_with_the_motion_stays_as_good_in_its_second_half_as_in_its_first)
TAKEN_BACK = 0.2
# [s] of a run with a tare before which no change is looked for: the tare has told most of what the arm does wrong. Of
# an arm that stands it is the time since its first row, as one pose counts no longer than 0.25 s
# (test_a_change_is_noticed_though_the_arm_has_stood_since_the_first_sample)
FIRST_TARED = 0.2
# [s] the same without a tare: how much friction there is must have shown, the posterior knows how little it knows of
# offsets. With 0.5 s 87 of 96 intervals hold half a second after a change within the first 2 s, with this 89 (seeds
# 95000 to 95015); nothing is seen so early in real logs as they are (seeds 95000 to 95002)
FIRST_UNTARED = 0.3
# [s] the same of each run where the torque is measured at the motors, tare or not: what starts from rest rubs as no
# model says (seeds 50000 to 50003 of `benchmarks/events_of_arms.py`, 36 streams of xarm7, ur5e and ur10e: 8 false
# events with 0.2 s, 1 with this)
FIRST_MOTOR = 1.0
# [s] of a new run from which its kind is decided: before, the prior alone says whether something is held
KIND_FROM = 0.25
# [s] of a new run after which its kind is decided, however little is known of the mass
KIND_LATEST = 1.5
# [s] of a new run within which it may be recognised as an earlier one: twice the longest push
# (test_what_is_put_down_is_gone_and_what_is_taken_up_again_is_recognised)
RETURN_UNTIL = 6.0
# [s] after a change within which a step as small as a recognition is sure of tells that it was wrong: twice the time it
# had (test_what_was_taken_for_an_earlier_payload_is_corrected_and_no_new_change)
RETURN_WITHIN = 2.0 * RETURN_UNTIL
# [payloads] standard deviation of the mass with which a kind is decided: 50 g of a Panda, a light payload held or not
KIND_STD = 0.033
# [payloads] the same to tell a run from an earlier one: 15 g of a Panda
RETURN_STD = 0.01
# [of the earlier payload's mass] the same where something was held, if that is less: 5 g of 0.3 kg. Where one that
# weighs the same is as likely beforehand as another of its lot, which weighs 20 % more or less (1 sigma, assumed), an
# equal mass tells of the same with odds of 0.2/0.017 = 12 : 1. With 15 g, of payloads within 20 % of 0.3 kg, handed
# over at a standstill, 86 to 94 % of the masses were inside once the arm moved on (`benchmarks/near_payloads.py`)
RETURN_SHARE = 0.017

# ---------------------------------------------------------------------------------- which run is which, `runs.py`

# [squared standard deviations] of mass and first moments: nine of ten runs of the same payload lie within
# (test_another_payload_of_another_mass_is_no_return)
SAME_RUN = 7.779440339734858  # the 90 % quantile of a chi-square distribution of four degrees of freedom
# [s] an empty run must have lasted to be a tare: with less it knows the arm no better than the prior
TARE_FROM = 3.0
# [s] that all a run knew counts for when it is taken up again: an arm that warms up is not what it was half an hour
# ago. Of one that stays as it is, no answer is worse or wider for it (`benchmarks/warming_up.py`)
REMEMBERED = 100.0
# [payloads] standard deviation of the change of mass, below which it is reported: 150 g of a Panda
# (test_the_mass_of_a_change_is_what_the_runs_tell_once_its_kind_is_known)
STEP_STD = 0.1

# ---------------------------------------------------------------------- notes, `online_identifier.py`, `listening.py`

# [rad/s] of any joint: an arm that is slower stands (test_a_standing_arm_says_so_and_claims_no_inertia)
MOVING = AT_REST
# [s] within which the arm was seen to move: a motion that turns round stands for less
RECENT = 0.5
# [s] of rows that count for nothing: with the time that one pose counts, as long at rest as `RECENT`
STANDS = RECENT - SMOOTH.block
# [s] without a usable sample that are reported: a pause of this length (`recording.GAP`) ends the filters' memory
# (test_an_answer_ages_and_says_why_while_no_sample_can_be_used)
SILENT = 0.1
# [samples] in a row that are reported where their times are bad, too: 0.1 s at 500 Hz, 1 s at the lowest rate
# (test_a_stream_of_which_nothing_can_be_used_says_why)
BAD_IN_A_ROW = 50
# [pauses] in a row, no two samples between them that belong together: one or two are a robot's, five are a wrong unit
PAUSES_IN_A_ROW = 5
# [s] between two answers of a run whose kind is decided, at most: as often as a service speaks
# (test_fewer_answers_find_the_same_changes_at_the_same_times)
SELDOM = 0.1

# ---------------------------------------------------------------------- what a profile learns, `learning.py`

# [s] of a run of the empty arm, at least, that a profile learns from: as long as a tare is asked for
LEARN_FROM = 20.0
