# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances written out: every property that can be known without the code under test."""

from __future__ import annotations

import itertools
import tracemalloc

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ivg_addon.core import instancing
from ivg_addon.core.errors import MemoryLimitError
from ivg_addon.core.instancing import LIGHT_PASSES, Flattened, Instances, MeshData, flatten_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import Geometry

numbers = st.floats(-3, 3)
scales = st.floats(0.2, 3).map(lambda x: round(x, 3)) | st.floats(-3, -0.2).map(lambda x: round(x, 3))


def run(meshes: list[MeshData], instances: list[Instances]) -> Flattened:
    steps = flatten_steps(meshes, instances)
    fractions = []
    try:
        while True:
            fractions.append(next(steps).fraction)
    except StopIteration as end:
        assert fractions == sorted(fractions)
        assert fractions[-1] == 1.0
        return end.value


def tetrahedron(smooth: bool = True) -> MeshData:
    """Return a tetrahedron, faces outward, with a UV map "UV" that holds each corner's own number."""
    positions = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=np.float32)
    corner_vertex = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], dtype=np.int32)
    outward = positions - positions.mean(axis=0)
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    number = np.arange(12, dtype=np.float32)
    return MeshData(
        positions=positions,
        corner_vertex=corner_vertex,
        triangle_corners=np.arange(12, dtype=np.int32).reshape(4, 3),
        corner_normals=outward[corner_vertex] if smooth else None,
        uv_maps={"UV": np.stack([number, -number], axis=1)},
    )


def instance(matrix: np.ndarray, **changes: object) -> Instances:
    values: dict[str, object] = {"mesh": 0, "object": 0, "materials": (0,), "uv_map": ("UV",), **changes}
    objects = np.array([values.pop("object")], dtype=np.int32)
    return Instances(objects=objects, matrices=matrix[None], **values)  # type: ignore[arg-type]


def affine(linear: np.ndarray, origin: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, origin
    return matrix


def geometric(geometry: Geometry) -> np.ndarray:
    """Return area vectors."""
    p = geometry.vertices[geometry.triangles].astype(float)
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 2


@given(
    linear=st.lists(numbers, min_size=9, max_size=9).map(lambda values: np.array(values).reshape(3, 3)),
    origin=st.tuples(numbers, numbers, numbers).map(np.array),
)
@settings(max_examples=150, deadline=None)
def test_any_transform(linear: np.ndarray, origin: np.ndarray) -> None:
    determinant = linear[0] @ np.cross(linear[1], linear[2])
    assume(abs(determinant) > 0.05)
    mesh = tetrahedron()
    geometry = run([mesh], [instance(affine(linear, origin))]).geometry

    area_vectors = geometric(geometry)
    corners = geometry.vertices[geometry.triangles].astype(float)
    volume = np.einsum("ij,ij->", corners[:, 0], area_vectors) / 3
    assert volume == pytest.approx(abs(determinant) / 6, rel=1e-4), "the front stays outside, mirrored or not"
    own = geometric(run([mesh], [instance(np.eye(4))]).geometry)
    want = own @ np.linalg.inv(linear) * abs(determinant)
    np.testing.assert_allclose(area_vectors, want, atol=1e-4 * np.abs(want).max())

    # Each corner keeps its vertex, normal and texture coordinates together.
    number = geometry.uvs[:, :, 0].astype(int)
    np.testing.assert_array_equal(geometry.uvs[:, :, 1], -geometry.uvs[:, :, 0])
    placed = mesh.positions[mesh.corner_vertex].astype(float) @ linear.T + origin
    np.testing.assert_allclose(corners, placed[number], atol=1e-5)
    normals = mesh.corner_normals[number] @ np.linalg.inv(linear)
    normals /= np.linalg.norm(normals, axis=-1)[..., None]
    np.testing.assert_allclose(geometry.corner_normals, normals, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(geometry.corner_normals, axis=-1), 1, atol=1e-6)


@given(st.tuples(scales, scales, scales))
def test_flat_mesh_repeats_its_geometric_normals(scale: tuple[float, float, float]) -> None:
    geometry = run([tetrahedron(smooth=False)], [instance(affine(np.diag(scale), np.zeros(3)))]).geometry
    area_vectors = geometric(geometry)
    unit = area_vectors / np.linalg.norm(area_vectors, axis=1)[:, None]
    np.testing.assert_allclose(geometry.corner_normals, np.repeat(unit[:, None], 3, axis=1), atol=1e-6)


@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_a_plane_may_be_scaled_flat(mirrored: float) -> None:
    plane = MeshData(
        positions=np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], dtype=np.float32),
        corner_vertex=np.arange(3, dtype=np.int32),
        triangle_corners=np.arange(3, dtype=np.int32)[None],
        corner_normals=np.tile(np.array([[0, 0, 1]], dtype=np.float32), (3, 1)),
    )
    flattened = run([plane], [instance(affine(np.diag([2 * mirrored, 1, 0]), np.zeros(3)))])
    assert flattened.dropped == {}
    np.testing.assert_allclose(np.abs(geometric(flattened.geometry)), [[0, 0, 1]])
    np.testing.assert_allclose(np.abs(flattened.geometry.corner_normals[0]), [[0, 0, 1]] * 3)


def test_triangles_that_cannot_be_lit_are_counted_by_object() -> None:
    mesh = tetrahedron()
    mesh.positions[3] = np.nan
    collapsed = affine(np.zeros((3, 3)), np.ones(3))
    flattened = run(
        [mesh, tetrahedron()],
        [
            instance(np.eye(4), object=7),
            instance(np.eye(4), object=7),
            instance(np.eye(4), object=8, mesh=1),
            instance(collapsed, object=9, mesh=1),
        ],
    )
    assert flattened.dropped == {7: 6, 9: 4}
    assert flattened.geometry.triangle_count == 2 + 4
    assert np.isfinite(flattened.geometry.vertices[flattened.geometry.triangles]).all()
    assert np.isfinite(flattened.geometry.corner_normals).all()


def test_bad_normals_are_replaced_by_the_geometric_one() -> None:
    mesh = tetrahedron()
    mesh.corner_normals[0] = np.nan
    mesh.corner_normals[1] = 0
    geometry = run([mesh], [instance(np.eye(4))]).geometry
    np.testing.assert_allclose(geometry.corner_normals[0, :2], [[0, 0, -1]] * 2, atol=1e-7)
    np.testing.assert_allclose(geometry.corner_normals[0, 2], mesh.corner_normals[2], atol=1e-6)


def test_material_slots() -> None:
    mesh = MeshData(**{**vars(tetrahedron()), "slot": np.array([0, 1, 2, 99], dtype=np.int32)})
    two = instance(np.eye(4), materials=(5, LIGHT_PASSES, 3), uv_map=(None, "UV", "UV"))
    flattened = run([mesh], [two])
    np.testing.assert_array_equal(flattened.geometry.material, [5, 3, 3])
    assert flattened.dropped == {}, "faces that light passes through are not a fault"
    np.testing.assert_array_equal(flattened.geometry.uvs[0], 0)
    np.testing.assert_array_equal(flattened.geometry.uvs[1:, :, 0], [[6, 7, 8], [9, 10, 11]])


@pytest.mark.parametrize("slice_size", [1, 3, 1 << 17])
def test_slices_and_batches_make_no_difference(monkeypatch: pytest.MonkeyPatch, slice_size: int) -> None:
    rng = np.random.default_rng(4)
    instances = [
        instance(
            affine(rng.normal(size=(3, 3)), rng.normal(size=3)),
            object=i,
            mesh=i % 2,
            materials=(i % 3,),
            uv_map=("UV",),
        )
        for i in range(12)
    ]
    meshes = [tetrahedron(), tetrahedron(smooth=False)]
    monkeypatch.setattr(instancing, "SLICE", slice_size)
    geometry = run(meshes, instances).geometry
    assert geometry.triangle_count == 48
    for one in instances:
        alone = run(meshes, [one]).geometry
        here = geometry.object == one.objects[0]
        for name in ("corner_normals", "uvs", "material"):
            np.testing.assert_array_equal(getattr(geometry, name)[here], getattr(alone, name))
        np.testing.assert_array_equal(geometry.vertices[geometry.triangles[here]], alone.vertices[alone.triangles])


def test_arrays_are_what_kernels_expect() -> None:
    geometry = run([tetrahedron()], [instance(np.eye(4)), instance(np.eye(4))]).geometry
    for array, dtype in itertools.zip_longest(vars(geometry).values(), ["f4", "i4", "f4", "f4", "i4", "i4"]):
        assert array.dtype == dtype
        assert array.flags.c_contiguous


def test_unique_triangles_are_counted_once() -> None:
    assert run([tetrahedron()], [instance(np.eye(4))] * 9).unique_triangles == 4


def test_too_much_is_refused_before_it_is_made() -> None:
    huge = MeshData(
        positions=np.broadcast_to(np.zeros(3, dtype=np.float32), (1 << 20, 3)),
        corner_vertex=np.broadcast_to(np.int32(0), (1,)),
        triangle_corners=np.broadcast_to(np.int32(0), (1 << 22, 3)),
    )
    with pytest.raises(MemoryLimitError, match=r"geometry \(.* triangles with all instances\) needs .* GiB"):
        next(flatten_steps([huge], [instance(np.eye(4))] * (1 << 14)))


def test_instances_of_one_group_are_placed_as_if_alone() -> None:
    rng = np.random.default_rng(6)
    matrices = [affine(rng.normal(size=(3, 3)), rng.normal(size=3)) for _ in range(9)]
    groups = [instance(matrix, object=i) for i, matrix in enumerate(matrices)]
    together = Instances(
        mesh=0, objects=np.arange(9, dtype=np.int32), matrices=np.stack(matrices), materials=(0,), uv_map=("UV",)
    )
    one, several = run([tetrahedron()], [together]).geometry, run([tetrahedron()], groups).geometry
    for name in vars(one):
        np.testing.assert_array_equal(getattr(one, name), getattr(several, name))


def test_a_million_triangles_without_area() -> None:
    """All are left out and counted, and nothing of them is held but the arrays of the result."""
    count = 1_000_000
    flat = MeshData(
        positions=np.zeros((count, 3), dtype=np.float32),
        corner_vertex=np.arange(count, dtype=np.int32),
        triangle_corners=np.broadcast_to(np.arange(3, dtype=np.int32), (count, 3)),
    )
    flat.positions[: count // 2] = np.nan
    flattened = run([flat], [instance(np.eye(4), uv_map=(None,))])
    assert flattened.dropped == {0: count}
    assert flattened.geometry.triangle_count == 0


def test_nothing_at_all() -> None:
    none = MeshData(
        positions=np.zeros((0, 3), dtype=np.float32),
        corner_vertex=np.zeros(0, dtype=np.int32),
        triangle_corners=np.zeros((0, 3), dtype=np.int32),
    )
    for meshes, instances in (([], []), ([none], [instance(np.eye(4), uv_map=(None,))])):
        assert finish(flatten_steps(meshes, instances)).geometry.triangle_count == 0


def test_a_million_instances_need_little_more_than_their_triangles() -> None:
    """While they are placed, a few slices are held beside the result."""
    count = 250_000
    matrices = np.broadcast_to(np.eye(4, dtype=np.float32), (count, 4, 4))
    places = Instances(0, np.zeros(count, dtype=np.int32), matrices, (0,), ("UV",))
    tracemalloc.start()
    geometry = run([tetrahedron()], [places]).geometry
    held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    result = sum(array.nbytes for array in vars(geometry).values())
    assert geometry.triangle_count == 4 * count
    assert held < result + 200 * instancing.SLICE
