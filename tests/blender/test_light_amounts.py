# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid's light in materials amounts to ρ/π E, in Cycles and in EEVEE."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.principled import COSINES, Layers, oren_nayar_share, through_layers

from . import light_patches
from . import material_trees as trees
from .gpu_child import draws, rendered_by_eevee
from .stored_grids import module, store

Float64 = NDArray[np.float64]

BASE = np.array([0.8, 0.5, 0.2])
COLOUR = (*BASE, 1.0)


def principled(**inputs: Any) -> bpy.types.Material:
    """Return a Principled BSDF."""
    material, add, output = trees.tree_of("Principled")
    shader = add("BsdfPrincipled", Base_Color=COLOUR, **inputs)
    material.node_tree.links.new(shader.outputs[0], output.inputs[0])
    return material


def through(**layers: Any) -> Float64:
    """Return what layers leave of the colour from where the patches are seen."""
    left = through_layers(Layers(**layers))
    return BASE * [np.interp(math.cos(light_patches.TILT), COSINES, left[:, channel]) for channel in range(3)]


def patches() -> list[tuple[bpy.types.Material, Any, float]]:
    """Return materials, what each reflects of even light towards the camera, and how far off it may be (relative).

    The light is even, so that bumps and Oren–Nayar's roughness change nothing but what they take off the albedo. What
    layers leave is fitted, see light_groups.py: within 0.014, of which two standard errors are allowed.
    """
    rough, add, output = trees.tree_of("Rough")
    rough.node_tree.links.new(add("BsdfDiffuse", Color=COLOUR, Roughness=1.0).outputs[0], output.inputs[0])
    textured, add, output = trees.tree_of("Textured")
    colour = add("RGB")
    colour.outputs[0].default_value = COLOUR
    bump = add("Bump", Height=add("TexNoise", Scale=50.0).outputs[0], Strength=0.3)
    bsdf = add("BsdfDiffuse", Color=colour.outputs[0], Normal=bump.outputs[0])
    textured.node_tree.links.new(bsdf.outputs[0], output.inputs[0])
    half, add, output = trees.tree_of("Half")
    mix = add("MixShader", Fac=0.25)
    tree = half.node_tree
    tree.links.new(add("BsdfDiffuse", Color=COLOUR).outputs[0], mix.inputs[1])
    tree.links.new(add("BsdfDiffuse", Color=(0.0, 0.0, 1.0, 1.0)).outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs[0])
    curtain, add, output = trees.tree_of("Glass Over Black")
    curtain.node_tree.links.new(add("BsdfDiffuse", Color=(0.0, 0.0, 0.0, 1.0)).outputs[0], output.inputs[0])
    exact, fitted = 1e-3, 0.028
    return [
        (trees.diffuse(COLOUR), BASE, exact),
        (rough, BASE * oren_nayar_share(BASE, 1.0), exact),
        (textured, BASE, exact),
        (half, 0.75 * BASE + 0.25 * np.array([0.0, 0.0, 1.0]), exact),
        (trees.grouped(), np.array([0.1, 0.6, 0.3]), exact),
        (curtain, 0.0 * BASE, exact),
        (principled(Metallic=0.4, Transmission_Weight=0.5), 0.6 * 0.5 * through(), fitted),
        (principled(Roughness=0.1), through(roughness=0.1), fitted),
        (
            principled(Coat_Weight=0.8, Coat_Tint=(0.9, 0.5, 0.5, 1.0)),
            through(coat=0.8, coat_tint=(0.9, 0.5, 0.5)),
            fitted,
        ),
        (principled(Alpha=0.5), 0.5 * through(), fitted),
    ]


@pytest.fixture
def laid_out(extension: str, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[tuple[Float64, Float64]]:
    """Lay patches out under an even light that the grid alone gives; return their radiance and what they may be off.

    The parameter says which of the patches, and how many of them, the last, have the light from the modifier.
    """
    which, stored = request.param
    bpy.ops.wm.read_homefile(use_empty=True)
    store(extension, "Even", light_patches.even_light(), tmp_path)
    shown = patches()[which]
    materials = [material for material, *_ in shown]
    light_patches.lay_out(materials)
    bpy.ops.ivg.modifier_add(objects="ALL")
    bpy.ops.ivg.materials_add(light_from="MODIFIER")
    looked_up = materials[: len(materials) - stored]
    light = module(extension, "material_light")
    light.add_light(looked_up, bpy.context.scene.ivg.grid)
    assert sum(map(light.takes_stored, materials)) == stored
    bpy.ops.ivg.direct_only()
    radiance = np.array([reflected * light_patches.LIGHT / math.pi for _, reflected, _ in shown])
    yield radiance, np.array([off for *_, off in shown])[:, None] * np.maximum(radiance, 1e-3)
    bpy.ops.wm.read_homefile(use_empty=True)


@pytest.mark.parametrize("laid_out", [(slice(None), 0), (slice(None), 10)], indirect=True)
def test_in_cycles_it_is_albedo_times_irradiance(laid_out: Any, tmp_path: Path) -> None:
    expected, allowed = laid_out
    bpy.context.scene.render.engine = "CYCLES"
    found = light_patches.rendered(tmp_path / "a.exr", len(expected))
    assert (np.abs(found - expected) <= allowed).all(), np.round(found - expected, 4)


@draws
@pytest.mark.parametrize("laid_out", [(slice(2, 5), 2)], indirect=True)
def test_in_eevee_too(laid_out: Any, tmp_path: Path) -> None:
    """EEVEE writes half floats: 10⁻³ more is allowed."""
    expected, allowed = laid_out
    found = rendered_by_eevee(tmp_path, light_patches.rendered, len(expected))
    assert (np.abs(found - expected) <= allowed + 1e-3).all(), np.round(found - expected, 4)
