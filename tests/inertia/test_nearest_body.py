"""The nearest body: held against an independent solver, closed forms and the conditions of the optimum."""

import clarabel
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import sparse

from armload.errors import InertiaError
from armload.inertia import (
    is_consistent,
    near_consistent,
    nearest_body,
    nearest_consistent,
    pseudo_inertia,
    pseudo_inertia_to_phi,
)
from armload.inertia.cholesky import root
from armload.inertia.orthogonal import eigen, least_squares, reflect, singular

UNITS = np.array([1.0] + [0.1] * 3 + [0.01] * 6)  # of lengths in units of 0.1 m
LENGTHS = np.diag([10.0, 10.0, 10.0, 1.0])
BALL = np.array([1.0, 0, 0, 0, 2.0, 0, 0, 2.0, 0, 2.0]) * UNITS  # whose J is the unit matrix
MARGIN = 1e-6
ENTRIES = tuple((i, j) for j in range(4) for i in range(j + 1))  # Clarabel's order


def scaled_J(phi):
    return LENGTHS @ pseudo_inertia(phi) @ LENGTHS


def svec(J):
    return np.array([J[i, j] * (1.0 if i == j else np.sqrt(2.0)) for i, j in ENTRIES])


TO_SVEC = np.array([svec(scaled_J(e * UNITS)) for e in np.eye(10)]).T


def smallest(phi):
    return np.linalg.eigvalsh(scaled_J(phi))[0]


def clarabels(phi, root_, margin=MARGIN):
    """The same program by an interior-point method of other people's, run as far as it goes; pushed into the cone."""
    target, P = phi / UNITS, root_.T @ root_
    size = np.abs(target).max() + margin
    options = clarabel.DefaultSettings()
    options.verbose, options.max_iter = False, 500
    options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = 1e-12
    found = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(P / np.abs(P).max())),
        np.zeros(10),
        sparse.csc_matrix(-TO_SVEC),
        (TO_SVEC @ target - margin * svec(np.eye(4))) / size,
        [clarabel.PSDTriangleConeT(4)],
        options,
    ).solve()
    x = (target + size * np.array(found.x)) * UNITS
    return x + max(0.0, margin - smallest(x)) * BALL


def a_metric(kind, rng):
    """A root R (·, 10) of a metric RᵀR of parameters in UNITS."""
    if kind == "units":
        return np.eye(10)
    if kind == "axes":
        return np.diag(10.0 ** rng.uniform(-1, 1, 10))
    if kind == "correlated":
        return np.eye(10) + 0.3 * rng.normal(size=(10, 10))
    if kind == "random":
        return rng.normal(size=(10, 10))
    if kind == "units of 1e-3 to 1e3":
        return (np.eye(10) + 0.3 * rng.normal(size=(10, 10))) * 10.0 ** rng.uniform(-3, 3, 10)
    if kind.startswith("condition"):
        worst = float(kind.split()[1])
        turned = np.linalg.qr(rng.normal(size=(10, 10)))[0]
        return np.sqrt(worst ** -np.concatenate([[0, 1], rng.uniform(0, 1, 8)]))[:, None] * turned
    known = rng.integers(1, 9)
    if kind == "null directions":
        return rng.normal(size=(known, 10))
    return np.diag(10.0 ** rng.uniform(-1, 1, 10))[rng.permutation(10)[:known]]


def some_masses(rng):
    """phi of one to five points: with fewer than four, on the border of the cone."""
    n = rng.integers(1, 6)
    points = np.column_stack([0.1 * rng.uniform(0.2, 3) * rng.normal(size=(n, 3)), np.ones(n)])
    return pseudo_inertia_to_phi(points.T @ (rng.uniform(0.05, 2, n)[:, None] * points))


def off_the_cone(where, rng):
    body = some_masses(rng)
    if where == "near":
        return body + 10.0 ** rng.uniform(-5, -1) * UNITS * rng.normal(size=10)
    if where == "noisy":
        return body + 0.3 * UNITS * rng.normal(size=10)
    return -body if where == "negative" else 10.0 ** rng.uniform(0, 4) * UNITS * rng.normal(size=10)


KINDS = ["units", "axes", "correlated", "random", "units of 1e-3 to 1e3", "condition 1e4", "condition 1e8"]
KINDS += ["condition 1e12", "null directions", "null axes"]
PLACES = ["near", "noisy", "far", "negative"]


@pytest.mark.parametrize("kind", KINDS)
def test_no_other_solver_finds_a_nearer_body(kind):
    met = 0
    for k in range(80):
        rng = np.random.default_rng([KINDS.index(kind), k])
        phi, R = off_the_cone(PLACES[k % 4], rng), a_metric(kind, rng)
        if smallest(phi) >= MARGIN:
            np.testing.assert_array_equal(nearest_consistent(phi), phi)
            continue
        met += 1
        x = nearest_consistent(phi, (R.T @ R) / np.outer(UNITS, UNITS))
        size = np.abs(phi / UNITS).max()
        assert smallest(x) >= MARGIN - 1e-12 * max(size, np.abs(x / UNITS).max())
        away, other = (x - phi) / UNITS, (clarabels(phi, R) - phi) / UNITS
        # rounding: of x, which is as large as phi, and of a metric, of which 1e-13 of the largest counts as nothing
        rounding = 2e-15 * size * np.abs(R.T @ (R @ away)).sum()
        nothing = 1e-12 * (R**2).sum() * min(away @ away, other @ other) if kind.startswith("null") else 0.0
        assert np.sum((R @ away) ** 2) <= (1 + 1e-9) * np.sum((R @ other) ** 2) + rounding + nothing
    assert met >= 50


@pytest.mark.parametrize("kind", ["null directions", "null axes"])
def test_what_the_metric_does_not_know_stays_near(kind):
    """Clarabel knows of nothing that would keep it; the nearest of all that are equally near is not far away."""
    for k in range(40):
        rng = np.random.default_rng([77, k])
        phi, R = some_masses(rng) + 0.3 * UNITS * rng.normal(size=10), a_metric(kind, rng)
        x = nearest_consistent(phi, (R.T @ R) / np.outer(UNITS, UNITS))
        whole = nearest_consistent(phi)
        assert np.linalg.norm((x - phi) / UNITS) <= 100.0 * np.linalg.norm((whole - phi) / UNITS) + 1e-12


def test_in_the_metric_of_J_itself_negative_eigenvalues_become_the_margin():
    for k in range(100):
        rng = np.random.default_rng([5, k])
        phi = off_the_cone(PLACES[k % 4], rng)
        values, vectors = np.linalg.eigh(scaled_J(phi))
        J = (vectors * np.maximum(values, MARGIN)) @ vectors.T
        clipped = pseudo_inertia_to_phi(np.linalg.inv(LENGTHS) @ J @ np.linalg.inv(LENGTHS))
        x = nearest_consistent(phi, TO_SVEC.T @ TO_SVEC / np.outer(UNITS, UNITS), MARGIN)
        if values[0] < MARGIN:
            error = np.linalg.norm((x - clipped) / UNITS)
            # a squared distance exact to 1e-12 is a distance from the optimum exact to 1e-6 of the way, at worst
            assert error <= 1e-6 * np.linalg.norm((clipped - phi) / UNITS) + 1e-14 * np.abs(phi / UNITS).max()


@pytest.mark.parametrize("points", [1, 2, 3])
def test_a_point_a_rod_and_a_plate_are_reached_from_where_they_are_nearest(points):
    """phi = body − Z/Λ with Z ⪰ 0 and Z·J(body) = 0: the body is the nearest then, and on the border."""
    for k in range(20):
        rng = np.random.default_rng([points, k])
        corners = np.column_stack([rng.normal(size=(points, 3)), np.ones(points)])
        J = corners.T @ (rng.uniform(0.1, 2, points)[:, None] * corners)
        outside = np.linalg.eigh(J)[1][:, : 4 - points]
        Z = (outside * rng.uniform(0.1, 1.0, 4 - points)) @ outside.T
        body = np.linalg.solve(TO_SVEC, svec(J + MARGIN * np.eye(4)))
        R = a_metric("units of 1e-3 to 1e3" if k % 2 else "correlated", rng)
        R /= np.sqrt(np.linalg.eigvalsh(R.T @ R)[0])
        phi = body - np.linalg.solve(R.T @ R, TO_SVEC.T @ svec(Z))
        x = nearest_consistent(phi * UNITS, R.T @ R / np.outer(UNITS, UNITS), MARGIN) / UNITS
        size = max(np.abs(body).max(), np.abs(phi).max())
        # of a metric of condition 1e12, rounding alone changes what weighs least by 1e-4
        assert np.linalg.norm(R @ (x - body)) <= 1e-5 * np.linalg.norm(R @ (phi - body))
        if k % 2 == 0:
            assert np.abs(x - body).max() <= 1e-8 * size
        assert np.all(np.linalg.eigvalsh(scaled_J(x * UNITS))[: 4 - points] <= MARGIN + 1e-8 * size)


finite = st.floats(-1.0, 1.0)


@settings(max_examples=100, deadline=None)
@given(
    st.lists(finite, min_size=10, max_size=10),
    st.lists(st.floats(-3.0, 3.0), min_size=10, max_size=10),
    st.integers(0, 2**32 - 1),
    st.floats(-3.0, 3.0),
)
@example([0.0] * 6 + [1.0, 0.0, 0.0, 1.0], [-1.0] + [0.0] * 3 + [1.0] + [0.0] * 4 + [3.0], 0, 0.0)
def test_the_answer_fulfils_the_conditions_of_the_optimum(numbers, decades, seed, size):
    """J(x) ⪰ margin, and any way into the cone leads away: the gradient is a Z ⪰ 0 with tr(Z·(J − margin)) = 0."""
    phi = 10.0**size * np.array(numbers)
    R = (np.eye(10) + 0.3 * np.random.default_rng(seed).normal(size=(10, 10))) * 10.0 ** np.array(decades)
    x = nearest_consistent(phi * UNITS, R.T @ R / np.outer(UNITS, UNITS)) / UNITS
    if smallest(phi * UNITS) >= MARGIN:
        np.testing.assert_allclose(x, phi, rtol=1e-15)
        return
    scale = max(np.abs(phi).max(), MARGIN)
    z = np.linalg.solve(TO_SVEC.T, R.T @ (R @ (x - phi)))
    Z = np.zeros((4, 4))
    for (i, j), entry in zip(ENTRIES, z, strict=True):
        Z[i, j] = Z[j, i] = entry / (1.0 if i == j else np.sqrt(2.0))
    cost = np.sum((R @ (x - phi)) ** 2)
    rounding = (
        1e-15 * max(scale, np.abs(x).max()) * np.abs(np.linalg.solve(TO_SVEC.T, R.T @ R)).max()
    )  # of Z, by that of x
    J = scaled_J(x * UNITS) - MARGIN * np.eye(4)
    most = 1e-9 * cost + 100 * rounding * np.abs(J).max() + 1e-13 * np.abs(Z).max() * scale
    # the cost can fall along J by tr(Z·J)² / 2|R·x(J)|², of which 1e-12 of it may be left (`_CLOSE`)
    most += np.sqrt(2e-12 * cost) * np.linalg.norm(R @ np.linalg.solve(TO_SVEC, svec(J)))
    assert abs(np.sum(Z * J)) <= most
    # the cost can fall along v·vᵀ by (vᵀ·Z·v)² / 2|R·x(v·vᵀ)|², where vᵀ·Z·v < 0
    value, v = (part[..., 0] for part in np.linalg.eigh(Z))
    along = R @ np.linalg.solve(TO_SVEC, svec(np.outer(v, v)))
    assert min(value, 0.0) ** 2 <= 2e-9 * cost * (along @ along) + (30 * rounding) ** 2
    assert smallest(x * UNITS) >= MARGIN - 1e-12 * max(1.0, scale, np.abs(x).max())


@settings(max_examples=30, deadline=None)
@given(st.floats(-20.0, 20.0), st.integers(0, 1000))
def test_the_unit_of_the_cost_does_not_matter(decade, seed):
    rng = np.random.default_rng(seed)
    phi, R = off_the_cone("noisy", rng), a_metric("correlated", rng)
    Lambda = R.T @ R / np.outer(UNITS, UNITS)
    one, other = nearest_consistent(phi, Lambda), nearest_consistent(phi, 10.0**decade * Lambda)
    np.testing.assert_allclose(one / UNITS, other / UNITS, atol=1e-6 * np.linalg.norm((one - phi) / UNITS) + 1e-14)


@pytest.mark.parametrize("kind", KINDS[:8])
def test_a_live_answer_is_a_body_as_near_as_promised(kind):
    for k in range(40):
        rng = np.random.default_rng([9, k])
        phi, R = off_the_cone(PLACES[k % 4], rng), 10.0 ** rng.uniform(-1, 2) * a_metric(kind, rng)
        P = R.T @ R / np.outer(UNITS, UNITS)
        x = near_consistent(phi, P)
        assert is_consistent(x)
        if is_consistent(phi):
            np.testing.assert_array_equal(x, phi)
            continue
        squared, least = (np.sum((R @ ((y - phi) / UNITS)) ** 2) for y in (x, nearest_consistent(phi, P, 1e-5)))
        assert squared <= least * (1 + 1e-9) + 1e-3


def test_a_nearest_body_survives_being_printed():
    for k in range(40):
        rng = np.random.default_rng([3, k])
        phi, R = off_the_cone("noisy", rng), a_metric("correlated", rng)
        x = nearest_body(phi, np.linalg.inv(R.T @ R / np.outer(UNITS, UNITS)))
        assert is_consistent([float(f"{number:.8f}") for number in x])


@pytest.mark.parametrize(
    ("information", "says"),
    [
        (np.eye(9), r"has shape \(9, 9\)"),
        (np.diag([np.nan] + [1.0] * 9), "is not finite"),
        (np.diag([-1.0] + [1.0] * 9), "negative eigenvalue"),
        (np.eye(10) + 2.0 * (np.eye(10, k=1) + np.eye(10, k=-1)), "negative eigenvalue"),
    ],
)
@pytest.mark.parametrize("project", [nearest_consistent, near_consistent])
def test_what_is_no_information_is_said_in_a_sentence(project, information, says):
    with pytest.raises(InertiaError, match=says) as caught:
        project(-np.ones(10), information)
    assert "\n" not in str(caught.value)


# ---------------------------------------------------------------------- the factorisations below


@pytest.mark.parametrize("seed", range(10))
def test_rotations_and_reflections_agree_with_lapack(seed):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(4, 4)) * 10.0 ** rng.uniform(-4, 4, 4)
    S, V = A @ A.T, np.empty((4, 4))
    left = S.copy()
    eigen(left, V, True)
    np.testing.assert_allclose((V * np.diag(left)) @ V.T, S, atol=1e-14 * np.abs(S).max())
    np.testing.assert_allclose(V.T @ V, np.eye(4), atol=1e-14)
    AV, unit = A.copy(), np.eye(4)
    singular(AV, unit)
    np.testing.assert_allclose(AV, A @ unit, atol=1e-13 * np.abs(A).max())
    np.testing.assert_allclose(sorted(np.linalg.norm(AV, axis=0)), sorted(np.linalg.svd(A)[1]), rtol=1e-10)
    stack, b = np.vstack([rng.normal(size=(10, 10)), np.eye(10)]), rng.normal(size=20)
    expected = np.linalg.lstsq(stack, b, rcond=None)[0]
    diagonal, x = np.empty(10), np.empty(10)
    reflect(stack, diagonal)
    least_squares(stack, diagonal, b.copy(), x)
    np.testing.assert_allclose(x, expected, atol=1e-13)


@pytest.mark.parametrize("rank", [1, 4, 9, 10])
def test_the_root_of_a_metric_is_its_root_whatever_its_rank(rank):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        R = rng.choice([-1.0, 1.0], (rank, 10)) * rng.uniform(0.3, 3.0, (rank, 10)) * 10.0 ** rng.uniform(-3, 3, 10)
        A, F, order = R.T @ R, np.empty((10, 10)), np.empty(10, np.int64)
        left = root(A, F, order, 1e-13)
        unit = np.sqrt(np.diag(A))
        assert left < 1e-11
        np.testing.assert_allclose(F.T @ F / np.outer(unit, unit), A / np.outer(unit, unit), atol=1e-12)
        np.testing.assert_array_equal(np.tril(F[:, order], -1), 0.0)
        assert np.all(np.diag(F[:, order]) > 0)
