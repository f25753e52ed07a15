"""Logs without velocities: those that their positions tell, near enough that answers stay the same."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from numpy.testing import assert_allclose
from tests.recording.test_recording_bags import KINDS, write_bag

from armload.arms import arm
from armload.errors import RecordingError
from armload.identification import check_plausible, identify
from armload.recording import Recording, read_long, read_recording, write_recording
from armload.recording.steadied import with_velocities_of_positions

PANDA = arm("panda")


def smooth(rate, pause=0.0, seconds=4.0):
    """A log of joints that swing at 0.3 to 0.9 Hz, with a pause in its middle; its velocities in closed form."""
    t = np.arange(0.0, seconds, 1.0 / rate)
    t[len(t) // 2 :] += pause
    w = 2.0 * np.pi * np.linspace(0.3, 0.9, 7)
    middle = np.array([0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0])
    q, dq = middle + 0.4 * np.sin(np.outer(t, w)), 0.4 * w * np.cos(np.outer(t, w))
    return Recording(t, q, dq, PANDA.torque(q, dq), joint_names=PANDA.joint_names)


def error(found, log):
    """Of velocities, as a share of their size."""
    return np.sqrt(((found.dq - log.dq) ** 2).mean(axis=0) / (log.dq**2).mean(axis=0)).max()


def as_csv(log, folder):
    names = ["t", *(f"q{j}" for j in range(1, 8)), *(f"tau{j}" for j in range(1, 8))]
    table = np.column_stack([log.t, log.q, log.tau])
    np.savetxt(folder / "log.csv", table, delimiter=",", header=",".join(names), comments="", fmt="%.12g")
    return folder / "log.csv"


def as_npz(log, folder):
    np.savez(folder / "log.npz", t=log.t, q=log.q, tau=log.tau)
    return folder / "log.npz"


def as_parquet(log, folder):
    columns = {"timestamp": log.t, "observation.state": pa.array(log.q.tolist()), "effort": pa.array(log.tau.tolist())}
    parquet.write_table(pa.table(columns), folder / "log.parquet")
    return folder / "log.parquet"


@pytest.mark.parametrize("written", [as_csv, as_npz, as_parquet])
def test_a_table_without_velocities_has_those_of_its_positions(tmp_path, written):
    log = smooth(100.0)
    path = written(log, tmp_path)
    found = read_recording(path, PANDA)
    assert error(found, log) < 0.01
    assert_allclose(found.q, log.q, atol=1e-9)
    assert_allclose(found.tau, log.tau, atol=1e-9)
    assert any("velocities are told by the positions within 0.075 s" in note for note in found.notes)
    long = read_long(path, PANDA, long=0, size=50)
    assert_allclose(long.dq[:], found.dq)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_without_velocities_has_those_of_its_positions(tmp_path, kind):
    log = smooth(100.0)
    stamps = 1_700_000_000_000_000_000 + np.rint(1e9 * log.t).astype(int)
    sent = [(int(s), int(s), PANDA.joint_names, q, [], tau) for s, q, tau in zip(stamps, log.q, log.tau, strict=True)]
    path = write_bag(tmp_path, kind, {"/joint_states": sent})
    found = read_recording(path, PANDA)
    assert error(found, log) < 0.01
    assert any("velocities are told by the positions" in note for note in found.notes)
    assert_allclose(read_long(path, PANDA, long=0, size=50).dq[:], found.dq)


@pytest.mark.parametrize(("rate", "most"), [(1000.0, 0.005), (50.0, 0.01), (15.0, 0.1)])
def test_velocities_of_positions_follow_the_motion_at_any_rate(rate, most):
    log = smooth(rate)
    assert error(with_velocities_of_positions(replace(log, dq=log.dq + 7.0)), log) < most


def test_no_velocity_is_told_across_a_pause():
    """Joints that are elsewhere afterwards have not moved there in one step."""
    log = smooth(100.0, pause=0.7)
    assert np.abs(np.diff(log.q, axis=0)).max() > 0.3
    assert error(with_velocities_of_positions(log), log) < 0.01


def test_a_header_with_velocities_of_some_joints_is_refused(tmp_path):
    text = as_csv(smooth(100.0), tmp_path).read_text().replace("tau1", "dq1", 1)
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(RecordingError, match=r"lacks columns? .dq2"):
        read_recording(tmp_path / "log.csv", PANDA)


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_velocities_that_are_wrong_can_be_left_out(tmp_path, kind):
    log = smooth(100.0)
    wrong = replace(log, dq=np.zeros_like(log.dq))
    if kind == "csv":
        path = tmp_path / "log.csv"
        write_recording(path, wrong)
    else:
        stamps = np.rint(1e9 * log.t).astype(int) + 1_700_000_000_000_000_000
        rows = zip(stamps, stamps, [PANDA.joint_names] * len(stamps), wrong.q, wrong.dq, wrong.tau, strict=True)
        path = write_bag(tmp_path, kind, {"/joint_states": [(int(a), int(b), *of) for a, b, *of in rows]})
    with pytest.raises(RecordingError, match=r"dq1 is zero although q1 moves.*--columns dq=none takes the velocities"):
        check_plausible(read_recording(path, PANDA), PANDA)
    found = read_recording(path, PANDA, columns="dq=none")
    assert error(found, log) < 0.01


@pytest.mark.full
def test_a_real_pair_has_the_same_answer_by_its_positions_alone(real_data):
    """The UR10e that holds 2.805 kg, with its tare: the robot's own velocities, and those of its positions."""
    robot = arm("ur10e")
    run, tare = (read_recording(real_data / f"ur10e_{name}.csv", robot) for name in ("loaded_2805g", "unloaded"))
    own = identify(run, robot, tare=tare)
    told = identify(with_velocities_of_positions(run), robot, tare=with_velocities_of_positions(tare))
    half = (own.phi_high - own.phi_low) / 2.0
    assert np.all(np.abs(told.phi - own.phi) < 0.2 * half)
    assert told.phi_low[0] < 2.805 < told.phi_high[0]
    assert told.interval == own.interval


def test_velocities_that_are_there_are_read(tmp_path):
    log = smooth(100.0)
    write_recording(tmp_path / "log.csv", replace(log, dq=1.001 * log.dq))
    found = read_recording(tmp_path / "log.csv", PANDA)
    assert_allclose(found.dq, 1.001 * log.dq)
    assert not any("velocities" in note for note in found.notes)
