"""The data set: the paper's table, made of what `simulate` gives, resumable at any point, and tamper-evident."""

import json
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from armload.arms import arm
from armload.errors import DatasetError
from armload.inertia import InertialParameters
from armload.lab.dataset import build, build_dataset, open_dataset, table_columns
from armload.motion import random_motion
from armload.payloads import Payload, container_loadings, random_payloads
from armload.simulation import Sensors, World, simulate, simulate_inverse

ROWS = 40
PAPER = ["t", "m", "mrx", "mry", "mrz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]
PAPER += ["q1", "q2", "q3", "q4", "q5", "q6", "q7", "dq1", "dq2", "dq3", "dq4", "dq5", "dq6", "dq7"]
PAPER += ["tau1", "tau2", "tau3", "tau4", "tau5", "tau6", "tau7"]


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def request_(panda):
    """Arguments of a small build: 2 motions of different length × 2 worlds × 3 payloads, with noise."""
    return {
        "arm": panda,
        "motions": [random_motion(panda, 1, duration=2.0), random_motion(panda, 2, duration=3.0)],
        "payloads": [container_loadings()[5], *random_payloads(2, seed=7)],
        "worlds": [World.nominal(panda), World.real_like(panda, 4)],
        "sensors": Sensors.panda(panda),
        "rows_per_run": ROWS,
        "seed": 11,
        "progress": False,
    }


@pytest.fixture(scope="module")
def dataset(request_, tmp_path_factory):
    return build_dataset(tmp_path_factory.mktemp("data") / "set", **request_)


@pytest.fixture
def copy(dataset, tmp_path):
    """A copy of the finished data set to do harm to."""
    folder = tmp_path / "copy"
    folder.mkdir()
    for entry in dataset.path.iterdir():
        (folder / entry.name).write_bytes(entry.read_bytes())
    return folder


def test_the_table_has_the_papers_32_columns_and_four_identities(dataset):
    schema = parquet.read_schema(dataset.path / "table.parquet")
    assert schema.names == [*PAPER, "run", "payload", "motion", "world"]
    assert {str(kind) for kind in schema.types[:32]} == {"double"}
    assert {str(kind) for kind in schema.types[32:]} == {"int32"}
    assert len(container_loadings()) * build.ROWS_PER_RUN == 249_788  # as the paper counts


def test_the_arrays_are_the_columns_of_the_file(dataset):
    frame = parquet.read_table(dataset.path / "table.parquet")
    features = [name for name in PAPER if name[0] in "tqd"]
    np.testing.assert_array_equal(dataset.X, np.column_stack([frame[name] for name in features]))
    np.testing.assert_array_equal(dataset.y, np.column_stack([frame[name] for name in PAPER[1:11]]))
    for name in ("run", "payload", "motion", "world"):
        np.testing.assert_array_equal(getattr(dataset, name), frame[name])


def test_every_run_is_what_simulate_gives_for_it(dataset, request_, panda):
    assert dataset.runs == 12
    assert len(dataset) == 12 * ROWS
    seen = set()
    for run in range(12):
        rows = dataset.run == run
        (p,), (m,), (w,) = (np.unique(getattr(dataset, name)[rows]) for name in ("payload", "motion", "world"))
        payload, motion, world = request_["payloads"][p], request_["motions"][m], request_["worlds"][w]
        noise = int(np.random.SeedSequence([11, run]).generate_state(1)[0])
        sensors = request_["sensors"].evenly()
        rate = ROWS / motion.duration
        log = simulate(panda, motion, payload, world=world, sensors=sensors, rate=rate, seed=noise)
        again = dataset.recording(run)
        for name in ("t", "q", "dq", "tau"):
            np.testing.assert_array_equal(getattr(again, name), getattr(log, name))
        np.testing.assert_array_equal(dataset.truth(run).phi, payload.parameters.phi)
        np.testing.assert_array_equal(dataset.y[rows], np.tile(payload.parameters.phi, (ROWS, 1)))
        seen.add((p, m, w))
    assert len(seen) == 12


def test_runs_of_the_fast_sampler_are_what_it_gives_and_the_provenance_says_so(dataset, request_, panda, tmp_path):
    fast = build_dataset(tmp_path / "set", **request_, sampler="inverse")
    for run in (0, 11):
        (p,), (m,), (w,) = (np.unique(getattr(fast, name)[fast.run == run]) for name in ("payload", "motion", "world"))
        payload, motion, world = request_["payloads"][p], request_["motions"][m], request_["worlds"][w]
        noise = int(np.random.SeedSequence([11, run]).generate_state(1)[0])
        how = {"world": world, "sensors": request_["sensors"].evenly(), "rate": ROWS / motion.duration, "seed": noise}
        log = simulate_inverse(panda, motion, [(0.0, payload)], **how)
        for name in ("t", "q", "dq", "tau"):
            np.testing.assert_array_equal(getattr(fast.recording(run), name), getattr(log, name))
    one, other = fast.provenance, dataset.provenance
    assert {k: v for k, v in one.items() if k not in other} == {"sampler": "inverse", "tracking": 1e-4}
    assert {k for k in other if one[k] != other[k]} == {"sha256"}
    np.testing.assert_array_equal(fast.y, dataset.y)
    assert fast.hash != dataset.hash
    with pytest.raises(DatasetError, match="made with other sampler"):
        build_dataset(fast.path, **request_)
    with pytest.raises(DatasetError, match="no sampler 'mujco': expected mujoco or inverse"):
        build_dataset(tmp_path / "other", **request_, sampler="mujco")


def test_rows_are_evenly_spaced_over_one_period(dataset, request_):
    for run in range(dataset.runs):
        log = dataset.recording(run)
        T = request_["motions"][dataset.motion[dataset.run == run][0]].duration
        np.testing.assert_allclose(log.t, np.arange(ROWS) * T / ROWS, atol=1e-12)


def test_the_provenance_says_what_it_was_made_from(dataset, request_, panda):
    p = json.loads((dataset.path / "provenance.json").read_text(encoding="utf-8"))
    assert p["arm"] == {
        "name": "panda",
        "frame": "panda_link8",
        "gravity": [0.0, 0.0, -9.81],
        "fingerprint": panda.fingerprint,
    }
    assert [m["name"] for m in p["motions"]] == [m.name for m in request_["motions"]]
    np.testing.assert_array_equal([x["phi"] for x in p["payloads"]], [x.parameters.phi for x in request_["payloads"]])
    assert [(w["name"], w["seed"]) for w in p["worlds"]] == [("nominal", None), ("real-like", 4)]
    assert (p["seed"], p["rows_per_run"], p["sensors"]["lost"]) == (11, ROWS, 0.0)
    assert {"armload", "mujoco", "numpy"} <= set(p["versions"])
    assert p["sha256"] == dataset.hash
    assert "480 rows: 12 runs of panda, 3 payloads × 2 motions × 2 worlds" in str(dataset)


def test_a_finished_data_set_is_opened_not_built_again(dataset, request_, monkeypatch):
    monkeypatch.setattr(build, "simulate_many", None)
    assert build_dataset(dataset.path, **request_).hash == dataset.hash


def test_an_interrupted_build_goes_on_where_it_was(dataset, request_, tmp_path, monkeypatch):
    real, batches = build.simulate_many, []

    def interrupted(robot, runs, **options):
        if len(batches) == 2:
            raise KeyboardInterrupt
        batches.append(len(runs))
        return real(robot, runs, **options)

    monkeypatch.setattr(build, "simulate_many", interrupted)
    with pytest.raises(KeyboardInterrupt):
        build_dataset(tmp_path / "set", **request_)
    with pytest.raises(DatasetError, match=r"is not finished: build it again with the same arguments"):
        open_dataset(tmp_path / "set")

    def counted(robot, runs, **options):
        batches.append(len(runs))
        return real(robot, runs, **options)

    monkeypatch.setattr(build, "simulate_many", counted)
    again = build_dataset(tmp_path / "set", **request_)
    assert batches == [3, 3, 3, 3]  # no run twice
    assert again.hash == dataset.hash
    np.testing.assert_array_equal(again.X, dataset.X)
    assert sorted(p.name for p in again.path.iterdir()) == ["provenance.json", "table.parquet"]


def test_a_build_stopped_at_any_file_ends_in_the_same_data_set(dataset, request_, tmp_path, monkeypatch):
    """Power fails at the k-th file that is to appear, for every k: what is there is whole, and the rest is built."""
    real = Path.replace
    known = {}
    simulated = build.simulate_many

    def remembered(robot, runs, **options):  # the simulation is not what is tested here
        key = tuple((id(run.motion), id(run.world), run.seed) for run in runs)
        known.setdefault(key, None)
        known[key] = known[key] or simulated(robot, runs, **options)
        return known[key]

    monkeypatch.setattr(build, "simulate_many", remembered)
    files = 1 + 4 + 1 + 1  # provenance, parts, table, provenance with the hash
    for k in range(files):
        left = [k]

        def failing(self, target, left=left):
            if left[0] == 0:
                raise KeyboardInterrupt
            left[0] -= 1
            return real(self, target)

        folder = tmp_path / f"set{k}"
        monkeypatch.setattr(Path, "replace", failing)
        with pytest.raises(KeyboardInterrupt):
            build_dataset(folder, **request_)
        monkeypatch.setattr(Path, "replace", real)
        with pytest.raises(DatasetError):
            open_dataset(folder)
        assert build_dataset(folder, **request_).hash == dataset.hash


def test_of_two_builds_in_one_folder_the_first_finishes_it_for_both(dataset, request_, tmp_path, monkeypatch):
    real, calls = build.simulate_many, []

    def overtaken(robot, runs, **options):
        calls.append(len(runs))
        if len(calls) == 2:  # the other build takes the first part, makes the rest, and takes the parts away
            assert build_dataset(tmp_path / "set", **request_).hash == dataset.hash
        return real(robot, runs, **options)

    monkeypatch.setattr(build, "simulate_many", overtaken)
    assert build_dataset(tmp_path / "set", **request_).hash == dataset.hash
    assert calls == [3, 3, 3, 3, 3]
    assert sorted(p.name for p in (tmp_path / "set").iterdir()) == ["provenance.json", "table.parquet"]


def test_parts_that_a_kill_has_left_beside_a_finished_data_set_go(dataset, request_, copy):
    (copy / "parts").mkdir()
    (copy / "parts" / "runs-000000-000002.parquet").write_bytes(b"PAR1")
    assert build_dataset(copy, **request_).hash == dataset.hash
    assert sorted(p.name for p in copy.iterdir()) == ["provenance.json", "table.parquet"]


def test_a_damaged_data_set_is_built_again_in_the_way_its_message_says(copy, request_):
    table, about = copy / "table.parquet", copy / "provenance.json"
    whole = table.read_bytes(), about.read_bytes()
    for path, left in ((table, whole[0][:100]), (table, None), (about, b"{")):
        table.write_bytes(whole[0])
        about.write_bytes(whole[1])
        path.unlink() if left is None else path.write_bytes(left)
        with pytest.raises(DatasetError, match="restore it, or remove the folder and build the data set again"):
            build_dataset(copy, **request_)
    for path in (table, about):
        path.unlink(missing_ok=True)
    copy.rmdir()
    assert len(build_dataset(copy, **request_)) == 12 * ROWS


def test_a_damaged_part_is_built_again(dataset, request_, tmp_path, monkeypatch):
    monkeypatch.setattr(build, "_finish", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        build_dataset(tmp_path / "set", **request_)
    monkeypatch.undo()
    parts = sorted((tmp_path / "set" / "parts").iterdir())
    parts[0].write_bytes(parts[0].read_bytes()[:-100])
    parts[1].write_bytes(parts[2].read_bytes()[:50] + parts[1].read_bytes()[50:])
    assert build_dataset(tmp_path / "set", **request_).hash == dataset.hash


def test_the_content_does_not_depend_on_the_size_of_the_parts(dataset, request_, tmp_path, monkeypatch):
    monkeypatch.setattr(build, "_BATCH", 2)
    again = build_dataset(tmp_path / "set", **request_)
    assert again.hash == dataset.hash
    np.testing.assert_array_equal(again.X, dataset.X)


@pytest.mark.parametrize(
    ("named", "other"),
    [
        ("motions", lambda r: {"motions": r["motions"][:1]}),
        ("payloads", lambda r: {"payloads": r["payloads"][::-1]}),
        ("worlds", lambda _: {"worlds": None}),
        ("sensors", lambda _: {"sensors": None}),
        ("seed", lambda _: {"seed": 12}),
        ("rows_per_run", lambda _: {"rows_per_run": ROWS + 1}),
        ("arm", lambda r: {"arm": r["arm"].with_payload(InertialParameters.from_com(0.1, (0, 0, 0), np.eye(3)))}),
    ],
)
def test_a_folder_made_otherwise_is_refused_and_left_alone(dataset, request_, named, other):
    before = {p.name: p.read_bytes() for p in dataset.path.iterdir()}
    with pytest.raises(DatasetError, match=rf"made with other .*{named}.*choose another folder"):
        build_dataset(dataset.path, **{**request_, **other(request_)})
    assert {p.name: p.read_bytes() for p in dataset.path.iterdir()} == before


def test_a_folder_with_other_things_is_refused(request_, tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(DatasetError, match=r"holds other things \(thesis\.tex\): expected an empty folder"):
        build_dataset(tmp_path, **request_)
    with pytest.raises(DatasetError, match=r"thesis\.tex is a file: expected a new or empty folder"):
        build_dataset(tmp_path / "thesis.tex", **request_)
    assert (tmp_path / "thesis.tex").read_text() == "precious"


def test_one_changed_number_is_noticed(copy):
    table = parquet.read_table(copy / "table.parquet")
    values = table["tau3"].to_numpy().copy()
    values[100] = np.nextafter(values[100], np.inf)
    place = table.column_names.index("tau3")
    parquet.write_table(table.set_column(place, "tau3", [values]), copy / "table.parquet")
    with pytest.raises(DatasetError, match=r"has changed since it was built"):
        open_dataset(copy)


def test_a_changed_provenance_is_noticed(copy):
    text = (copy / "provenance.json").read_text(encoding="utf-8")
    (copy / "provenance.json").write_text(text.replace('"seed": 11', '"seed": 12'), encoding="utf-8")
    with pytest.raises(DatasetError, match=r"has changed since it was built"):
        open_dataset(copy)


@pytest.mark.parametrize("place", np.linspace(0.001, 0.999, 12))
def test_any_damaged_byte_of_the_table_is_noticed(copy, place):
    data = bytearray((copy / "table.parquet").read_bytes())
    data[int(place * len(data))] ^= 0x55
    (copy / "table.parquet").write_bytes(data)
    try:
        found = open_dataset(copy)
    except DatasetError as error:
        assert "damaged" in str(error) or "changed" in str(error)  # noqa: PT017
    else:  # the byte carried no number
        assert found.hash == json.loads((copy / "provenance.json").read_text(encoding="utf-8"))["sha256"]


def test_what_is_no_data_set_is_refused(copy, tmp_path):
    with pytest.raises(DatasetError, match=r"nothing is not a data set: expected a folder with provenance\.json"):
        open_dataset(tmp_path / "nothing")
    (copy / "table.parquet").unlink()
    with pytest.raises(DatasetError, match=r"lacks table\.parquet"):
        open_dataset(copy)
    (copy / "provenance.json").write_text("{}")
    with pytest.raises(DatasetError, match=r"is not the provenance of a data set of this version"):
        open_dataset(copy)
    (copy / "provenance.json").write_text("{")
    with pytest.raises(DatasetError, match=r"provenance\.json cannot be read"):
        open_dataset(copy)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"motions": []}, r"no motions"),
        ({"payloads": []}, r"no payloads"),
        ({"worlds": []}, r"no worlds"),
        ({"rows_per_run": 1}, r"rows_per_run is 1"),
        ({"arm": arm("ur10e")}, r"has 7 joints: ur10e has 6"),
        (
            {"payloads": [Payload("x", InertialParameters(np.eye(10)[0], "panda_hand"))]},
            r"the payload 'x' is about the frame 'panda_hand': expected .* 'panda_link8'",
        ),
    ],
)
def test_a_request_that_cannot_be_met_makes_no_folder(request_, tmp_path, change, says):
    with pytest.raises(DatasetError, match=says):
        build_dataset(tmp_path / "set", **{**request_, **change})
    assert not (tmp_path / "set").exists()


def test_a_full_disk_is_one_sentence(request_, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(DatasetError, match=r"cannot be written \(No space left on device\): free some space"):
        build_dataset(tmp_path / "set", **request_)


def test_a_run_that_does_not_exist_is_refused(dataset):
    with pytest.raises(DatasetError, match=r"has no run 12: expected 0 to 11"):
        dataset.recording(12)


def test_progress_counts_the_runs_and_its_bar_leaves_the_standard_output_alone(request_, tmp_path, capsys):
    small = {**request_, "worlds": None, "motions": request_["motions"][:1]}
    seen = []
    build_dataset(tmp_path / "told", **{**small, "progress": seen.append})
    assert [(at.label, at.done, at.total) for at in seen] == [("simulating panda", k, 3) for k in (0, 3)]
    build_dataset(tmp_path / "shown", **{**small, "progress": True})
    assert capsys.readouterr().out == ""


def test_an_arm_with_six_joints_gets_29_columns(tmp_path):
    ur = arm("ur10e")
    made = build_dataset(
        tmp_path / "set",
        ur,
        [random_motion(ur, 0, duration=2.0)],
        random_payloads(2, 1),
        rows_per_run=10,
        progress=False,
    )
    assert made.X.shape == (20, 19)
    assert parquet.read_schema(made.path / "table.parquet").names[:29] == table_columns(6)
