"""The built-in arms against their makers' figures: Denavit–Hartenberg parameters, centres of mass, the arm's mass."""

from pathlib import Path

import numpy as np
import pytest

from armload.arms import ARMS, arm

UR_TWIST = np.pi / 2 * np.array([1, 0, 0, 1, -1, 0])

# of the UR arms: d1, a2, a3, d4, d5, d6 [m] of the maker's article; how far our description may be off [m]
UR_DH = {
    "ur3e": ((0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921), 1e-12),
    "ur5": ((0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823), 1e-12),
    "ur5e": ((0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996), 1e-12),
    "ur10": ((0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922), 1e-12),
    "ur10e": ((0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655), 2e-3),
    "ur16e": ((0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655), 1e-12),
    "ur20": ((0.2363, -0.8620, -0.7287, 0.2010, 0.1593, 0.1543), 1e-12),
}

# masses [kg] and centres of mass [m] of the UR arms' links in those frames, from the same article
UR_LINKS = {
    "ur3e": (
        [1.98, 3.4445, 1.437, 0.871, 0.805, 0.261],
        [[0, -0.02, 0], [0.13, 0, 0.1157], [0.05, 0, 0.0238], [0, 0, 0.01], [0, 0, 0.01], [0, 0, -0.02]],
    ),
    "ur5": (
        [3.7, 8.393, 2.33, 1.219, 1.219, 0.1879],
        [
            [0, -0.02561, 0.00193],
            [0.2125, 0, 0.11336],
            [0.15, 0, 0.0265],
            [0, -0.0018, 0.01634],
            [0, 0.0018, 0.01634],
            [0, 0, -0.001159],
        ],
    ),
    "ur5e": (
        [3.761, 8.058, 2.846, 1.37, 1.3, 0.365],
        [
            [0, -0.02561, 0.00193],
            [0.2125, 0, 0.11336],
            [0.15, 0, 0.0265],
            [0, -0.0018, 0.01634],
            [0, 0.0018, 0.01634],
            [0, 0, -0.001159],
        ],
    ),
    "ur10": (
        [7.1, 12.7, 4.27, 2.0, 2.0, 0.365],
        [[0.021, 0, 0.027], [0.38, 0, 0.158], [0.24, 0, 0.068], [0, 0.007, 0.018], [0, 0.007, 0.018], [0, 0, -0.026]],
    ),
    "ur16e": (
        [7.369, 10.45, 4.321, 2.18, 2.033, 0.907],
        [[0, -0.016, 0.03], [0.302, 0, 0.16], [0.194, 0, 0.065], [0, -0.009, 0.011], [0, 0.018, 0.012], [0, 0, -0.044]],
    ),
    "ur20": (
        [16.343, 29.632, 7.879, 3.054, 3.126, 0.926],
        [
            [0, -0.061, 0.0062],
            [0.5226, 0, 0.2098],
            [0.3234, 0, 0.0604],
            [0, -0.0026, 0.0393],
            [0, 0.0024, 0.0379],
            [0, 0, -0.0293],
        ],
    ),
}

# of the arms with seven joints: twists [quarter turns], a [m], d [m], offsets of the angles [half turns], and how far
# off our description may be [m, 1]: the angles of some have as many digits as their source
SEVEN_DH = {
    # KUKA, specification of the LBR iiwa: 0.34 (0.36), 0.4 (0.42), 0.4 and 0.126 m between the joints' centres
    "iiwa7": ([-1, 1, 1, -1, -1, 1, 0], np.zeros(7), [0.34, 0, 0.4, 0, 0.4, 0, 0.126], np.zeros(7), 1e-12),
    "iiwa14": ([-1, 1, 1, -1, -1, 1, 0], np.zeros(7), [0.36, 0, 0.42, 0, 0.4, 0, 0.126], np.zeros(7), 1e-12),
    # Kinova, user guide of the Gen3, classical parameters to 0.1 mm; its base frame is turned over
    "gen3": (
        [1, 1, 1, 1, 1, 1, 2],
        np.zeros(7),
        [-0.1564 - 0.1284, -0.0054 - 0.0064, -2 * 0.2104, -2 * 0.0064, -0.2084 - 0.1059, 0, -0.1059 - 0.0615],
        [0, 1, 1, 1, 1, 1, 1],
        5e-4,
    ),
    # UFACTORY, kinematic parameters of the xArm7
    "xarm7": (
        [-1, 1, 1, 1, 1, -1, 0],
        [0, 0, 0.0525, 0.0775, 0, 0.076, 0],
        [0.267, 0, 0.293, 0, 0.3425, 0, 0.097],
        np.zeros(7),
        3e-5,
    ),
}


FRANKAS = {"panda", "fr3"}  # whose flange is held against the maker's in test_arms.py


def test_every_arm_is_held_against_its_makers_figures():
    assert set(ARMS) == FRANKAS | {*UR_DH} | {*SEVEN_DH}


def dh_frames(base, q, d, a, twist):
    """The Denavit–Hartenberg frames 1 to n (n, 4, 4) in the base: Rz(q)·Tz(d)·Tx(a)·Rx(twist) each."""
    T, frames = base, []
    for angle, along, across, turn in zip(q, d, a, twist, strict=True):
        c, s, ct, st = np.cos(angle), np.sin(angle), np.cos(turn), np.sin(turn)
        T = T @ [[c, -s * ct, s * st, across * c], [s, c * ct, -c * st, across * s], [0, st, ct, along], [0, 0, 0, 1]]
        frames.append(T)
    return np.array(frames)


def ur_frames(figures, q):
    """Those of a UR arm in base_link, half a turn about z from the frame they start in."""
    d1, a2, a3, d4, d5, d6 = figures
    return dh_frames(np.diag([-1.0, -1.0, 1.0, 1.0]), q, [d1, 0, 0, d4, d5, d6], [0, a2, a3, 0, 0, 0], UR_TWIST)


def random_angles(n, count=20, seed=0):
    return np.random.default_rng(seed).uniform(-2, 2, (count, n))


@pytest.mark.parametrize("name", UR_DH)
def test_a_urs_flange_is_where_the_maker_says(name):
    figures, off = UR_DH[name]
    for q in random_angles(6):
        flange = ur_frames(figures, q)[-1]
        R, p = arm(name).frame_pose(q[None])
        np.testing.assert_allclose(p[0], flange[:3, 3], atol=off)
        np.testing.assert_allclose(R[0], flange[:3, :3], atol=1e-12)


@pytest.mark.parametrize("name", SEVEN_DH)
def test_the_flange_of_an_arm_with_seven_joints_is_where_the_maker_says(name):
    twist, a, d, offset, off = SEVEN_DH[name]
    base = np.diag([1.0, -1.0, -1.0, 1.0]) if name == "gen3" else np.eye(4)
    for q in random_angles(7):
        flange = dh_frames(base, q + np.pi * np.asarray(offset), d, a, np.pi / 2 * np.asarray(twist))[-1]
        R, p = arm(name).frame_pose(q[None])
        np.testing.assert_allclose(p[0], flange[:3, 3], atol=off)
        np.testing.assert_allclose(R[0], flange[:3, :3], atol=off)


@pytest.mark.parametrize("name", UR_LINKS)
def test_a_urs_gravity_torque_is_the_slope_of_its_potential_energy(name):
    masses, coms = map(np.array, UR_LINKS[name])

    def energy(q):
        T = ur_frames(UR_DH[name][0], q)
        return 9.81 * masses @ (np.einsum("kj,kj->k", T[:, 2, :3], coms) + T[:, 2, 3])

    h = 1e-5
    for q in random_angles(6, 5):
        slope = [(energy(q + h * e) - energy(q - h * e)) / (2 * h) for e in np.eye(6)]
        np.testing.assert_allclose(arm(name).torque(q), slope, atol=1e-6)


@pytest.mark.parametrize("name", ARMS)
def test_the_moving_links_weigh_what_the_whole_arm_does_less_a_base(name):
    weight = ARMS[name].weight
    assert weight is not None
    assert 0.75 < arm(name).link_parameters[:, 0].sum() / weight < 0.99


@pytest.mark.parametrize("name", ARMS)
def test_the_page_of_the_arms_says_what_their_sheets_say_and_the_readme_names_them(name):
    facts, robot = ARMS[name], arm(name)
    root = Path(__file__).resolve().parents[2]
    page = (root / "docs" / "arms.md").read_text(encoding="utf-8")
    assert f"`{name}`" in (root / "README.md").read_text(encoding="utf-8")
    row = [
        f"`{name}`",
        None,
        f"`{robot.joint_names[0]}` … `{robot.joint_names[-1]}`",
        f"`{facts.flange}`",
        f"{facts.rated_payload:g}",
        "joint torque sensors" if facts.torque_side == "link" else "motor currents",
        f"± {100.0 * facts.gain_std:g} %",
        f"{robot.link_parameters[:, 0].sum():.1f} of {facts.weight:g}",
    ]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("|")]
    found = [cells for cells in rows if cells[0] == row[0]]
    assert len(found) == 1
    assert [cell for cell in found[0][: len(row)] if cell != found[0][1]] == [cell for cell in row if cell is not None]
