# SPDX-License-Identifier: GPL-3.0-or-later
"""The directional reconstruction against the least-squares problem it solves, and its symmetries."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core.reconstruction import coefficients
from ivg_addon.core.settings import Directional

Float64 = NDArray[np.float64]

component = st.floats(-1, 1)
unit_vectors = (
    st.tuples(component, component, component)
    .map(np.array)
    .filter(lambda v: np.linalg.norm(v) > 1e-3)
    .map(lambda v: v / np.linalg.norm(v))
)
AXES = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float64)


def six_vectors(light: Float64) -> Float64:
    """Return I_δ (6, 3) of light of irradiance 1 from one direction; what is on a border belongs to one side."""
    positive = light > 0
    return np.stack([positive, ~positive], axis=1).reshape(6, 1) * light


def quadrature(order: int) -> tuple[Float64, Float64]:
    """Return directions (n, 3) and weights (n,) of Gauss's rule in the angles θ and φ of each octant."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    angle, weights = (nodes + 1) * math.pi / 4, weights * math.pi / 4
    theta, phi = (grid.ravel() for grid in np.meshgrid(angle, angle, indexing="ij"))
    octant = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    signs = np.array(list(itertools.product((1, -1), repeat=3)))
    directions = (signs[:, None, :] * octant).reshape(-1, 3)
    return directions, np.tile(np.outer(weights * np.sin(angle), weights).ravel(), 8)


def projection(normal: Float64, order: int) -> Float64:
    """Return W (3, 3) of the constrained least-squares problem, solved numerically.

    Minimise ∫ (|ω·n| − Σ W_kj sgn(ω_k) ω_j)² dω where the integral of the difference times ω_a ω_b is 0 for all a ≤ b.
    """
    directions, weights = quadrature(order)
    elements = (np.sign(directions)[:, :, None] * directions[:, None, :]).reshape(-1, 9)
    gram = elements.T @ (weights[:, None] * elements)
    cosine = weights * np.abs(directions @ normal)
    quadratic = np.stack([directions[:, a] * directions[:, b] for a in range(3) for b in range(a, 3)])
    constraint = quadratic @ (weights[:, None] * elements)
    system = np.block([[gram, constraint.T], [constraint, np.zeros((6, 6))]])
    return np.linalg.solve(system, np.append(elements.T @ cosine, quadratic @ cosine))[:9].reshape(3, 3)


@pytest.mark.parametrize("normal", [(1, 0, 0), (1, 1, 0), (1, -1, 1), (-0.2, 0.5, 0.9), (0.01, -0.7, 0.3)])
def test_least_squares_is_the_constrained_projection(normal: tuple[float, ...]) -> None:
    """To the accuracy of the quadrature, which its change from one resolution to the next tells."""
    n = np.array(normal) / np.linalg.norm(normal)
    coarse, fine = projection(n, 150), projection(n, 300)
    error = np.abs(fine - coarse).max()
    assert error < 1e-4
    c = coefficients(n, Directional.LEAST_SQUARES)
    # E = ½ F·n + ½ Σ W_kj D_kj with F the mean over k of I_{+k} + I_{−k}.
    w = c[0::2] - c[1::2]
    np.testing.assert_allclose(w, fine, atol=2 * error + 1e-9)
    np.testing.assert_allclose(c[0::2] + c[1::2], np.broadcast_to(n / 3, (3, 3)), atol=1e-12)


def test_quadrature_knows_the_gram_matrix() -> None:
    """4π/3 for an element with itself, 8/3 for D_kk with D_ll and D_kl with D_lk, else nothing."""
    directions, weights = quadrature(20)
    elements = (np.sign(directions)[:, :, None] * directions[:, None, :]).reshape(-1, 9)
    gram = (elements.T @ (weights[:, None] * elements)).reshape(3, 3, 3, 3)
    for k, j, m, i in itertools.product(range(3), repeat=4):
        expected = 0.0
        if (k, j) == (m, i):
            expected = 4 * math.pi / 3
        elif (k == j and m == i) or (k, j) == (i, m):
            expected = 8 / 3
        assert gram[k, j, m, i] == pytest.approx(expected, abs=1e-9)


@given(unit_vectors, st.sampled_from([each for each in itertools.product(range(4), repeat=3) if sum(each) <= 3]))
def test_least_squares_is_exact_up_to_degree_three(n: Float64, powers: tuple[int, int, int]) -> None:
    """For every polynomial of the direction as radiance, negative ones included: E is a linear functional of it.

    Monomials of an even degree above two are left to the projection.
    """
    directions, weights = quadrature(12)
    radiance = weights * np.prod(directions ** np.array(powers), axis=1)
    six = np.stack([(radiance[:, None] * directions)[directions @ axis > 0].sum(axis=0) for axis in AXES])
    e = (coefficients(n, Directional.LEAST_SQUARES) * six).sum()
    assert e == pytest.approx(closed_form(n, powers), abs=1e-9)


def closed_form(n: Float64, powers: tuple[int, int, int]) -> float:
    """Return ∫ max(0, ω·n) ω_x^x ω_y^y ω_z^z dω up to degree three.

    Half of ∫ |ω·n| … for even degrees, of ∫ ω·n … for odd ones.
    """
    axes = [axis for axis, power in enumerate(powers) for _ in range(power)]
    if len(axes) == 0:
        return math.pi
    if len(axes) == 1:
        return 2 * math.pi / 3 * float(n[axes[0]])
    if len(axes) == 2:
        a, b = axes
        return math.pi / 4 * float((a == b) + n[a] * n[b])
    a, b, c = axes
    # ∫ ω_a ω_b ω_c ω_d dω = 4π/15 (δ_ab δ_cd + δ_ac δ_bd + δ_ad δ_bc)
    return 2 * math.pi / 15 * float((a == b) * n[c] + (a == c) * n[b] + (b == c) * n[a])


@given(unit_vectors)
def test_least_squares_is_exact_in_a_uniform_field(n: Float64) -> None:
    """I_δ = π δ gives E = π."""
    assert (coefficients(n, Directional.LEAST_SQUARES) * AXES).sum() == pytest.approx(1.0, abs=1e-12)


@given(unit_vectors)
def test_report_falls_to_the_sum_of_cubes_in_a_uniform_field(n: Float64) -> None:
    assert (coefficients(n, Directional.REPORT) * AXES).sum() == pytest.approx((np.abs(n) ** 3).sum(), abs=1e-12)


@pytest.mark.parametrize("directional", Directional)
@pytest.mark.parametrize("axis", range(6))
@given(light=unit_vectors)
def test_both_are_exact_along_the_axes(directional: Directional, axis: int, light: Float64) -> None:
    n = AXES[axis]
    e = (coefficients(n, directional) * six_vectors(light)).sum()
    assert e == pytest.approx(max(0.0, light @ n), abs=1e-12)


@given(unit_vectors, unit_vectors)
def test_report_is_exact_for_one_light_that_all_three_hemispheres_see(n: Float64, light: Float64) -> None:
    light = np.where(np.sign(light) == np.sign(n), light, -light)
    light = np.where(light == 0, n, light)
    e = (coefficients(n, Directional.REPORT) * six_vectors(light)).sum()
    assert e == pytest.approx(light @ n, abs=1e-12)


@pytest.mark.parametrize("directional", Directional)
@given(n=unit_vectors, order=st.permutations(range(3)), signs=st.tuples(*[st.sampled_from([1, -1])] * 3))
def test_axes_may_be_permuted_and_reflected(
    directional: Directional, n: Float64, order: list[int], signs: tuple[int, ...]
) -> None:
    """Turning the normal and the six vectors alike changes nothing."""
    turn = np.eye(3)[order] * np.array(signs)
    # On the axes' planes it is a matter of definition which side a normal lies on.
    n = np.where(np.abs(n) < 1e-9, 1e-9, n)
    n /= np.linalg.norm(n)
    turned = coefficients(turn @ n, directional)
    expected = np.empty((6, 3))
    for direction, row in zip(AXES, coefficients(n, directional), strict=True):
        expected[(AXES @ (turn @ direction)).argmax()] = turn @ row
    np.testing.assert_allclose(turned, expected, atol=1e-9)
