"""Ten thousand headers as no tool would have them: each is read as it was meant, or refused; never otherwise.

Every header is drawn with its truth: names of position, velocity and torque from the same pool as the decoys, so that
any preference among names would be found out, beside columns that such logs hold, in any order.
"""

import random

import numpy as np
import pytest

from armload.arms import arm
from armload.errors import RecordingError
from armload.recording import read_recording
from armload.recording.mapping import map_columns

HEADERS, FILES = 10_000, 150
ARMS = [arm("panda"), arm("ur10e")]
INDEXED = {
    "q": (
        *("q{}", "q_{}", "q[{}]", "Q{}", "pos_{}", "position_{}", "position[{}]", "joint_{}_pos", "joint_position_{}"),
        *("jointPosition{}", "field.position{}", "state.q[{}]", "actual_q_{}", "/joint_states/position[{}]", "qpos_{}"),
        *("observation.state[{}]", "angle{}", "q_meas_{}", "q{} [rad]", "q_rad_{}", "/arm/joint_states.position[{}]"),
    ),
    "dq": (
        *("dq{}", "dq_{}", "dq[{}]", "DQ{}", "vel_{}", "velocity_{}", "velocity[{}]", "joint_{}_vel", "qd_{}"),
        *(
            "jointVelocity{}",
            "field.velocity{}",
            "state.dq[{}]",
            "actual_qd_{}",
            "/joint_states/velocity[{}]",
            "qdot{}",
        ),
        *("observation.velocity[{}]", "q_dot_{}", "dq_meas_{}", "dq{} (rad/s)", "/arm/joint_states.velocity[{}]"),
    ),
    "tau": (
        *("tau{}", "tau_{}", "tau[{}]", "TAU{}", "effort_{}", "torque_{}", "effort[{}]", "joint_{}_effort", "trq_{}"),
        *("jointTorque{}", "field.effort{}", "state.tau_J[{}]", "tau_J{}", "/joint_states/effort[{}]", "torques[{}]"),
        *("observation.effort[{}]", "tau_meas_{}", "tau{} [Nm]", "joint_torque_{}", "/arm/joint_states.effort[{}]"),
    ),
}
NAMED = {
    "q": ("{}_position", "/joint_states/{}/position", "{}.pos", "position_{}", "/arm/joint_states/{}/position"),
    "dq": ("{}_velocity", "/joint_states/{}/velocity", "{}.vel", "velocity_{}", "/arm/joint_states/{}/velocity"),
    "tau": ("{}_effort", "/joint_states/{}/effort", "{}.torque", "effort_{}", "/arm/joint_states/{}/effort"),
}
TIMES = ("t", "time", "T", "timestamp", "time_s", "t [s]", "header.stamp", "elapsed_time", "__time", "stamp")
# columns of the same logs that are none of the three, and must never be taken for one
OTHERS = (
    *("q_d{}", "q_d[{}]", "target_q_{}", "state.q_d[{}]", "cmd.q_d[{}]", "q_des_{}", "theta{}", "ddq{}", "ddq_d[{}]"),
    *("dq_d[{}]", "target_qd_{}", "qdd_{}", "acc_{}", "tau_ext_hat_filtered[{}]", "tau_ext_{}", "tau_f{}", "tau_g_{}"),
    *("temperature_{}", "joint_temperatures_{}", "O_T_EE[{}]", "tcp_position_{}", "actual_TCP_pose_{}", "qD{}"),
    *("actual_TCP_speed_{}", "gripper_position_{}", "target_current_{}", "actual_joint_voltage_{}", "action[{}]"),
    *("motor_position_{}", "left_gripper/position{}", "dtau_J{}", "std_q{}", "q_lower_{}", "tau_max_{}", "K_F_ext_{}"),
)
RIVALS = (
    *("tau_J_d{}", "tau_d_{}", "target_moment_{}", "torque_cmd_{}", "actual_current_{}"),
    "/joint_states_desired/effort[{}]",
)
SINGLE = (
    *("", "success_rate", "frame_id", "payload", "robot_mode", "index", "field.header.seq", "speed_scaling"),
    "Unnamed: 0",
)


def family(rng, quantity, robot, base, named):
    """Names of one quantity for each joint."""
    if named:
        pattern = rng.choice(NAMED[quantity])
        return [pattern.format(joint) for joint in robot.joint_names]
    pattern = rng.choice(INDEXED[quantity])
    return [pattern.format(k + base) for k in range(robot.n)]


def draw(rng):
    """An arm, a header in any order, and the true places of time, position, velocity and torque."""
    robot = rng.choice(ARMS)
    base, named = rng.randint(0, 1), rng.random() < 0.3
    truth = {"t": [rng.choice(TIMES)]}
    for quantity in ("q", "dq", "tau"):
        mixed = rng.random() < 0.04
        truth[quantity] = family(rng, quantity, robot, 1 - base if mixed else base, named)
    columns = [(name, (quantity, k)) for quantity, names in truth.items() for k, name in enumerate(names)]
    for pattern in rng.sample(OTHERS, rng.randint(0, 4)):
        count = rng.choice([1, 2, robot.n, robot.n, robot.n + 2])
        columns += [(pattern.format(k + rng.randint(0, 1)), None) for k in range(count)]
    columns += [(name, None) for name in rng.sample(SINGLE, rng.randint(0, 3))]
    hazard = rng.random()
    if hazard < 0.15:  # another full set under another name, measured by something else
        quantity = rng.choice(["q", "dq", "tau"])
        columns += [(name, None) for name in family(rng, quantity, robot, rng.randint(0, 1), rng.random() < 0.3)]
    elif hazard < 0.22:
        columns += [(name.format(k), None) for name in [rng.choice(RIVALS)] for k in range(robot.n)]
    elif hazard < 0.27:  # a set of another device, of three or nine
        pattern = rng.choice(INDEXED[rng.choice(["q", "dq", "tau"])])
        columns += [(pattern.format(k), None) for k in range(rng.choice([3, 9]))]
    elif hazard < 0.30:
        columns.append((rng.choice(TIMES), None))
    elif hazard < 0.34:
        lost = rng.randrange(len(columns))
        columns = [column for k, column in enumerate(columns) if k != lost]
    elif hazard < 0.37:
        columns.append((rng.choice(columns)[0], None))
    if rng.random() < 0.7:
        rng.shuffle(columns)
    names = [name for name, _ in columns]
    places = {quantity: [None] * len(of) for quantity, of in truth.items()}
    for place, (_, role) in enumerate(columns):
        if role is not None:
            places[role[0]][role[1]] = place
    return robot, names, places, hazard


def test_a_header_is_read_as_it_was_meant_or_refused():
    rng = random.Random(2024)
    read = plain = refused_plain = 0
    refusals = []
    for _ in range(HEADERS):
        robot, names, truth, hazard = draw(rng)
        plain += hazard >= 0.37
        try:
            found = map_columns(names, "log", robot)
        except RecordingError as error:
            refusals.append(str(error))
            refused_plain += hazard >= 0.37
            continue
        read += 1
        assert found.places == {key: truth[key] for key in ("q", "dq", "tau")}, names
        assert found.time is not None
        assert [found.time.place] == truth["t"], names
        assert found.time.unit in (None, "s"), names
        assert found.scales["q"] == (1.0,) * robot.n
    assert not any("\n" in refusal for refusal in refusals)
    assert read > 0.55 * HEADERS
    assert refused_plain < 0.1 * plain  # from 0 and from 1 in one header, decoys with the index of a joint


@pytest.mark.parametrize("seed", range(5))
def test_a_whole_file_gives_the_numbers_that_were_meant_or_is_refused(tmp_path, seed):
    rng, numbers = random.Random(seed), np.random.default_rng(seed)
    read, refusals = 0, []
    for k in range(FILES // 5):
        robot, names, truth, _ = draw(rng)
        values = numbers.normal(size=(6, len(names)))
        if truth["t"][0] is not None:
            values[:, truth["t"][0]] = np.arange(6) / 1000
        path = tmp_path / f"{k}.csv"
        path.write_text(text(rng, names, values), encoding="utf-8")
        try:
            found = read_recording(path, robot)
        except RecordingError as error:
            refusals.append(str(error))
            continue
        read += 1
        np.testing.assert_allclose(found.t, np.arange(6) / 1000, rtol=0, atol=1e-9)
        for key in ("q", "dq", "tau"):
            np.testing.assert_allclose(getattr(found, key), values[:, truth[key]], rtol=0, atol=1e-9)
    assert not any("\n" in refusal for refusal in refusals)
    assert read > 0.4 * FILES / 5


def text(rng, names, values):
    """A header and rows with one of the separators, as some program would write them."""
    separator = rng.choice([",", ";", "\t"])
    comma = separator != "," and rng.random() < 0.5
    quote = rng.random() < 0.3
    header = separator.join(f'"{name}"' if quote else name for name in names)
    rows = [separator.join(map(repr, row)) for row in values.tolist()]
    lines = [header, *(row.replace(".", ",") if comma else row for row in rows)]
    head = rng.choice(["", "\ufeff", "# made on Monday\n", "% made on Monday\n# at 1 kHz\n"])
    return head + rng.choice(["\n", "\r\n"]).join(lines) + rng.choice(["", "\n"])
