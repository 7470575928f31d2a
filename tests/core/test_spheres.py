# SPDX-License-Identifier: GPL-3.0-or-later
"""Spheres made of triangles against the closed forms of spheres."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core import spheres
from ivg_addon.core.instancing import Instances, MeshData, flatten_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import Geometry
from ivg_addon.core.spheres import polyhedron, sphere_cloud

LARGEST_DEVIATION = {8: 0.184, 20: 0.048, 80: 0.012, 320: 0.003}
"""Of the projected area, as the module says."""


def area_vectors(mesh: MeshData) -> np.ndarray:
    corners = mesh.positions[mesh.triangle_corners].astype(float)
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def placed(centers: np.ndarray, radii: np.ndarray) -> Geometry:
    cloud = sphere_cloud(centers.astype(np.float32), radii.astype(np.float32))
    places = Instances(0, np.zeros(len(cloud.matrices), dtype=np.int32), cloud.matrices, (0,), (None,))
    return finish(flatten_steps([cloud.mesh], [places])).geometry


@pytest.mark.parametrize("faces", LARGEST_DEVIATION)
def test_area_and_outside(faces: int) -> None:
    mesh = polyhedron(faces)
    vectors = area_vectors(mesh)
    assert len(vectors) == faces
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(4 * math.pi, rel=1e-6)
    np.testing.assert_allclose(vectors.sum(axis=0), 0, atol=1e-6, err_msg="closed")
    centres = mesh.positions[mesh.triangle_corners].mean(axis=1)
    assert np.einsum("ij,ij->i", vectors, centres).min() > 0, "outside is the front"


@pytest.mark.parametrize("faces", LARGEST_DEVIATION)
def test_projected_area_from_any_direction(faces: int) -> None:
    """The mean over directions is a sphere's; single ones deviate as far as is said, by more than half of it."""
    # A Fibonacci lattice integrates functions as smooth as this one to far below 10⁻³.
    n = 20_000
    z = 1 - (2 * np.arange(n) + 1) / n
    turn = np.arange(n) * math.pi * (3 - math.sqrt(5))
    directions = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    projected = np.abs(directions @ area_vectors(polyhedron(faces)).T).sum(axis=1) / 2 / math.pi
    assert projected.mean() == pytest.approx(1, abs=1e-3)
    largest = np.abs(projected - 1).max()
    assert 0.5 * LARGEST_DEVIATION[faces] < largest < LARGEST_DEVIATION[faces]


@pytest.mark.parametrize(("count", "faces"), [(1, 320), (10_000, 20), (60_000, 8)])
def test_many_spheres_are_coarser(count: int, faces: int) -> None:
    cloud = sphere_cloud(np.zeros((count, 3), dtype=np.float32), np.ones(count, dtype=np.float32))
    assert len(cloud.mesh.triangle_corners) == faces
    assert not cloud.thinned


def test_places_and_sizes() -> None:
    centers = np.array([(1, 2, 3), (-4, 0, 0)])
    geometry = placed(centers, np.array([0.5, 2.0]))
    corners = geometry.vertices[geometry.triangles].astype(float).reshape(2, -1, 3, 3)
    vectors = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]) / 2
    areas = np.linalg.norm(vectors, axis=2).sum(axis=1)
    np.testing.assert_allclose(areas, 4 * math.pi * np.array([0.25, 4.0]), rtol=1e-5)
    np.testing.assert_allclose(corners.mean(axis=(1, 2)), centers, atol=1e-3)
    units = vectors.reshape(-1, 3) / np.linalg.norm(vectors.reshape(-1, 3), axis=1)[:, None]
    np.testing.assert_allclose(geometry.corner_normals, np.repeat(units[:, None], 3, axis=1), atol=1e-5)


def test_random_turns_make_projected_areas_exact_in_every_direction() -> None:
    """Of 60,000 octahedra's mean projected areas |z| < 4: one of 16,000 seeds fails."""
    cloud = sphere_cloud(np.zeros((60_000, 3), dtype=np.float32), np.ones(60_000, dtype=np.float32))
    vectors = area_vectors(cloud.mesh)
    for direction in np.eye(3):
        seen = cloud.matrices[:, :3, :3].astype(float).transpose(0, 2, 1) @ direction
        projected = np.abs(seen @ vectors.T).sum(axis=1) / 2 / math.pi
        z = (projected.mean() - 1) / (projected.std() / math.sqrt(len(projected)))
        assert abs(z) < 4


def test_what_is_not_a_sphere_is_left_out() -> None:
    nan = float("nan")
    centers = np.array([(0, 0, 0), (nan, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, float("inf"))], dtype=np.float32)
    cloud = sphere_cloud(centers, np.array([1, 1, 0, nan, 1], dtype=np.float32))
    assert cloud.points == len(cloud.matrices) == 1
    none = sphere_cloud(np.zeros((0, 3), dtype=np.float32), np.zeros(0, dtype=np.float32))
    assert none.points == len(none.matrices) == 0


def test_too_many_are_thinned_and_keep_their_area(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spheres, "MOST_TRIANGLES", 8 * 1000)
    centers = np.zeros((7000, 3), dtype=np.float32)
    centers[:, 0] = np.arange(7000)
    cloud = sphere_cloud(centers, np.full(7000, 0.1, dtype=np.float32))
    assert cloud.thinned
    assert (cloud.points, len(cloud.matrices)) == (7000, 1000)
    scale = np.linalg.norm(cloud.matrices[:, :3, 0], axis=1)
    assert (scale**2).sum() == pytest.approx(7000 * 0.01, rel=1e-5)
    assert np.unique(np.diff(cloud.matrices[:, 0, 3])).tolist() == [7.0], "evenly over the cloud"
