"""`columns`: what the user says of a log's columns decides, and what is wrong with it is said in one sentence."""

from dataclasses import replace

import numpy as np
import pytest

from armload.arms import arm
from armload.errors import RecordingError
from armload.payloads import test_payload as make_payload
from armload.payloads import write_payload
from armload.recording import ColumnSpec, Recording, read_long, read_recording, write_recording

PANDA, ROWS = arm("panda"), 12


@pytest.fixture(scope="module")
def log():
    return Recording(np.arange(ROWS) / 1000, *np.random.default_rng(0).normal(size=(3, ROWS, 7)))


def write(
    path, log, q="enc_{}", dq="rate_{}", tau="load_{}", time="clock", scale=1.0, angle=1.0, keys=range(7), **more
):
    columns = {time: log.t * scale}
    for name, values in ((q, log.q * angle), (dq, log.dq * angle), (tau, log.tau)):
        columns |= {name.format(key): values[:, k] for k, key in enumerate(keys)}
    columns |= more
    with path.open("w") as file:
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in np.column_stack(list(columns.values())).tolist())
    return path


def same(found, log):
    for name in ("t", "q", "dq", "tau"):
        np.testing.assert_allclose(getattr(found, name), getattr(log, name), rtol=0, atol=1e-12, err_msg=name)


SPEC = "t=clock,q=enc_{i},dq=rate_{i},tau=load_{i}"


def test_named_columns_are_read_from_0_or_from_1(tmp_path, log):
    same(read_recording(write(tmp_path / "a.csv", log), PANDA, columns=SPEC), log)
    same(read_recording(write(tmp_path / "b.csv", log, keys=range(1, 8)), PANDA, columns=SPEC), log)
    same(read_recording(tmp_path / "b.csv", columns=SPEC), log)


def test_joint_names_stand_for_joints(tmp_path, log):
    path = write(tmp_path / "a.csv", log, "{}:a", "{}:b", "{}:c", keys=PANDA.joint_names)
    spec = {"t": "clock", "q": "{joint}:a", "dq": "{joint}:b", "tau": "{joint}:c"}
    same(read_recording(path, PANDA, columns=spec), log)
    with pytest.raises(RecordingError, match=r"needs the arm's joint names: name the arm"):
        read_recording(path, columns=spec)


@pytest.mark.parametrize(
    ("written", "keys", "columns", "named"),
    [
        (("q{}", "dq{}", "tau{}"), range(1, 8), None, False),
        (("{}_position", "{}_velocity", "{}_effort"), PANDA.joint_names, None, True),
        (("{}:a", "{}:b", "{}:c"), PANDA.joint_names, "q={joint}:a,dq={joint}:b,tau={joint}:c", True),
        (("enc_{}", "rate_{}", "load_{}"), range(7), "q=enc_{i},dq=rate_{i},tau=load_{i}", False),
    ],
)
def test_joints_have_names_only_where_the_table_names_them(tmp_path, log, written, keys, columns, named):
    path = write(tmp_path / "a.csv", log, *written, time="t", keys=keys)
    found = read_recording(path, PANDA, columns=columns)
    same(found, log)
    assert found.joint_names == (PANDA.joint_names if named else None)


def test_a_toml_file_says_the_same_with_units_and_lists_of_names(tmp_path, log):
    path = write(tmp_path / "a.csv", log, scale=1000.0, angle=180.0 / np.pi)
    names = ", ".join(f'"load_{k}"' for k in range(7))
    lines = ['t = "clock"', 'q = "enc_{i}"', 'dq = "rate_{i}"', f"tau = [{names}]"]
    lines += ['t_unit = "ms"', 'q_unit = "deg"', 'dq_unit = "deg/s"']
    (tmp_path / "flat.toml").write_text("\n".join(lines))
    (tmp_path / "table.toml").write_text("\n".join(['robot = "panda"', "[columns]", *lines]))
    (tmp_path / "marked.toml").write_text("\n".join(lines), encoding="utf-8-sig")  # as some editors save a text
    for name in ("flat.toml", "table.toml", "marked.toml"):
        same(read_recording(path, PANDA, columns=tmp_path / name), log)
        same(read_recording(path, PANDA, columns=str(tmp_path / name)), log)


def test_what_is_not_named_is_found_by_its_name(tmp_path, log):
    path = write(tmp_path / "a.csv", log, dq="velocity_{}", tau="effort_{}", time="time")
    same(read_recording(path, PANDA, columns="q=enc_{i}"), log)


def test_what_is_named_decides_between_two_readings(tmp_path, log):
    more = {f"position_{k}": np.full(ROWS, float(k)) for k in range(7)} | {"timestamp": np.arange(ROWS)}
    path = write(tmp_path / "a.csv", log, "q{}", "dq{}", "tau{}", "t", **more)
    with pytest.raises(RecordingError, match="could be"):
        read_recording(path, PANDA)
    same(read_recording(path, PANDA, columns="q=q{i},t=t"), log)
    other = read_recording(path, PANDA, columns="q=position_{i},t=timestamp,t_unit=ms")
    np.testing.assert_array_equal(other.q, np.tile(np.arange(7.0), (ROWS, 1)))
    np.testing.assert_allclose(other.t, np.arange(ROWS) / 1000, atol=1e-15)


def test_a_range_takes_the_arms_own_joints(tmp_path, log):
    more = {f"{name}_{k}": np.zeros(ROWS) for name in ("enc", "rate", "load") for k in (7, 8)}
    path = write(tmp_path / "a.csv", log, **more)
    with pytest.raises(RecordingError, match=r"indices 0, 1, .* 8: expected 0 … 6 or 1 … 7; name a range"):
        read_recording(path, PANDA, columns=SPEC)
    same(read_recording(path, PANDA, columns=SPEC.replace("{i}", "{0..6}")), log)


def test_motor_currents_are_multiplied_with_the_constants(tmp_path, log):
    path = write(tmp_path / "a.csv", log)
    found = read_recording(path, PANDA, columns=SPEC + ",tau_unit=A,torque_constants=1 2 3 4 5 6 7")
    np.testing.assert_allclose(found.tau, log.tau * np.arange(1, 8), rtol=1e-15)
    assert any("motor current times 1 2 3 4 5 6 7 N·m/A" in note for note in found.notes)
    with pytest.raises(RecordingError, match=r"no torque constants are known for panda"):
        read_recording(path, PANDA, columns=SPEC + ",tau_unit=A")
    with pytest.raises(RecordingError, match=r"2 torque constants for 7 joints"):
        read_recording(path, PANDA, columns=SPEC + ",tau_unit=A,torque_constants=1 2")


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        ("enc_{i}", r"'enc_\{i\}' is not KEY=VALUE: expected KEY=VALUE pairs such as"),
        ("position=enc_{i}", r"unknown key 'position': expected t, q, dq, tau"),
        ("q=a_{i},q=b_{i}", r"q is given twice"),
        ("t_unit=min", r"t_unit is 'min': expected one of s, "),
        ("rate=fast", r"rate is 'fast': expected numbers"),
        ("rate=0", r"rate is 0: expected a positive number"),
        ("nowhere.toml", r"nowhere\.toml cannot be read: No such file"),
        (SPEC + ",tau=", r"'tau=' is not KEY=VALUE"),
        (
            SPEC.replace("load", "lode"),
            r"has no column 'lode_\{i\}', which --columns names for tau: found clock",
        ),
        (SPEC.replace("clock", "time"), r"has no column 'time', which --columns names for t"),
        ("t=clock,q=enc_{0..5},dq=rate_{i},tau=load_{i}", r"names 6 column\(s\) of position for 7 joints"),
        (SPEC + ",episode=2", r"has no column 'episode_index', and so no episodes: leave --episode out"),
        (SPEC + ",rate=100", r"has times \(column 'clock'\): expected no --rate"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, log, spec, says):
    path = write(tmp_path / "a.csv", log)
    with pytest.raises(RecordingError, match=says) as refusal:
        read_recording(path, PANDA, columns=spec)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("line", ["episode = inf", f"rate = {10**400}", f"torque_constants = [{10**400}]"])
def test_a_number_that_nobody_can_hold_is_refused(tmp_path, line):
    (tmp_path / "lab.toml").write_text(line)
    with pytest.raises(RecordingError, match=r"lab\.toml: .*expected numbers"):
        ColumnSpec.of(tmp_path / "lab.toml")


def test_a_bag_takes_no_columns(tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(RecordingError, match=r"a ROS bag has its joints by name"):
        read_recording(tmp_path / "a.mcap", PANDA, columns=SPEC)


def test_a_spec_is_given_once():
    spec = ColumnSpec.of("rate=50")
    assert spec.over(rate=50.0, episode=None) == spec
    with pytest.raises(RecordingError, match=r"rate is given twice, as 50\.0 and as 60\.0"):
        spec.over(rate=60.0)
    assert ColumnSpec.of(spec.given()) == spec


def test_the_canonical_form_is_read_bit_for_bit_and_without_a_note(tmp_path, log):
    for suffix in (".csv", ".npz"):
        write_recording(tmp_path / f"a{suffix}", log)
        found = read_recording(tmp_path / f"a{suffix}", PANDA)
        assert found.notes == ()
        for name in ("t", "q", "dq", "tau"):
            np.testing.assert_array_equal(getattr(found, name), getattr(log, name))


BY_NUMBER = "t=1,q={2..8},dq={9..15},tau={16..22}"


@pytest.mark.parametrize(("separator", "head"), [(" ", ""), (",", "# run 3, of Monday\n"), ("\t", "% run 3\n\n")])
def test_columns_without_a_header_are_called_by_their_numbers(tmp_path, separator, head):
    rng = np.random.default_rng(3)
    table = np.column_stack([np.arange(20) / 100.0, rng.normal(size=(20, 21))])
    path = tmp_path / "log.txt"
    rows = "\n".join(separator.join(map(repr, row)) for row in table.tolist())
    path.write_text(head + rows + "\n")
    for read in (read_recording(path, PANDA, columns=BY_NUMBER), read_long(path, PANDA, columns=BY_NUMBER, long=0)):
        np.testing.assert_array_equal(np.column_stack([read.t, read.q[:], read.dq[:], read.tau[:]]), table)
    line = head.count("\n") + 1
    with pytest.raises(RecordingError, match=rf"line {line} holds numbers: .* 22 columns .*t=1,q=\{{2\.\.8\}},dq="):
        read_recording(path, PANDA)
    with pytest.raises(RecordingError, match=r"lacks a column of time"):
        read_recording(path, PANDA, columns=BY_NUMBER.removeprefix("t=1,"))
    path.write_text("\n".join(separator.join(map(repr, row)) for row in table[:, :-1].tolist()))
    with pytest.raises(RecordingError, match=r"has no column '22'"):
        read_recording(path, PANDA, columns=BY_NUMBER)


@pytest.mark.parametrize("carries", ["nothing", "a file"])
def test_gravity_that_a_controller_took_out_is_put_back(tmp_path, carries):
    """In a log that is read whole as in one that is read in parts, once."""
    rng, robot = np.random.default_rng(5), arm("ur5e")
    log = Recording(np.arange(300) / 100.0, *rng.normal(size=(3, 300, 6)))
    loaded = robot if carries == "nothing" else robot.with_payload(make_payload().parameters)
    if carries != "nothing":
        write_payload(tmp_path / "set.json", make_payload())
        carries = str(tmp_path / "set.json")
    write_recording(tmp_path / "log.csv", replace(log, tau=log.tau - loaded.torque(log.q)))
    said = {"compensated": carries}
    tool = robot.with_payload(make_payload().parameters)  # a tool that is known is none of the controller's
    for of in (robot, tool):
        for read in (
            read_recording(tmp_path / "log.csv", of, columns=said),
            read_long(tmp_path / "log.csv", of, columns=said, long=0, size=50),
        ):
            np.testing.assert_allclose(read.tau[:], log.tau, atol=1e-9)
            assert any("gravity was put back into the torque" in note for note in read.notes)
    with pytest.raises(RecordingError, match=r"gravity is put back for an arm: name it"):
        read_recording(tmp_path / "log.csv", columns=said)
    with pytest.raises(RecordingError, match=r"compensated is of torque, and tau is said to be motor current"):
        ColumnSpec.of({**said, "tau_unit": "A"})
