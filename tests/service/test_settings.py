"""What a file may say, and what is said of one that cannot be meant."""

import dataclasses
import re
from pathlib import Path

import pytest

from armload.app.cli import main
from armload.errors import RecordingError, UsageError
from armload.recording import ColumnSpec
from armload.service import ArmSettings, ServiceSettings, read_settings
from armload.service.access import read_token
from armload.service.alarms import _CONDITIONS
from armload.service.unknown import Unknown

OF_THE_SERVICE = ({f.name for f in dataclasses.fields(ServiceSettings)} | {"token_file"}) - {"arms", "token"}
CELL = """
every = 0.5
port = 0
webhook = "https://cell.example/alarms"
[headers]
Authorization = "Bearer abc"

[[arm]]
name = "left"
source = "fr3://172.16.0.2"
robot = "fr3"
tare = "empty.csv"
tare_age = "3d"
save = "state"
rating = 2.5
mass = "1.200±0.002"
body = "gear.json"
family = "wide"

[[arm]]
name = "right"
source = "sim"
robot = "panda"
gravity = [0, 0, -9.8]
steady = true
"""


def test_a_file_says_what_it_says_with_paths_from_its_own_folder(tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    settings = read_settings(tmp_path / "cell.toml", every=1.0)
    left, right = settings.arms
    assert (settings.every, settings.port, settings.headers) == (1.0, 0, {"Authorization": "Bearer abc"})
    assert (left.tare, left.save, left.rating) == (str(tmp_path / "empty.csv"), str(tmp_path / "state"), 2.5)
    assert (left.mass, left.body, left.family) == ("1.200±0.002", str(tmp_path / "gear.json"), "wide")
    assert (left.steady, right.steady) == (False, True)
    assert (left.tare_age, right.tare_age) == (3 * 86400.0, None)
    assert (right.source, right.gravity, right.state) == ("sim", (0.0, 0.0, -9.8), None)


def test_descriptions_and_models_are_files_beside_it_while_names_stay_names(tmp_path):
    (tmp_path / "cell.toml").write_text(
        CELL.replace('robot = "fr3"', 'robot = "my_arm.urdf"\nmethod = "models/mine.safetensors"')
    )
    left, right = read_settings(tmp_path / "cell.toml").arms
    assert left.robot == str(tmp_path / "my_arm.urdf")
    assert left.method == str(tmp_path / "models" / "mine.safetensors")
    assert (right.robot, right.method) == ("panda", None)
    (tmp_path / "cell.toml").write_text(CELL.replace('robot = "fr3"', 'robot = "fr3"\nmethod = "map-gp"'))
    assert read_settings(tmp_path / "cell.toml").arms[0].method == "map-gp"


def test_the_page_has_a_row_for_every_setting():
    page = (Path(__file__).resolve().parents[2] / "docs" / "service.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in page.split("## Output lines")[0].splitlines() if line.startswith("| `")]
    told = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    of_arms = {field.name for field in dataclasses.fields(ArmSettings)}
    of_the_service = {field.name for field in dataclasses.fields(ServiceSettings)} - {"arms", "token", "duration"}
    assert told == of_arms | of_the_service | {"token_file"}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("rating = 2.5", "ratting = 2.5"), "unknown setting 'ratting'"),
        (("every = 0.5", "[arms.left]"), r"unknown setting 'arms': .*; settings of an arm below \[\[arm\]\]"),
        (("rating = 2.5", 'rating = "2.5"'), 'rating is "2.5": expected a number'),
        (("rating = 2.5", 'record = "/dev/full"'), "ends in .csv or .mcap"),
        (("every = 0.5", "every = true"), "every is true: expected a number"),
        (("port = 0", 'port = "80"'), 'port is "80": expected a whole number'),
        (('mass = "1.200±0.002"', 'mass = "1.2"'), "'1.2' is not a weighed mass"),
        (('mass = "1.200±0.002"', 'com = "0,0±0.002"'), "is not a centre of mass"),
        (("steady = true", 'steady = "yes"'), 'steady is "yes": expected true or false'),
        (("steady = true", "port = 8090"), "port is of the service: write it above the first"),
        (("every = 0.5", "every = nan"), "every is nan: expected a time above 0 s"),
        (("every = 0.5", "every = -1.0"), "every is -1.0: expected a time above 0 s"),
        (("port = 0", "port = 70000"), "port is 70000: expected a port from 0 to 65535"),
        (("rating = 2.5", "rating = nan"), "rating is nan: expected a mass above 0 kg"),
        (("steady = true", "steady = true\nrate = -5"), "rate is -5: expected a rate above 0 Hz"),
        (("gravity = [0, 0, -9.8]", 'gravity = ["x", 0, 0]'), "expected three numbers"),
        (("gravity = [0, 0, -9.8]", "gravity = [nan, 0, 0]"), "expected three numbers"),
        (('name = "right"', 'name = "left"'), "two arms are called 'left'"),
        (('name = "right"', 'name = "../right"'), "letters, digits"),
        (('name = "right"', f'name = "{"r" * 101}"'), "at most 100 letters"),
        (("every = 0.5", "every = 1e-9"), "every is 1e-09 s: expected at least 0.02 s"),
        (('robot = "panda"\n', ""), "there is no robot"),
        (("[[arm]]", "[arm]"), "cannot|no TOML|list of tables"),
        (("gravity = [0, 0, -9.8]", "gravity = [0, 0]"), "expected three"),
        (("https://", "mqtt://"), "the webhook is 'mqtt://cell.example/alarms': expected an address"),
        (("https://cell.example/alarms", ""), "the webhook is '': expected an address"),
        (("cell.example", "cell.example:99999"), "99999/alarms': expected .* a port from 1 to 65535"),
        (("cell.example", "cell.example:0"), "0/alarms': expected .* a port from 1 to 65535"),
        (("cell.example/alarms", "cell.example/all alarms"), "without blanks"),
        (("cell.example", "me:secret@cell.example"), "with a user in it: give a header Authorization"),
        (("Bearer abc", "Bearer abc\\n"), "header Authorization has a line break"),
        (("Authorization =", '"Auth orization" ='), "a header 'Auth orization': expected a name"),
        (('"Bearer abc"', "3"), "header Authorization is a int: expected a text"),
        (("every = 0.5", 'every = 0.5\nmqtt = "mqtt://a b/x"'), "the MQTT broker is 'mqtt://a b/x': expected"),
        (('webhook = "https://cell.example/alarms"', ""), "headers are sent to the webhook, but there is none"),
        (("port = 0", 'host = "127.0.0.1"'), "host is of the endpoint, but there is none: give a port"),
        (("port = 0", 'token_file = "long"'), "token_file is of the endpoint, but there is none"),
        (("steady = true", 'mounted = "nothing"'), "right: mounted says .* nothing is told to it: give apply"),
        (("steady = true", "loop = true"), "right: loop replays a log .* the source is sim"),
        (('tare = "empty.csv"', 'tare = "empty.csv"\nloop = true'), "left: loop replays a log"),
        (('tare = "empty.csv"', 'tare = "empty.csv"\nrate = 100'), "left: rate is of the simulator"),
        (("every = 0.5", 'every = 0.5\nhost = "0.0.0.0"'), "give it a token"),
        (("steady = true", 'steady = true\nprofile = "arm.profile"'), "leave one out"),
        (("every = 0.5", 'token_file = "short"'), "expected 16 or more"),
        (("every = 0.5", 'token = ""'), "unknown setting 'token': .*token_file"),  # whose length nobody would look at
        (('tare = "empty.csv"', 'tare = "empty.csv"\ntool = "franka-hand"'), "give the tool, or the tare"),
        (('"3d"', "-3.0"), "expected a time of 0 or more"),
        (('"3d"', '"old"'), "tare_age: 'old' is not a time"),
        (('tare = "empty.csv"', ""), "there is no tare"),
    ],
)
def test_what_cannot_be_meant_is_one_sentence(tmp_path, capsys, change, said):
    (tmp_path / "short").write_text("secret")
    (tmp_path / "long").write_text("sixteen or more characters")
    (tmp_path / "cell.toml").write_text(CELL.replace(*change))
    with pytest.raises(UsageError, match=said):
        read_settings(tmp_path / "cell.toml")
    assert main(["serve", str(tmp_path / "cell.toml")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1


def rows_of(head):
    """The first cells, in their order, of the table of docs/service.md whose first heading is `head`."""
    page = (Path(__file__).resolve().parents[2] / "docs" / "service.md").read_text(encoding="utf-8")
    below = page.split(f"| `{head}` | when |\n")[1].split("\n\n")[0].splitlines()
    return [row.split("`")[1] for row in below if row.startswith("| `")]


def test_the_page_has_a_row_for_every_reason_in_the_order_they_are_given_and_for_every_alarm():
    assert rows_of("unknown") == [reason.value for reason in Unknown]
    assert rows_of("alarm") == list(_CONDITIONS)


@pytest.mark.parametrize("of", ["tare", "body"])
def test_a_state_belongs_to_the_settings_it_was_made_with(of, tmp_path):
    (tmp_path / "file").write_text("1")
    settings = ArmSettings("panda", name="left", source="sim", save=str(tmp_path), **{of: str(tmp_path / "file")})
    first = settings.state
    assert settings.state == first
    (tmp_path / "file").write_text("2")
    assert settings.state != first
    assert ArmSettings("panda", name="left", source="sim", save=str(tmp_path), rate=1000.0).state == (
        ArmSettings("panda", name="left", source="sim", save=str(tmp_path)).state
    )
    assert ArmSettings("panda", name="left", source="sim", save=str(tmp_path), rating=2.0).state == (
        ArmSettings("panda", name="left", source="sim", save=str(tmp_path), rating=3.0).state
    )


def test_a_state_goes_on_where_a_version_knows_more_settings_and_they_are_not_given():
    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Later(ArmSettings):
        colour: str = "none"

    now = ArmSettings("panda", name="left", source="sim", save="kept")
    assert now.state.name == "left-e55ab740.npz"  # as the versions before have written it
    for given in ({"steady": True}, {"mass": "1.2±0.1"}, {"family": "wide"}, {"tare": "e.csv", "tare_age": 0.0}):
        state = ArmSettings("panda", name="left", source="sim", save="kept", **given).state
        assert state != now.state
        assert Later("panda", name="left", source="sim", save="kept", **given).state == state
    assert Later("panda", name="left", source="sim", save="kept").state == now.state
    assert Later("panda", name="left", source="sim", save="kept", colour="red").state != now.state


@pytest.mark.parametrize("key", sorted(OF_THE_SERVICE))
def test_a_setting_of_the_service_below_an_arm_is_told_where_it_belongs(key, tmp_path):
    (tmp_path / "cell.toml").write_text(f'[[arm]]\nname = "left"\nsource = "sim"\nrobot = "panda"\n{key} = 1\n')
    says = "unknown setting" if key == "duration" else f"{key} is of the service"  # --duration is no setting of a file
    with pytest.raises(UsageError, match=says):
        read_settings(tmp_path / "cell.toml")


def test_a_state_belongs_to_the_folder_of_its_tare_as_it_was(tmp_path):
    bag = tmp_path / "empty_bag"
    (bag / "parts").mkdir(parents=True)
    (bag / "parts" / "empty_0.mcap").write_text("1")
    settings = ArmSettings("panda", name="left", source="sim", save=str(tmp_path), tare=str(bag))
    first = settings.state
    assert settings.state == first
    (bag / "parts" / "empty_0.mcap").write_text("2")
    second = settings.state
    assert second != first
    (bag / "parts" / "empty_0.mcap").rename(bag / "parts" / "empty_1.mcap")
    assert settings.state not in (first, second)


def test_a_file_that_may_not_be_read_is_named_with_its_setting(tmp_path, monkeypatch):
    path = tmp_path / "arm.profile"
    path.write_text("kept for others")

    def denied(*_):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(type(path), "open", denied)
    settings = ArmSettings("panda", name="left", source="sim", save=str(tmp_path), profile=str(path))
    with pytest.raises(UsageError, match=r"^profile: .*arm\.profile cannot be read: Permission denied$"):
        _ = settings.state


def test_a_service_without_arms_is_refused():
    with pytest.raises(UsageError, match="no arm"):
        ServiceSettings(())


def test_two_arms_are_not_recorded_in_one_file():
    arms = [ArmSettings(name=name, source="sim", robot="panda", record="run.csv") for name in ("left", "right")]
    with pytest.raises(UsageError, match=r"two arms are recorded in run\.csv"):
        ServiceSettings(tuple(arms))


@pytest.mark.parametrize(
    ("name", "said"),
    [("token", "the token's file .*token' is no text"), ("to\0ken", "is no text"), ("gone", "cannot be read: No such")],
)
def test_a_token_that_is_no_text_is_one_sentence(tmp_path, name, said):
    (tmp_path / "token").write_bytes(b"\xff" * 32)
    with pytest.raises(UsageError, match=said):
        read_token(tmp_path / name)


def test_a_text_may_begin_with_the_mark_that_some_editors_put_there(tmp_path):
    for name, text in (("cell.toml", CELL), ("token", "0123456789abcdef\n")):
        (tmp_path / name).write_text(text, encoding="utf-8-sig")
    assert read_settings(tmp_path / "cell.toml").every == 0.5
    assert read_token(tmp_path / "token") == "0123456789abcdef"


def test_a_setting_with_a_zero_byte_is_one_sentence(tmp_path):
    (tmp_path / "cell.toml").write_text(CELL.replace('save = "state"', 'save = "st\\u0000ate"'))
    with pytest.raises(UsageError, match=r"save is .* expected a text without a zero byte"):
        read_settings(tmp_path / "cell.toml")


def test_a_file_nested_deeper_than_anybody_reads_is_one_sentence(tmp_path):
    (tmp_path / "cell.toml").write_text("a = " + "[" * 10_000)
    with pytest.raises(UsageError, match=r"cell\.toml is no TOML"):
        read_settings(tmp_path / "cell.toml")
    with pytest.raises(RecordingError, match=r"cell\.toml is not TOML"):
        ColumnSpec.of(tmp_path / "cell.toml")
