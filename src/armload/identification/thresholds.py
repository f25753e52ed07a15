"""The numbers that decide what is said of a log, each with its unit, its reason and where the evidence is.

What half and twice each one would do to sound and to wrong logs: docs/constants.md.
"""

from __future__ import annotations

import numpy as np

from armload.inertia import SHRINK
from armload.regression.lag import GAIN

# ---------------------------------------------------------------------- the answer, `identify_log.py`

# [Hz] of a log: below, a whole lag of the regression passes between two samples
# (test_only_measured_torque_at_a_useful_rate_is_taken)
LOWEST_RATE = GAIN
# [standard deviations] between what the log says and the nearest body: the truth of one sound log in a thousand lies
# farther from what is found (`inertia.distance_to_body`; test_sound_logs_have_a_body_within_the_error_bars)
MISFIT = 5.439512702905879  # the 99.9 % quantile of a chi distribution of ten degrees of freedom
# [of the expected offsets, rms] at most of a sound arm's, whose friction may differ from one way to the other: none of
# 384 sound simulated logs of a UR10e is beyond (`benchmarks/wrong_logs.py --robot ur10e`;
# test_friction_of_one_way_is_no_offset_of_an_arm_s_torque)
LARGEST_OFFSET = 5.0
# [effort limits] Coulomb friction that some joint shows of any torque that is measured: the least of two Pandas' large
# joints is 2.3e-3, of their wrists 2e-2; a model's torque leaves 2e-4
# (test_a_torque_that_is_computed_and_not_measured_is_told_by_its_lack_of_friction)
LEAST_SEEN = 1e-3
# [standard deviations] by which friction is found to drive its joint, where it must brake it: its work over the path
# (`identification.shown_friction`). Of sound logs of 1 to 8 s, simulated (36 of five arms) and real, it is at most 1,
# but for 4 in one window of a KUKA's unfiltered velocities; with a wrist torque's sign turned 1 to 140
# (test_friction_that_drives_a_joint_is_told_by_the_joint, `benchmarks/wrong_logs.py`)
BACKWARDS = 3.0
# [standard deviations] by which a log's torques are another multiple of what the arm's own links need: that of one
# sound log in a thousand is farther from 1. Torques that are 0.74 or 1.3 times as large are farther, where links are
# known well (test_torques_in_another_unit_are_told_by_the_links_that_they_carry)
OTHER_SCALE = 3.2905
# [1] standard deviation of that multiple from arm to arm, beside what the link parameters' own errors make it: a real
# Panda's is 1.02, a sound simulated one's up to 1.06 (test_the_scale_of_a_sound_arm_is_no_doubt)
LINKS_ALIKE = 0.03
# [rad] a joint that stays within so much stands: friction below stiction holds it
MOVES = 0.05
# times that a log tells a parameter worse under the weak prior: beyond, it leaves it to the learned one. The factor by
# which a parameter's interval must shrink to count as determined
LEANS = SHRINK
# [squared standard deviations] between two distances, whether a tool was mounted at a tare: odds of 90 to 1, exp(9 / 2)
# (test_where_the_tare_does_not_tell_of_the_tool_the_intervals_hold_both_cases)
DECISIVE = 9.0
# [rated payloads] a tool that weighs more is in grams, a payload that weighs more is none. Sound logs hold up to twice
# the rated payload (test_simulated_logs_up_to_twice_the_rated_payload_pass)
HEAVIEST = 3.0
# [m] from the payload frame to the centre of mass of anything that an arm holds: the bound where the mass may be zero.
# A stated prior, longer than the payloads of any family that is simulated
# (test_where_the_mass_may_be_zero_the_centre_s_interval_is_a_finite_bound)
FARTHEST = 1.0
# times 2 % of a link's mass (`Arm.link_spread`): figures so rough are nominal, and a tare is what is missing first.
# A Panda's have 1, an FR3's 3, those of arms that were never identified 10
# (test_where_figures_are_nominal_the_first_advice_is_a_tare)
NOMINAL = 5.0
# times the standard deviation that counts as determined: what even an arm known exactly would leave beyond lacks
# motion, what it would leave within may lack a tare. More than 1, as a tare lowers the noise that is found, too
# (test_what_is_said_to_lack_motion_a_tare_does_not_tell_either)
KNOWN = 1.5

# of what is left unexplained of a payload that stays the same on the arm as it was, the most that noise of the
# velocities and friction that grows with the load may leave where they are to explain it. A stated bound: one of 96
# logs of arms that changed since their tare, or were exchanged, is explained so, and sound ones are
# (`benchmarks/rubbing_joints.py`; test_an_arm_that_changed_since_its_tare_is_not_explained_by_its_rubbing)
EXPLAINS = 0.7
# [s] between two samples of a log, above which a note says so: a payload may be exchanged in as long. A stated prior
# (test_a_pause_of_a_log_is_said)
PAUSE_SAID = 1.0

# ---------------------------------------------------------------------- a payload that changes, `segments.py`

# [of the heavier one] by how much the masses of two parts have to differ beside their half-widths where neither is
# rigid: by less, it is one payload that swings. A stated prior: of one of which 30 % swing or slosh, parts differ by up
# to 10 %; of one that is taken up by all of it (test_a_payload_taken_up_at_times_that_jitter_is_found)
SWAYS = 0.3
# T of what is added at a cut of the log, where the payload has changed: the 99.9 % quantile of a chi-squared
# distribution of ten degrees of freedom; sound simulated logs stay below (`benchmarks/changed_logs.py`)
PAYLOAD_CHANGED = 29.588298445074422
# T where it may have: the 99 % quantile
PAYLOAD_MAY_CHANGE = 23.209251158954356
# of what is held: standard deviation of what gears lose of it in one part of a log and not in another, where torque is
# motor current. A stated prior; without it sound logs of heavy payloads are called changed
# (`benchmarks/changed_logs.py`)
LOSS_DIFFERS = 0.03
# [effort limits] by how much the torques may drift from a log's start to its end, 1 sigma: 1.7 N·m of a Panda's large
# joints, a cell that warms up or a sensor that fails; twice `DRIFT_SIZE` of a stream, whose drift is a sound arm's. A
# stated prior (test_torques_that_drift_are_no_change_of_payload)
TORQUE_DRIFT = 0.02
# log odds from which a drift is said that no change of payload would explain as well: one log in a thousand drifts, a
# stated prior (sound logs: `benchmarks/wrong_logs.py`). And from which another payload beside a drift is a change: one
# drifting log in a thousand has both (test_a_change_that_no_drift_alone_explains_is_found)
DRIFT_SAID = 6.9
# [s] the shortest part that is distinguished from its neighbours: with less no inertia and hardly a mass is known
PART_LEAST = 0.5
# [s] left out after a change: four lags of the regression, 2 % of the old torque is left
SETTLED = 0.2
# T of what is added while the arm stands: the 99.9 % quantile of a chi-squared distribution of three degrees of
# freedom, as one pose tells the mass and two moments
CHANGED_AT_REST = 16.26623619623813
# [rad] that a joint turns until its friction has turned over: presliding, a hundredth of a degree to half a one of
# geared joints. A stated prior
PRESLIDING = 5e-3
# of the shorter part, and of the whole log: by how much the next cut is farther from an end of the log. One that is off
# by more is not likely enough to be sought more finely (test_what_is_taken_up_shortly_before_the_end_is_found)
CUT_FARTHER, CUT_SHARE = 0.6, 1.0 / 9.0

# ---------------------------------------------------------------------- units, columns and limits, `plausibility.py`

# [rad] beyond the limits: descriptions round them (test_positions_outside_the_limits_are_refused_by_joint_and_row)
POSITION_TOLERANCE = 0.05
# [rad] hardly any joint goes beyond a full turn and a half radian: degrees
DEGREES_FROM = 2.0 * np.pi + 0.5
# [velocity limits] controllers stop an arm at one, degrees per second are 57 times too many
# (test_too_fast_is_refused_by_joint_and_row)
SPEED = 2.0
# [rad/s] taken for the limit of a joint that has none: about twice the fastest joint of the catalogue's arms
ANY_SPEED = 10.0
# [rad] beyond what `SPEED` allows between two samples: a stamp that came late (test_poor_real_logs_pass)
JUMP = 0.1
# [rad] rms of a joint's motion within a window of 0.25 s: below, the joint stands, and what dq says is noise
WINDOW_MOVES = 0.005
# relative rms difference of ∫dq dt and the change of q: a lag of dq by 50 ms leaves 0.3 at 1 Hz
# (test_wrong_units_and_columns_are_refused_by_name)
NOT_DERIVATIVE = 0.5
# [effort limits] in more than `EFFORT_SHARE` of the samples, or in one of a stream: a payload of twice the rated mass,
# far off the flange, asks up to 2.4 times the rated torque of the wrist
EFFORT = 3.0
# share of the samples: single ones may be spikes of a sensor
EFFORT_SHARE = 0.01
# [effort limits] in any sample: no spike is so large, a torque in another unit is
# (test_torque_in_wrong_units_or_of_a_wrong_channel_is_refused)
EFFORT_EVER = 10.0
# [N·m] in all joints and rows: no sensor is so calm
NO_TORQUE = 1e-3
# [s] without any change of torque: no sound sensor is so calm
# (test_torque_that_stands_still_while_the_arm_moves_is_refused_by_row)
FROZEN_TIME = 0.25
# [rad] that a joint moves meanwhile: a standing arm's torque may well repeat where it is rounded
FROZEN_MOTION = 0.1
# times as long as any other value of a joint's torque, of one that is rounded to as much less than a model error: with
# noise it repeats for a sample or two, so that one that is held for `FROZEN_TIME` is not measured. Also the steps of a
# rounded torque that its own weight must change by meanwhile. Sound logs, simulated and real, rounded to 1 to 100 mN·m,
# too, pass (test_a_torque_that_is_rounded_is_not_taken_for_one_that_stands_still)
FROZEN_LONGER = 10.0

# ---------------------------------------------------------------------- the arm's own torque, `torque_scale.py`

# [rated torques] rms of a model error. This and the next three are stated priors, wide enough for sound logs, simulated
# and real, to pass (test_real_logs_pass)
MODEL_ERROR = 0.03
# [rated torques] standard deviation of an offset
OFFSET = 0.05
# [rated torques] standard deviation of gear friction, as motor currents show it
FRICTION = 0.2
# [rated torques] rms of what holds a joint at rest (test_friction_that_keeps_hold_of_resting_joints_is_no_wrong_robot)
STICTION = 0.1
# of the arm's own torque, what a sound log may show at least: 1 is a factor of 1.7 away
# (test_the_torque_scale_is_one_for_the_arm_itself_and_the_factor_for_another)
SCALE_LOW = 0.6
# of the arm's own torque, what a sound log may show at most: the same factor (test_the_wrong_arm_is_refused)
SCALE_HIGH = 1.7
# [standard deviations] that the scale must be beyond either: one side of a normal 95 % interval
SCALE_SURE = 2.0
# [model errors] rms of what the arm's own torque leaves: a sound log's is about 1 by the meaning of `MODEL_ERROR`
MODEL_MISFIT = 2.5
# [model errors] above which columns that are exchanged are looked for: what a sound log's misfit is about. Real logs
# have 0.1 to 0.7, with two wrist torques exchanged 1 and more
# (test_exchanged_torque_columns_of_a_real_log_are_named)
SWAPPED_MISFIT = 1.0
# of the misfit, what may be left with two torque columns exchanged back: real logs leave at most 0.449
# (test_exchanged_torque_columns_of_a_real_log_are_named)
SWAPPED_SHARE = 0.45
# [log odds] by which two joints exchanged back explain a log better, one window in four counting: 55 to 1. Of 192
# sound simulated logs of all arms one is explained better so by 2.8, one by 1.2, the rest by at most 0.7, with torques
# 60 ms late none by more than 2; of the first and third joint exchanged it is 15 and more, but for a small arm, of the
# last two joints of a UR10e 4 and more in three of four logs
# (test_joints_in_the_order_of_the_alphabet_are_refused_by_name, `benchmarks/wrong_logs.py`)
JOINTS_EXCHANGED = 4.0
# [log odds] by which two joints exchanged back explain a log better with viscous friction and rotors among the
# unknowns, too. Of 156 sound simulated logs of motor currents no exchange does by more than 0.3, of the first and third
# joint exchanged it is 3.2 and more (test_viscous_friction_and_rotors_are_no_exchanged_joints)
EXCHANGED_BY_GEARS = 1.0
# of the misfit, what is left in the parts of a log whose payload changed: 0.03 of a simulated one, where parts of logs
# of another robot, unit, sign or base keep 0.3 and more (test_a_payload_that_is_put_down_is_not_taken_for_no_torque)
PARTS_SHARE = 0.25
# [log odds] by which another form of the torque, currents or one without gravity, explains a log better than the torque
# itself, or a base mounted another way better than either, one window in four counting: 7 to 1. The most of 90 sound
# simulated logs of UR arms is 0.6; of them without gravity, that it is in there, 0.6 (`benchmarks/torque_forms.py`)
OTHER_FORM = 2.0
# [N·m/A] torque constant of a joint, gear included, at least: the wrist of a small arm. A UR10e's are 10 to 12
# (test_motor_currents_are_called_so_with_what_to_do)
CURRENT_LOW = 4.0
# [N·m/A] torque constant of a joint where nobody tells: a UR10e's are 10 to 12, those of other arms with gears of 100
# to 1 much the same (test_currents_and_torque_without_gravity_are_called_so_where_their_size_says_nothing)
CURRENT_USUAL = 11.0
# [N·m/A] torque constant of a joint, gear included, at most: the shoulder of a large arm
# (test_motor_currents_are_called_so_with_what_to_do)
CURRENT_HIGH = 60.0
