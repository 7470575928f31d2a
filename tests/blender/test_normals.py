# SPDX-License-Identifier: GPL-3.0-or-later
"""Bump and normal maps: the normals that are exported are those that Cycles has, wherever a mesh stands."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Euler
from numpy.typing import NDArray

from ivg_addon.core.bumps import BENT, MIRRORED, OWN, placed_normal
from ivg_addon.core.scene import NO_TEXTURE, Scene
from tests.blender.evaluation_scenes import (
    SPREAD,
    WITHIN,
    curved_grid,
    cycles_at_triangles,
    evaluated_scene,
    looked_up,
    node_output,
    soft_image,
    through,
)
from tests.blender.export_scenes import Build, add_object, empty_scene, new_material, quads_with_uvs
from tests.blender.export_trees import RED, Maker, Node, Tree, diffuse, shader, surface

Float64 = NDArray[np.float64]

SLOPE = 0.5
TURN = (0.5, -0.3, 0.7)


def mean_normals(scene: Scene, name: str) -> Float64:
    """Return the mean of the only lobe's normals over each triangle of an object, (triangles, 3), in world space."""
    geometry, lobes = scene.geometry, scene.materials.lobes
    assert lobes.normal is not None and lobes.normal_texture is not None
    here = np.flatnonzero(geometry.object == scene.objects.index(name))
    found = []
    for triangle in here:
        (row,) = np.flatnonzero(lobes.material == geometry.material[triangle])
        p = geometry.vertices[geometry.triangles[triangle]].astype(np.float64)
        uvs, corners = geometry.uvs[triangle].astype(np.float64), geometry.corner_normals[triangle].astype(np.float64)
        relative = np.tile(lobes.normal[row].astype(np.float64), (len(SPREAD), 1))
        if lobes.normal_texture[row] != NO_TEXTURE:
            relative *= looked_up(scene, int(lobes.normal_texture[row]), SPREAD @ uvs)
        smooth = SPREAD @ corners
        smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
        placed = [placed_normal(*n, *s, *map(tuple, p), *uvs.ravel()) for n, s in zip(relative, smooth, strict=True)]
        found.append(np.mean(placed, axis=0))
    return np.array(found)


def card_of(bend: Build, scale: float = 1.0) -> Scene:
    """Return a turned card of a material, exported."""
    empty_scene()
    card = quads_with_uvs(np.zeros((1, 2)))
    card.materials.append(new_material("Tested", bend))
    add_object("Card", card, rotation_euler=TURN, scale=(scale,) * 3)
    return evaluated_scene()


def sloped(along: Float64) -> Float64:
    """Return the normal of the card where its height grows by `SLOPE` along a direction in world space."""
    up = np.array(Euler(TURN).to_matrix())[:, 2]
    normal = up - SLOPE * (along - (along @ up) * up)
    return np.asarray(normal / np.linalg.norm(normal))


def first_of(coordinates: Maker) -> Maker:
    return through("SeparateXYZ", 0, coordinates, "X")


def test_bumps_slope_as_their_height_does() -> None:
    bump = through("Bump", "Height", first_of(node_output("NewGeometry", "Position")), Distance=SLOPE)
    scene = card_of(surface(shader("BsdfDiffuse", Color=RED, Normal=bump)))
    np.testing.assert_allclose(mean_normals(scene, "Card"), np.tile(sloped(np.array([1.0, 0, 0])), (2, 1)), atol=1e-3)
    assert scene.materials.lobes.bump is not None
    assert list(scene.materials.lobes.bump) == [OWN | MIRRORED]
    assert not scene.notices


def test_displacement_bends_normals_in_the_objects_own_lengths() -> None:
    def build(tree: Tree, output: Node) -> None:
        diffuse(RED)(tree, output)
        bend = through("Displacement", "Height", first_of(node_output("TexCoord", "Object")), Scale=SLOPE)
        tree.links.new(bend(tree), output.inputs["Displacement"])

    scene = card_of(build, 2.0)
    along = np.array(Euler(TURN).to_matrix())[:, 0]
    np.testing.assert_allclose(mean_normals(scene, "Card"), np.tile(sloped(along), (2, 1)), atol=1e-3)
    assert scene.materials.lobes.bump is not None
    assert list(scene.materials.lobes.bump) == [OWN | MIRRORED | BENT]


def test_a_normal_map_is_that_of_cycles_on_all_instances() -> None:
    def shining(tree: Tree, output: Node) -> None:
        half = through("VectorMath", 0, tilted, operation="MULTIPLY_ADD")
        node = half(tree).node
        node.inputs[1].default_value = node.inputs[2].default_value = (0.5,) * 3
        tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeEmission").inputs["Color"])
        tree.links.new(tree.nodes[-1].outputs[0], output.inputs["Surface"])

    tilted = through("NormalMap", "Color", soft_image(), "Normal", Strength=0.7)
    empty_scene()
    mesh = curved_grid(12)
    mesh.materials.append(new_material("Tested", surface(shader("BsdfDiffuse", Color=RED, Normal=tilted))))
    places = {"One": ((0.3, 0.5, 0.7), (0.8,) * 3), "Two": ((1.0, 0.2, 2.0), (-1.5, 1.5, 1.5))}
    shown = {name: add_object(name, mesh, rotation_euler=turn, scale=scale) for name, (turn, scale) in places.items()}
    scene = evaluated_scene()
    mesh.materials[0] = new_material("Shining", shining)
    for name, one in shown.items():
        normals = 2.0 * cycles_at_triangles(one, "EMIT") - 1.0
        difference = np.abs(mean_normals(scene, name) - normals.mean(axis=1))
        assert (difference <= 2 / 3 * np.ptp(normals, axis=1) + WITHIN).all()
        assert difference.mean() < 0.02
    # They share the atlas: normals are relative to the surface.
    assert len(bpy.data.objects) == 2 and len(scene.textures) == 1
