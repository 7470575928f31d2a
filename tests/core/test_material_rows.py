# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of materials: constants, images and textures, packed as the photon walk reads them."""

from __future__ import annotations

import numpy as np

from ivg_addon.core.closures import Caustics, Closure, Factor, Leaf
from ivg_addon.core.material_rows import (
    PROBES,
    as_constant,
    as_image,
    as_texture,
    is_proportional,
    lets_light_pass,
    make_row,
    pack_materials,
)
from ivg_addon.core.scene import GLOSSY, MATTE, NO_TEXTURE, TRANSPARENT, VIEW_STEPS
from ivg_addon.core.shade import shade
from tests.core.test_closures import RED, diffuse, principled

PLAIN = Caustics()


def test_an_image_that_all_is_proportional_to_is_recognised() -> None:
    image = Leaf(0)
    closures = {
        "colour": (diffuse(image), True),
        "base of a metal and of a plain surface": (principled(Base_Color=image, Metallic=(0.5,)), True),
        "emission": (Closure("EMISSION", {"Color": image, "Strength": (3.0,)}), True),
        "rough diffuse": (diffuse(image, roughness=(0.5,)), False),
        "tint of glass is a root": (principled(Base_Color=image, Transmission_Weight=(1.0,)), False),
    }
    for closure, proportional in closures.values():
        assert is_proportional(shade([closure], [PROBES], PLAIN)) == proportional


def test_an_image_stays_an_image() -> None:
    shading = shade([principled(Base_Color=Leaf(0), Metallic=(0.5,))], [PROBES], PLAIN)
    row = make_row("Row", shading, 0, as_image(4))
    assert row.albedo.texture == 4
    matte, metal, plain = row.lobes
    assert matte.color.texture == 4
    assert (metal.color.texture, metal.second.texture, plain.color.texture) == (4, NO_TEXTURE, NO_TEXTURE)
    np.testing.assert_allclose(metal.color.colour, 0.5)
    np.testing.assert_allclose(row.albedo.colour, shading.albedo[1])


def test_values_that_vary_become_textures_and_others_constants() -> None:
    made: list[np.ndarray] = []

    def add(values: np.ndarray) -> int:
        made.append(values)
        return len(made) - 1

    colours = np.random.default_rng(0).random((10, 3))
    closures = [diffuse(Leaf(0)), Closure("EMISSION", {"Color": RED, "Strength": (1.0,)})]
    row = make_row("Row", shade(closures, [colours], PLAIN), 0, as_texture(add))
    assert (row.albedo.texture, row.emission.texture) == (0, NO_TEXTURE)
    np.testing.assert_array_equal(made[0], colours)
    np.testing.assert_allclose(row.emission.colour, RED)


def test_packing() -> None:
    closures = [
        [diffuse(RED)],
        [principled(Metallic=(0.5,), Alpha=(0.5,))],
        [Closure("EMISSION", {"Color": RED, "Strength": (2.0,)})],
    ]
    rows = [make_row(str(i), shade(part, [], PLAIN), i, as_constant) for i, part in enumerate(closures)]
    materials = pack_materials(rows)
    assert materials.names == ("0", "1", "2")
    assert materials.albedo.dtype == materials.emission.dtype == materials.lobes.color.dtype == np.float32
    np.testing.assert_allclose(materials.emission, [[0, 0, 0], [0, 0, 0], np.multiply(2, RED)], rtol=1e-6)
    assert materials.lobes.material.tolist() == [1, 1, 1, 1]
    assert materials.lobes.kind.tolist() == [TRANSPARENT, MATTE, GLOSSY, GLOSSY]
    assert all(len(array) == 4 for array in vars(materials.lobes).values() if array is not None)
    empty = pack_materials([])
    assert empty.albedo.shape == (0, 3)
    assert empty.lobes.color.shape == (0, 3)


def test_what_does_nothing_to_light() -> None:
    clear = Closure("TRANSPARENT", {"Color": (1.0, 1.0, 1.0)})
    tinted = Closure("TRANSPARENT", {"Color": (1.0, 0.9, 1.0)})
    assert lets_light_pass(shade([clear], [], PLAIN))
    assert not lets_light_pass(shade([tinted], [], PLAIN))
    assert not lets_light_pass(shade([clear, diffuse(RED)], [], PLAIN))
    assert not lets_light_pass(shade([], [], PLAIN))


def test_a_lobes_weight_is_what_is_not_its_own_colour() -> None:
    mask = np.array([[0.2], [0.6]])
    metal = Closure(
        "METALLIC", {"Color": RED, "Edge Tint": (1.0, 1.0, 1.0), "Roughness": (0.5,)}, (Factor(Leaf(0)), Factor((0.5,)))
    )
    row = make_row("Row", shade([metal, principled(Metallic=(0.3,))], [mask], PLAIN), 0, as_constant)
    lobes = pack_materials([row]).lobes
    assert lobes.weight is not None
    glossy = lobes.kind == GLOSSY
    np.testing.assert_allclose(lobes.weight[glossy], [[0.3] * 3, [0.3] * 3, [0.7] * 3], rtol=1e-6)
    assert (lobes.color <= lobes.weight)[glossy].all()
    assert (lobes.second <= lobes.weight * (1 + 1e-6))[glossy].all()


def test_views_are_tabulated_at_even_steps() -> None:
    facing = Factor((0.5,), True, "FACING")
    closures = [Closure("GLOSSY", {"Color": RED, "Roughness": (0.5,)}, weight) for weight in ((), (facing,))]
    lobes = pack_materials([make_row("Row", shade(closures, [], PLAIN), 0, as_constant)]).lobes
    assert lobes.view is not None
    np.testing.assert_array_equal(lobes.view[0], 1.0)
    # The factor is μ, its mean ⅔; the outermost values are those of the outermost directions.
    steps = 1.5 * np.linspace(0, 1, VIEW_STEPS)
    np.testing.assert_allclose(lobes.view[1], np.tile(steps[:, None], 3), atol=2.1e-3)
