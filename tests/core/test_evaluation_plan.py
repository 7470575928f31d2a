# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans: every triangle of a material has texels, as many as its size asks for and as there may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ivg_addon.core import evaluation_plan
from ivg_addon.core.evaluation_plan import atlas_uvs, make_plan, renamed, scene_size
from ivg_addon.core.instancing import Instances, MeshData, flatten_steps
from ivg_addon.core.progress import finish


def grid(steps: int, slots: int = 1) -> MeshData:
    """Return a square of 2 steps² triangles, materials in turn."""
    x, y = np.meshgrid(np.linspace(0, 1, steps + 1), np.linspace(0, 1, steps + 1))
    positions = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(np.float32)
    first = (np.arange(steps)[:, None] * (steps + 1) + np.arange(steps)).reshape(-1)
    quads = first[:, None] + np.array([0, 1, steps + 2, steps + 1])
    corner = 4 * np.arange(len(quads))[:, None]
    triangles = (corner + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    slot = np.arange(len(triangles)) % slots
    return MeshData(
        positions, quads.reshape(-1).astype(np.int32), triangles.astype(np.int32), slot=slot.astype(np.int32)
    )


def placed(
    mesh: int, number: int, materials: tuple[int, ...] = (0,), scale: tuple[float, ...] = (1, 1, 1)
) -> Instances:
    matrix = np.diag([*scale, 1.0])
    matrix[:3, 3] = (3.0 * number, 0, 0)
    return Instances(mesh, np.array([number], dtype=np.int32), matrix[None], materials, (None,) * len(materials))


def together(instances: list[Instances]) -> Instances:
    """Return instances of one mesh as one."""
    return replace(
        instances[0],
        objects=np.concatenate([each.objects for each in instances]),
        matrices=np.concatenate([each.matrices for each in instances]),
    )


def test_instances_share_their_texels_unless_they_look_different() -> None:
    meshes, instances = [grid(4)], [placed(0, number) for number in range(5)]
    shared, apart = (make_plan(0, each, meshes, instances, 10.0) for each in (False, True))
    assert shared is not None
    assert apart is not None
    assert [patch.instances for patch in shared.patches] == [(0, 1, 2, 3, 4)]
    assert [(patch.instances, patch.place) for patch in apart.patches] == [((i,), 0) for i in range(5)]
    assert len(apart.atlas.size) == 5 * 32
    grouped = make_plan(0, True, meshes, [together(instances)], 10.0)
    assert grouped is not None
    assert [(patch.instances, patch.place) for patch in grouped.patches] == [((0,), i) for i in range(5)]


def test_too_many_different_instances_look_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluation_plan, "MOST_PLACED", 100)
    plan = make_plan(0, True, [grid(4)], [placed(0, number) for number in range(5)], 10.0)
    assert plan is not None
    assert plan.unplaced
    assert len(plan.patches) == 1


def test_large_triangles_have_more_texels() -> None:
    plan = make_plan(0, False, [grid(1), grid(8)], [placed(0, 0), placed(1, 1)], 1.0)
    assert plan is not None
    assert plan.atlas.size.tolist() == [256, 256] + [32] * 128


def test_small_objects_of_large_scenes_have_few() -> None:
    plan = make_plan(0, False, [grid(1)], [placed(0, 0)], 512.0)
    assert plan is not None
    assert plan.atlas.size.tolist() == [1, 1]


def test_texels_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluation_plan, "MOST_TEXELS", 1000)
    few = make_plan(0, False, [grid(2)], [placed(0, 0)], 1.0)
    many = make_plan(0, False, [grid(40)], [placed(0, 0)], 1.0)
    for plan in (few, many):
        assert plan is not None
        assert (plan.atlas.size.astype(int) ** 2).sum() <= 1000
    assert many is not None
    assert many.shared == 4


def test_many_materials_share_the_memory() -> None:
    plan = make_plan(0, False, [grid(1)], [placed(0, 0)], 1.0, materials=10**6)
    assert plan is not None
    assert 0.5 * 2**16 < (plan.atlas.size.astype(int) ** 2).sum() <= 2**16


def test_every_triangle_finds_its_block_also_where_they_share(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluation_plan, "MOST_TEXELS", 1000)
    meshes, instances = [grid(40, slots=3)], [placed(0, 0, (7, 3, 7))]
    plan = make_plan(7, False, meshes, instances, 1.0)
    assert plan is not None
    (patch,) = plan.patches
    np.testing.assert_array_equal(patch.triangles, np.flatnonzero(np.arange(3200) % 3 != 1))
    (uvs,) = atlas_uvs(plan, meshes)
    texels, owners = plan.atlas.texels()
    image = plan.atlas.image(texels, np.repeat(owners[:, None].astype(np.float64), 3, axis=1))
    centre = uvs[patch.triangles].mean(axis=1) * (plan.atlas.width, plan.atlas.height)
    found = image[centre[:, 1].astype(int), centre[:, 0].astype(int), 0]
    np.testing.assert_array_equal(found, np.arange(len(patch.triangles)) // plan.shared)
    assert not uvs[1::3].any()


def test_materials_without_triangles_need_none() -> None:
    assert make_plan(5, False, [grid(2)], [placed(0, 0, (5, 4))], 1.0) is not None
    assert make_plan(4, False, [grid(2)], [placed(0, 0, (5, 4))], 1.0) is None
    assert make_plan(6, False, [grid(2)], [placed(0, 0)], 1.0) is None


def test_coordinates_that_triangles_do_not_share_reach_the_scene() -> None:
    """Also through an instance that mirrors: there the order of the corners turns."""
    mesh = grid(3)
    rng = np.random.default_rng(2)
    mesh.triangle_uvs["own"] = rng.random((18, 3, 2)).astype(np.float32)
    instances = renamed([together([placed(0, 0), placed(0, 1, scale=(-1, 1, 1))])], {(0, None, 0): "own"})
    geometry = finish(flatten_steps([mesh], instances)).geometry
    np.testing.assert_array_equal(geometry.uvs[:18], mesh.triangle_uvs["own"])
    np.testing.assert_array_equal(geometry.uvs[18:], mesh.triangle_uvs["own"][:, [0, 2, 1]])
    before = geometry.vertices[geometry.triangles[:18, [0, 2, 1]]] * (-1, 1, 1) + (3, 0, 0)
    np.testing.assert_allclose(geometry.vertices[geometry.triangles[18:]], before, atol=1e-6)


def test_places_that_differ_read_their_own_coordinates() -> None:
    group = together([placed(0, number, (0, 1)) for number in range(3)])
    names: dict[tuple[int, int | None, int], str] = {(0, place, 0): f"place {place}" for place in range(3)}
    changed = renamed([group, placed(0, 9)], {**names, (0, None, 1): "all"})
    assert [each.uv_map for each in changed] == [(f"place {place}", "all") for place in range(3)] + [(None,)]
    assert [each.objects.tolist() for each in changed] == [[0], [1], [2], [9]]
    np.testing.assert_array_equal(np.concatenate([each.matrices for each in changed[:3]]), group.matrices)


def test_scene_size_counts_all_instances() -> None:
    assert scene_size([grid(1)], [placed(0, 0), placed(0, 3)]) == pytest.approx(10.0)
    assert scene_size([], []) == 0.0
