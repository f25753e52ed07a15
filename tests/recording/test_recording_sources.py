"""Logs as other tools write them: each gives the numbers of the canonical form, or says what it lacks.

The headers are copied from what the tools' sources print (docs/recordings.md names them); the numbers are those of one
log of each arm, in full.
"""

import numpy as np
import pytest

from armload.arms import arm
from armload.errors import RecordingError
from armload.recording import Recording, read_long, read_recording, write_recording

ROWS, EPOCH = 24, 1_700_000_000_123_456_789  # [1], [ns] since 1970: no multiple of what a double resolves


def canonical(robot):
    """A log of an arm at 1 kHz, from t = 0; its numbers need all 17 digits."""
    rng = np.random.default_rng(robot.n)
    return Recording(np.arange(ROWS) / 1000, *rng.normal(size=(3, ROWS, robot.n)), joint_names=robot.joint_names)


def same(found, log, tolerance=1e-9):
    assert found.joint_names in (None, log.joint_names)  # None: they are counted
    for name in ("t", "q", "dq", "tau"):
        np.testing.assert_allclose(getattr(found, name), getattr(log, name), rtol=0, atol=tolerance, err_msg=name)


def write(path, columns, separator=",", head="", decimal="."):
    """Columns by name as text; numbers with as many digits as they need."""
    lines = [separator.join(columns)]
    cells = [
        [value if isinstance(value, str) else repr(value) for value in list(column)] for column in columns.values()
    ]
    lines += [separator.join(row) for row in zip(*cells, strict=True)]
    text = "\n".join(lines) + "\n"
    path.write_text(head + (text.replace(".", decimal) if decimal != "." else text), encoding="utf-8")
    return path


def numbered(pattern, values, first=0):
    """Columns `pattern` with the index of each joint."""
    return {pattern.format(k + first): column.tolist() for k, column in enumerate(values.T)}


def milliseconds(log):
    return {"time": [round(1000 * t) for t in log.t]}


def noise(log, name, count, seed=7):
    """Columns that are no part of the log."""
    return numbered(name, np.random.default_rng(seed).normal(size=(len(log), count)))


def libfranka(log):
    return {
        **milliseconds(log),
        "success_rate": [1.0] * len(log),
        **numbered("state.q[{}]", log.q),
        **noise(log, "state.q_d[{}]", 7, 1),
        **numbered("state.dq[{}]", log.dq),
        **noise(log, "state.dq_d[{}]", 7, 2),
        **numbered("state.tau_J[{}]", log.tau),
        **noise(log, "state.tau_ext_hat_filtered[{}]", 7, 3),
        **noise(log, "cmd.q_d[{}]", 7, 4),
        **noise(log, "cmd.dq_d[{}]", 7, 5),
        **noise(log, "cmd.O_T_EE_d[{}]", 16, 6),
        **noise(log, "cmd.O_dP_EE_d[{}]", 6, 7),
        **noise(log, "cmd.tau_J_d[{}]", 7, 8),
    }


def stamps(log):
    return [EPOCH + round(1e9 * t) for t in log.t]


def rostopic(log, names, extra=()):
    """`rostopic echo -b run.bag -p /joint_states`; the publisher's order, with what else it publishes."""
    order = [*log.joint_names[::-1], *extra]
    picked = {name: log.joint_names.index(name) if name in log.joint_names else 0 for name in order}
    columns = {"%time": [stamp + 400_000 for stamp in stamps(log)], "field.header.seq": list(range(len(log)))}
    columns |= {"field.header.stamp": stamps(log), "field.header.frame_id": [""] * len(log)}
    if names:
        columns |= {f"field.name{k}": [name] * len(log) for k, name in enumerate(order)}
    for field, values in (("position", log.q), ("velocity", log.dq), ("effort", log.tau)):
        for k, name in enumerate(order):
            column = values[:, picked[name]] if name in log.joint_names else np.full(len(log), 0.04)
            columns[f"field.{field}{k}"] = column.tolist()
    return columns


def plotjuggler(log, extra=()):
    """The range of all series of /joint_states; alphabetical."""
    columns = {}
    for k, name in enumerate(log.joint_names):
        for field, values in (("position", log.q), ("velocity", log.dq), ("effort", log.tau)):
            columns[f"/joint_states/{name}/{field}"] = values[:, k].tolist()
    for name in extra:
        columns |= {f"/joint_states/{name}/{field}": [0.04] * len(log) for field in ("position", "velocity", "effort")}
    columns["/joint_states/header/stamp"] = log.t.tolist()
    return {"__time": log.t.tolist(), **dict(sorted(columns.items()))}


def rtde(log, constants, moments=False):
    moment = noise(log, "target_moment_{}", log.n) if moments else {}
    return {
        "timestamp": log.t.tolist(),
        **noise(log, "target_q_{}", log.n, 1),
        **numbered("actual_q_{}", log.q),
        **numbered("actual_qd_{}", log.dq),
        **noise(log, "target_current_{}", log.n, 2),
        **numbered("actual_current_{}", log.tau / np.array(constants)),
        **moment,
        **noise(log, "actual_TCP_pose_{}", 6, 3),
        "payload": [0.0] * len(log),
    }


def nist(log, constants):
    """NIST's measurements of a UR5, as flat tables of them name columns."""
    return {
        "ROBOT_TIME": log.t.tolist(),
        **noise(log, "ROBOT_TARGET_JOINT_POSITIONS (J{})", 7),
        **numbered("ROBOT_ACTUAL_JOINT_POSITIONS (J{})", log.q, 1),
        **noise(log, "ROBOT_TARGET_JOINT_VELOCITIES (J{})", 7),
        **numbered("ROBOT_ACTUAL_JOINT_VELOCITIES (J{})", log.dq, 1),
        **numbered("ROBOT_ACTUAL_JOINT_CURRENT (J{})", log.tau / np.array(constants), 1),
        **noise(log, "ROBOT_TARGET_JOINT_TORQUES (J{})", 7),
        **noise(log, "ROBOT_JOINT_TEMP (J{})", 7),
    }


def plain(log, q, dq, tau, time="t", first=0, **more):
    columns = {time: log.t.tolist()} if time else {}
    return {
        **columns,
        **more,
        **numbered(q, log.q, first),
        **numbered(dq, log.dq, first),
        **numbered(tau, log.tau, first),
    }


PANDA, UR = arm("panda"), arm("ur10e")
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
CONSTANTS = (11.98, 11.976, 9.836, 10.70, 10.70, 10.70)  # [N·m/A], arms/descriptions/ur10e.toml

FORMS = {
    "libfranka": (PANDA, libfranka, {}),
    "rostopic echo -p, fingers on the topic": (PANDA, lambda log: rostopic(log, True, FINGERS), {}),
    "rostopic echo -p of a UR": (UR, lambda log: rostopic(log, True), {}),
    "PlotJuggler": (PANDA, lambda log: plotjuggler(log, FINGERS), {}),
    "PlotJuggler of a UR": (UR, plotjuggler, {}),
    "ur_rtde": (UR, lambda log: rtde(log, CONSTANTS), {}),
    "RTDE client": (UR, lambda log: rtde(log, CONSTANTS), {"separator": " "}),
    "q[0]": (PANDA, lambda log: plain(log, "q[{}]", "dq[{}]", "tau[{}]"), {}),
    "q_0": (PANDA, lambda log: plain(log, "q_{}", "dq_{}", "tau_{}", "time"), {}),
    "Q1": (PANDA, lambda log: plain(log, "Q{}", "DQ{}", "TAU{}", "T", 1), {}),
    "position_1": (PANDA, lambda log: plain(log, "position_{}", "velocity_{}", "effort_{}", "timestamp", 1), {}),
    "joint_1_pos": (PANDA, lambda log: plain(log, "joint_{}_pos", "joint_{}_vel", "joint_{}_torque", "time_s", 1), {}),
    "jointPosition0": (PANDA, lambda log: plain(log, "jointPosition{}", "jointVelocity{}", "jointTorque{}"), {}),
    "bag to csv": (PANDA, lambda log: plain(log, "position[{}]", "velocity[{}]", "effort[{}]", "timestamp"), {}),
    "units in the header": (
        PANDA,
        lambda log: plain(log, "q{} [rad]", "dq{} (rad/s)", "tau{} [Nm]", "time [s]", 1),
        {},
    ),
    "pandas index": (
        PANDA,
        lambda log: plain(log, "q{}", "dq{}", "tau{}", "t", 1, **{"Unnamed: 0": range(len(log))}),
        {},
    ),
    "empty index": (PANDA, lambda log: {"": range(len(log)), **plain(log, "q{}", "dq{}", "tau{}", "t", 1)}, {}),
    "extra columns": (
        PANDA,
        lambda log: plain(log, "q{}", "dq{}", "tau{}") | noise(log, "ddq{}", 7) | noise(log, "x{}", 3),
        {},
    ),
    "text beside": (PANDA, lambda log: plain(log, "q{}", "dq{}", "tau{}", mode=["kMove"] * len(log)), {}),
    "Excel": (
        PANDA,
        lambda log: plain(log, "q{}", "dq{}", "tau{}"),
        {"separator": ";", "decimal": ",", "head": "\ufeff"},
    ),
    "comments": (PANDA, lambda log: plain(log, "q{}", "dq{}", "tau{}"), {"head": "# run 3\n# of Monday, 1 kHz\n"}),
    "Kortex": (
        PANDA,
        lambda log: plain(log, "actuators[{}].position", "actuators[{}].velocity", "actuators[{}].torque", "timestamp"),
        {},
    ),
    "NIST": (
        UR,
        lambda log: nist(log, CONSTANTS),
        {},
    ),
    "measured beside commanded": (
        PANDA,
        lambda log: (
            plain(log, "measured_pos_{}", "measured_speeds_{}", "measured_torque_{}")
            | noise(log, "commanded_pos_{}", 7)
            | noise(log, "commanded_torque_{}", 7)
        ),
        {},
    ),
    "currents beside moments": (UR, lambda log: rtde(log, CONSTANTS, moments=True), {}),
    "panda_joint1_eff": (PANDA, lambda log: plain(log, "joint{}_pos", "joint{}_vel", "joint{}_eff"), {}),
    "savetxt": (PANDA, lambda log: plain(log, "q{}", "dq{}", "tau{}", "# t"), {"separator": " "}),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_log_of_another_tool_gives_the_numbers_of_the_canonical_form(tmp_path, form):
    robot, columns, how = FORMS[form]
    log = canonical(robot)
    found = read_recording(write(tmp_path / "log.csv", columns(log), **how), robot)
    same(found, log)


def test_a_log_by_the_joints_own_names_is_put_into_the_arms_order(tmp_path):
    log = canonical(PANDA)
    order = [4, 0, 6, 2, 1, 5, 3]
    columns = {"time": log.t.tolist()}
    for field, values in (("position", log.q), ("vel", log.dq), ("effort", log.tau)):
        columns |= {f"{PANDA.joint_names[k]}_{field}": values[:, k].tolist() for k in order}
    same(read_recording(write(tmp_path / "log.csv", columns), PANDA), log)


@pytest.mark.parametrize(
    "parts",
    [
        ("header.stamp.sec", "header.stamp.nanosec"),
        ("stamp_secs", "stamp_nsecs"),
        ("sec", "nanosec"),
        ("time.sec", "time.nsec"),
        ("Seconds", "Nanoseconds"),
    ],
)
def test_a_stamp_in_two_parts_is_read_to_the_nanosecond(tmp_path, parts):
    log = canonical(PANDA)
    columns = plain(log, "position.{}", "velocity.{}", "effort.{}", None)
    columns[parts[1]] = [stamp % 10**9 for stamp in stamps(log)]
    columns[parts[0]] = [stamp // 10**9 for stamp in stamps(log)]
    same(read_recording(write(tmp_path / "log.csv", columns), PANDA), log)


def test_seconds_and_nanoseconds_that_are_not_parts_of_one_stamp_are_refused(tmp_path):
    log = canonical(PANDA)
    columns = plain(log, "position.{}", "velocity.{}", "effort.{}", None)
    columns |= {"sec": [stamp // 10**9 for stamp in stamps(log)], "nanosec": stamps(log)}
    with pytest.raises(RecordingError, match=r"'nanosec' holds 1[0-9]+: expected fewer than 1e9 nanoseconds, beside"):
        read_recording(write(tmp_path / "log.csv", columns), PANDA)
    same(read_recording(tmp_path / "log.csv", PANDA, columns="t=nanosec,t_unit=ns"), log)
    columns["time"] = log.t.tolist()  # another clock, too
    columns["nanosec"] = [stamp % 10**9 for stamp in stamps(log)]
    same(read_recording(write(tmp_path / "log.csv", columns), PANDA), log)


def test_a_log_of_pyfri_has_measured_positions_and_torques(tmp_path):
    iiwa = arm("iiwa14")
    log = canonical(iiwa)
    columns = {"index": list(range(len(log))), "time": log.t.tolist(), "record_time_nsec": stamps(log)}
    columns |= {"tsec": [stamp // 10**9 for stamp in stamps(log)], "tnsec": [stamp % 10**9 for stamp in stamps(log)]}
    for name, values in (("mp", log.q), ("ip", log.q + 0.01), ("mt", log.tau), ("et", 0.1 * log.tau)):
        columns |= {f"{name}{k + 1}": values[:, k].tolist() for k in range(7)}
    found = read_recording(write(tmp_path / "log.csv", columns | {"dt": [0.002] * len(log)}), iiwa)
    assert np.array_equal(found.q, log.q)
    assert np.array_equal(found.tau, log.tau)
    assert np.allclose(found.t - found.t[0], log.t - log.t[0], rtol=0.0, atol=1e-9)


def test_ros2_topic_echo_as_csv_reads(tmp_path):
    """It writes no header: a stamp in two parts, the frame, names, positions, velocities, efforts."""
    log, order = canonical(PANDA), [4, 0, 6, 2, 1, 5, 3]
    rows = [
        ",".join(
            [
                *(str(part) for part in divmod(stamp, 10**9)),
                "base",
                *(PANDA.joint_names[k] for k in order),
                *(repr(float(x[k])) for x in (q, dq, tau) for k in order),
            ]
        )
        for stamp, q, dq, tau in zip(stamps(log), log.q, log.dq, log.tau, strict=True)
    ]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    same(read_recording(tmp_path / "log.csv", PANDA), log)
    same(read_long(tmp_path / "log.csv", PANDA, long=0), log)


def test_messages_that_are_not_stamped_have_the_time_of_logging(tmp_path):
    log = canonical(PANDA)
    columns = rostopic(log, True) | {"field.header.stamp": [0] * len(log)}
    same(read_recording(write(tmp_path / "log.csv", columns), PANDA), log)


def test_plotjugglers_rows_of_other_topics_are_left_out_with_a_note(tmp_path):
    log, path = canonical(PANDA), tmp_path / "log.csv"
    columns = plotjuggler(log) | {"/wrench/force/x": [""] * len(log)}
    write(path, columns)
    header, *rows = path.read_text().splitlines()
    between = [f"{t + 4e-4!r}" + "," * (len(columns) - 1) + "1.5" for t in log.t]
    path.write_text("\n".join([header, *(line for pair in zip(rows, between, strict=True) for line in pair)]) + "\n")
    found = read_recording(path, PANDA)
    same(found, log)
    assert any(f"left out {ROWS} row(s) without position" in note for note in found.notes)


def test_the_log_of_panda_py_reads(tmp_path):
    """`np.savez(path, **panda.get_log())`: lists of vectors, times in whole milliseconds, as doubles of one element."""
    log = canonical(PANDA)
    arrays = {name: np.zeros((len(log), k)) for name, k in (("O_T_EE", 16), ("elbow", 2), ("tau_ext_hat_filtered", 7))}
    times = 5000.0 + np.round(1e3 * log.t)[:, None]
    said = {"time": times, "q": log.q, "dq": log.dq, "tau_J": log.tau}
    np.savez(tmp_path / "log.npz", **arrays, **said, control_command_success_rate=np.ones((len(log), 1)))
    found = read_recording(tmp_path / "log.npz", PANDA)
    np.testing.assert_allclose(found.t - found.t[0], (times - times[0])[:, 0] / 1e3, atol=1e-12)
    for name in ("q", "dq", "tau"):
        np.testing.assert_array_equal(getattr(found, name), getattr(log, name))


def test_the_log_of_libfranka_of_2017_reads(tmp_path):
    log, path = canonical(PANDA), tmp_path / "log.csv"
    state = {"duration": milliseconds(log)["time"], "success rate": [1.0] * len(log)}
    state |= {name.removeprefix("state."): column for name, column in libfranka(log).items() if "state." in name}
    write(path, state | {"sent commands": [""] * len(log)} | noise(log, "tau_J_d[{}]", 7))
    header, *rows = path.read_text().splitlines()
    again = header + "," + ",".join(f"q_d[{k}]" for k in range(7))  # it writes these names twice
    path.write_text("\n".join([again, *(row + ",9" * 7 for row in rows)]))
    same(read_recording(path, PANDA), log)


@pytest.mark.parametrize(
    ("form", "robot", "columns", "says"),
    [
        (
            "two sets of positions",
            PANDA,
            lambda log: plain(log, "q{}", "dq{}", "tau{}", first=1) | noise(log, "position_{}", 7),
            r"position could be 'q1' … 'q7' or 'position_0' … .*--columns \"q=q\{i\}\" or \"q=position_\{i\}\"",
        ),
        (
            "tau_J and tau_J_d",
            PANDA,
            lambda log: plain(log, "q{}", "dq{}", "tau_J{}") | noise(log, "tau_J_d{}", 7),
            r"torque could be 'tau_J0' … 'tau_J6' or 'tau_J_d0' … .*--columns \"tau=tau_J\{i\}\"",
        ),
        (
            "currents without constants",
            arm("ur5e"),
            lambda log: rtde(log, CONSTANTS),
            r"look like motor currents \[A\], and no torque constants are known for ur5e: .*torque_constants=",
        ),
        (
            "moments alone",
            UR,
            lambda log: {k: v for k, v in rtde(log, CONSTANTS, True).items() if "current" not in k},
            r"lacks the measured torque: 'target_moment_0' … .* is what the controller wants or its model expects",
        ),
        (
            "external torque alone",
            PANDA,
            lambda log: plain(log, "q{}", "dq{}", "tau_ext_hat_filtered{}"),
            r"lacks the measured torque: 'tau_ext_hat_filtered0' … .* has gravity and the arm's own torque taken out",
        ),
        (
            "two clocks",
            PANDA,
            lambda log: plain(log, "q{}", "dq{}", "tau{}", timestamp=log.t.tolist()),
            r"time could be column 't' or 'timestamp': expected one; decide with --columns t=t",
        ),
        (
            "no clock",
            PANDA,
            lambda log: plain(log, "q{}", "dq{}", "tau{}", None),
            r"lacks a column of time: .*--columns t=….*--rate HZ",
        ),
        (
            "nanoseconds that nobody states",
            PANDA,
            lambda log: plain(log, "q{}", "dq{}", "tau{}", None, timestamp=stamps(log)),
            r"times in column 'timestamp' are [0-9.e+]+ apart, too far for seconds.*--columns t_unit=",
        ),
        (
            "libfranka's names, but seconds",
            PANDA,
            lambda log: libfranka(log) | {"time": log.t.tolist()},
            r"libfranka writes whole ms in column 'time', here they are broken.*t_unit=s",
        ),
        (
            "from 0 and from 1",
            PANDA,
            lambda log: {
                "t": log.t.tolist(),
                **numbered("q{}", log.q),
                **numbered("dq{}", log.dq, 1),
                **numbered("tau{}", log.tau, 1),
            },
            r"counts its joints in two ways, 'q0' … 'q6' from 0 and .* from 1",
        ),
        (
            "fingers without names",
            PANDA,
            lambda log: rostopic(log, False, FINGERS),
            r"log has 9 joints",
        ),
        (
            "names of another arm",
            PANDA,
            lambda log: {k.replace("panda", "fr3"): v for k, v in plotjuggler(log).items()},
            r"has no columns named|lacks",
        ),
        (
            "names that change",
            PANDA,
            lambda log: rostopic(log, True) | {"field.name0": ["panda_joint7", "finger"] * (len(log) // 2)},
            r"'field.name0' does not name the same joint in every row",
        ),
        (
            "cells of another arm's joints",
            PANDA,
            lambda log: rostopic(log, True) | {"field.name0": ["fr3_joint7"] * len(log)},
            r"are not of panda_joint7: found fr3_joint7",
        ),
        (
            "twice in two spellings",
            PANDA,
            lambda log: plain(log, "q{}", "dq{}", "tau{}") | noise(log, "Q_{}", 7),
            r"position of one joint could be column 'q0' or 'Q_0'",
        ),
        (
            "an unknown unit",
            PANDA,
            lambda log: plain(log, "q{} [turns]", "dq{}", "tau{}"),
            r"columns of position state the unit 'turns': expected one of rad",
        ),
        (
            "thousands and decimal commas",
            PANDA,
            lambda log: {**plain(log, "q{}", "dq{}", "tau{}"), "q0": ["1,5"] * (len(log) - 1) + ["1.500"]},
            r"has decimal commas and line 2 decimal points",
        ),
    ],
)
def test_a_header_that_can_be_read_in_two_ways_or_none_is_refused(tmp_path, form, robot, columns, says):
    separator = ";" if "commas" in form else ","
    path = write(tmp_path / "log.csv", columns(canonical(robot)), separator)
    with pytest.raises(RecordingError, match=says) as refusal:
        read_recording(path, robot)
    assert "\n" not in str(refusal.value)


def test_identify_says_the_same_of_every_form(tmp_path, analytic_log):
    from armload.identification import identify
    from armload.payloads import test_payload

    made = analytic_log(PANDA, test_payload().parameters, duration=4.0, rate=200.0)
    log = Recording(np.round(made.t, 3), made.q, made.dq, made.tau, joint_names=PANDA.joint_names)
    write_recording(tmp_path / "canonical.csv", log)
    expected = identify(read_recording(tmp_path / "canonical.csv", PANDA), PANDA, method="rls")
    for name, columns in (("franka", libfranka), ("juggler", plotjuggler), ("ros", lambda log: rostopic(log, True))):
        path = write(tmp_path / f"{name}.csv", columns(log))
        found = identify(read_recording(path, PANDA), PANDA, method="rls")
        np.testing.assert_allclose(found.parameters.phi, expected.parameters.phi, rtol=0, atol=1e-9)


def test_wanted_torque_that_is_asked_for_by_name_is_read_and_said_to_be_that(tmp_path):
    log = canonical(UR)
    moments = numbered("target_moment_{}", log.tau)
    columns = {k: v for k, v in rtde(log, CONSTANTS, True).items() if "current" not in k} | moments
    found = read_recording(write(tmp_path / "log.csv", columns), UR, columns="tau=target_moment_{i}")
    same(found, log)
    assert any("not set in the controller does not show in it" in note for note in found.notes)
