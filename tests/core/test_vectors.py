# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames, directions and ray offsets."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core.compiled import kernel
from ivg_addon.core.embree import MISS, Tracer
from ivg_addon.core.vectors import (
    cosine_direction,
    offset_distance,
    orthonormal_basis,
    sine_and_cosine,
    sphere_direction,
)

from .rooms import Part, scene
from .z_tests import assert_counts

Float64 = NDArray[np.float64]

SAMPLES = 1 << 18

component = st.floats(-1, 1)
unit_vectors = (
    st.tuples(component, component, component)
    .map(np.array)
    .filter(lambda v: np.linalg.norm(v) > 1e-3)
    .map(lambda v: v / np.linalg.norm(v))
) | st.sampled_from(
    [np.array(v, dtype=float) for v in ((0, 0, 1), (0, 0, -1), (0, 0.6, -0.8), (1, 0, 0), (1, 0, -0.0))]
)


@kernel
def fill_basis(n, out):
    (out[0, 0], out[0, 1], out[0, 2], out[1, 0], out[1, 1], out[1, 2]) = orthonormal_basis(n[0], n[1], n[2])


@kernel
def fill_cosine(n, u, v, out):
    for row in range(len(u)):
        out[row, 0], out[row, 1], out[row, 2] = cosine_direction(n[0], n[1], n[2], u[row], v[row])


@kernel
def fill_sphere(u, v, out):
    for row in range(len(u)):
        out[row, 0], out[row, 1], out[row, 2] = sphere_direction(u[row], v[row])


@kernel
def fill_offset(points, extents, out):
    for row in range(len(points)):
        out[row] = offset_distance(points[row, 0], points[row, 1], points[row, 2], extents[row])


@kernel
def fill_sine_and_cosine(turns, out):
    for row in range(len(turns)):
        out[row, 0], out[row, 1] = sine_and_cosine(turns[row])


def uniform(count: int) -> tuple[Float64, Float64]:
    return tuple(np.random.default_rng(5).random((2, count)))  # type: ignore[return-value]


def turns(directions: Float64, n: Float64) -> Float64:
    """Return the directions' azimuth around n, 0 to 1, in a frame made without the code under test."""
    x = np.cross(n, np.eye(3)[np.abs(n).argmin()])
    x /= np.linalg.norm(x)
    return np.arctan2(directions @ np.cross(n, x), directions @ x) / (2 * math.pi) % 1.0


@given(unit_vectors)
def test_basis_is_orthonormal_and_right_handed(n: Float64) -> None:
    basis = np.empty((2, 3))
    fill_basis(n, basis)
    frame = np.vstack([basis, n])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(basis[0], basis[1]), n, atol=1e-12)


def test_sine_and_cosine() -> None:
    turns = np.concatenate([np.linspace(0, 1, 10_001), np.nextafter([0, 1, 0.125, 0.375, 0.875], [1, 0, 1, 1, 0])])
    out = np.empty((len(turns), 2))
    fill_sine_and_cosine(turns, out)
    expected = np.stack([np.sin(2 * np.pi * turns), np.cos(2 * np.pi * turns)], axis=1)
    np.testing.assert_allclose(out, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 0, -1), (1, 2, -2), (-3, 0.1, 0.01)])
def test_cosine_directions_have_density_cosine_over_pi(normal: tuple[float, float, float]) -> None:
    """Then cos²θ and the azimuth are uniform and independent."""
    n = np.array(normal) / np.linalg.norm(normal)
    directions = np.empty((SAMPLES, 3))
    fill_cosine(n, *uniform(SAMPLES), directions)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-12)
    cosine = directions @ n
    assert (cosine > 0.0).all()
    counts = np.histogram2d(cosine**2, turns(directions, n), bins=16, range=((0, 1), (0, 1)))[0]
    assert_counts(counts, 1 / 256)


def test_sphere_directions_are_uniform() -> None:
    """Then z and the azimuth are uniform and independent (Archimedes)."""
    directions = np.empty((SAMPLES, 3))
    fill_sphere(*uniform(SAMPLES), directions)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-12)
    azimuth = turns(directions, np.array([0.0, 0.0, 1.0]))
    counts = np.histogram2d((directions[:, 2] + 1) / 2, azimuth, bins=16, range=((0, 1), (0, 1)))[0]
    assert_counts(counts, 1 / 256)


@pytest.mark.parametrize("distance", [0.0, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("size", [1e-2, 1.0, 1e3])
def test_rays_leave_the_triangle_they_start_on(distance: float, size: float) -> None:
    """Origins are float32, moved by the offset along the normal; directions are the reflected photons'."""
    rng = np.random.default_rng(11)
    triangles, rays = 100, 100
    corners = distance * rng.normal(size=(triangles, 1, 3)) + size * rng.normal(size=(triangles, 3, 3))
    for triangle in corners.astype(np.float32):
        p, q, r = triangle.astype(np.float64)
        normal = np.cross(q - p, r - p)
        doubled_area = np.linalg.norm(normal)
        if doubled_area < 0.1 * size**2:
            continue  # needles have no normal to speak of once their corners are rounded
        n = normal / doubled_area
        u, v = np.sort(rng.random((2, rays)), axis=0)
        u, v = u, v - u
        points = (1 - u - v)[:, None] * p + u[:, None] * q + v[:, None] * r
        offsets = np.empty(rays)
        extent = math.sqrt(max(((q - p) ** 2).sum(), ((r - p) ** 2).sum()))
        fill_offset(points, np.full(rays, extent), offsets)
        directions = np.empty((rays, 3))
        fill_cosine(n, *rng.random((2, rays)), directions)
        tracer = Tracer(scene([Part(triangle, np.array([[0, 1, 2]]))]).geometry)
        origins = (points + offsets[:, None] * n).astype(np.float32)
        hits = tracer.intersect(origins, directions.astype(np.float32))
        assert (hits.triangle == MISS).all()
