# SPDX-License-Identifier: GPL-3.0-or-later
"""Closures: sums of weighted lobes, and what they may not do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ivg_addon.core.closures import VIEWS, Caustics, Closure, Directed, Factor, Leaf, Value, default_principled
from ivg_addon.core.principled import (
    COSINE_WEIGHTS,
    COSINES,
    Layers,
    coat_share,
    diffuse_share,
    mean_reflectance,
    oren_nayar_share,
    through_layers,
)
from ivg_addon.core.scene import DIELECTRIC, GLASS, GLOSSY, MATTE, NONE, REFRACTION, SCHLICK, TRANSLUCENT, TRANSPARENT
from ivg_addon.core.shade import shade

RED = (0.8, 0.1, 0.05)
PLAIN = Caustics()


def principled(**values: Value) -> Closure:
    """Return a Principled BSDF as it is when it is added, but for some inputs named with underscores."""
    added = default_principled(RED)
    return replace(added, inputs={**added.inputs, **{name.replace("_", " "): value for name, value in values.items()}})


def diffuse(colour: Value, *weight: Factor, roughness: Value = (0.0,)) -> Closure:
    return Closure("DIFFUSE", {"Color": colour, "Roughness": roughness}, weight)


def test_weights_multiply_and_closures_add() -> None:
    half, third = Factor((0.5,)), Factor((1 / 3,), complement=True)
    shading = shade([diffuse(RED, half, third), diffuse((0.3, 0.3, 0.3))], [], PLAIN)
    np.testing.assert_allclose(shading.albedo, [np.array(RED) / 3 + 0.3])
    assert shading.lobes == ()


def test_leaves_are_taken_point_by_point() -> None:
    rng = np.random.default_rng(0)
    colour, mask, roughness = rng.random((100, 3)), rng.random((100, 1)), rng.random((100, 1))
    shading = shade([diffuse(Leaf(0), Factor(Leaf(1)), roughness=Leaf(2))], [colour, mask, roughness], PLAIN)
    each = [oren_nayar_share(colour[i], float(roughness[i, 0])) * colour[i] * mask[i] for i in range(100)]
    np.testing.assert_allclose(shading.albedo, each, rtol=1e-6)


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"roughness": 0.1, "ior": 1.8},
        {"specular_ior_level": 0.9, "metallic": 0.4, "transmission": 0.3},
        {"coat": 0.7, "coat_roughness": 0.2, "coat_tint": (0.9, 0.5, 0.4)},
    ],
)
def test_principled_shares_its_light_as_cycles_does(values: dict[str, object]) -> None:
    """Against `principled`, which is held against Cycles."""
    layers = Layers(**values)  # type: ignore[arg-type]
    closure = principled(
        Metallic=(layers.metallic,),
        Transmission_Weight=(layers.transmission,),
        Roughness=(layers.roughness,),
        IOR=(layers.ior,),
        Specular_IOR_Level=(layers.specular_ior_level,),
        Coat_Weight=(layers.coat,),
        Coat_Roughness=(layers.coat_roughness,),
        Coat_Tint=layers.coat_tint,
        Emission_Strength=(2.0,),
    )
    shading = shade([closure], [], PLAIN)
    np.testing.assert_allclose(shading.albedo[0], diffuse_share(layers) * RED, rtol=1e-9)
    np.testing.assert_allclose(shading.emission[0], 2 * coat_share(layers), rtol=1e-9)


def test_a_white_principled_reflects_all_light() -> None:
    """Whatever its layers: what they reflect is what they keep from the diffuse lobe, to 1 %."""
    for roughness in (0.0, 0.2, 0.5, 1.0):
        for metallic in (0.0, 0.5, 1.0):
            closure = principled(Base_Color=(1.0, 1.0, 1.0), Roughness=(roughness,), Metallic=(metallic,))
            np.testing.assert_allclose(shade([closure], [], PLAIN).total(), 1.0, atol=0.01)


def test_principled_with_values_that_vary_is_rounded_only_a_little() -> None:
    rng = np.random.default_rng(1)
    roughness, metallic = rng.random((4000, 1)), rng.random((4000, 1))
    shading = shade([principled(Roughness=Leaf(0), Metallic=Leaf(1))], [roughness, metallic], PLAIN)
    for i in range(0, 4000, 400):
        layers = Layers(roughness=float(roughness[i, 0]), metallic=float(metallic[i, 0]))
        np.testing.assert_allclose(shading.albedo[i], diffuse_share(layers) * RED, atol=2e-3)


def test_lobes_of_a_principled() -> None:
    closure = principled(Metallic=(0.25,), Transmission_Weight=(0.5,), Alpha=(0.8,), Coat_Weight=(0.5,))
    lobes = shade([closure], [], PLAIN).lobes
    assert [(lobe.kind, lobe.fresnel) for lobe in lobes] == [
        (TRANSPARENT, 0),
        (GLOSSY, DIELECTRIC),
        (MATTE, NONE),
        (GLOSSY, SCHLICK),
        (GLOSSY, DIELECTRIC),
        (GLASS, DIELECTRIC),
    ]
    under = 0.8 * coat_share(Layers(coat=0.5))
    np.testing.assert_allclose(lobes[0].color, 0.2)
    np.testing.assert_allclose(lobes[1].color, 0.8 * 0.5 * 0.04)
    np.testing.assert_allclose(lobes[3].color, [under * 0.25 * RED])
    np.testing.assert_allclose(lobes[3].second, [under * 0.25])
    np.testing.assert_allclose(lobes[4].color, [under * 0.75 * 0.5 * 0.04])
    np.testing.assert_allclose(lobes[5].color, [under * 0.75 * 0.5])
    np.testing.assert_allclose(lobes[5].second, [under * 0.75 * 0.5 * np.sqrt(RED)])


def test_layers_take_their_share_by_the_direction_of_view() -> None:
    """What all directions get is what the lobe is said to reflect; how it is spread is the layers' transmittance."""
    layers = Layers(coat=1.0, coat_tint=(0.9, 0.6, 0.5), roughness=0.3)
    closure = principled(Coat_Weight=(1.0,), Coat_Tint=layers.coat_tint, Roughness=(0.3,))
    shading = shade([closure], [], PLAIN)
    (matte,) = (lobe for lobe in shading.lobes if lobe.kind == MATTE)
    assert matte.view is not None
    np.testing.assert_allclose(matte.color * matte.view, RED * through_layers(layers), rtol=1e-9)
    np.testing.assert_allclose(COSINE_WEIGHTS @ matte.view, 1.0, rtol=1e-9)
    # Of what is reflected above the coat nothing is taken.
    views = [lobe.view is None for lobe in shading.lobes]
    assert views == [True, False, False]


def test_a_colour_by_the_direction_of_view_is_seen_through_layers_and_mixes() -> None:
    """Of two functions of the direction the product counts, whose mean is not that of the means."""
    colour = Directed(tuple(Leaf(index) for index in range(len(VIEWS))))
    leaves = [np.array([[0.2 + 0.6 * view, 0.9 - 0.9 * view, 0.5]]) for view in VIEWS]
    looks = np.stack([0.2 + 0.6 * COSINES, 0.9 - 0.9 * COSINES, np.full_like(COSINES, 0.5)], axis=1)
    (matte,) = (lobe for lobe in shade([principled(Base_Color=colour)], leaves, PLAIN).lobes if lobe.kind == MATTE)
    np.testing.assert_allclose(matte.color * matte.view, looks * through_layers(Layers()), rtol=1e-9)
    (mixed,) = shade([diffuse(colour, Factor((0.5,), shape="FACING"))], leaves, PLAIN).lobes
    (curve,) = (
        lobe.color * lobe.view for lobe in shade([diffuse((1, 1, 1), Factor((0.5,), shape="FACING"))], [], PLAIN).lobes
    )
    np.testing.assert_allclose(mixed.color * mixed.view, looks * curve, rtol=1e-9)


def test_a_mix_by_fresnel_is_one_of_directions() -> None:
    fresnel, facing = Factor((1.5,), shape="FRESNEL"), Factor((0.25,), complement=True, shape="FACING")
    shading = shade([diffuse(RED, fresnel), diffuse(RED, Factor((1.5,), True, "FRESNEL"))], [], PLAIN)
    np.testing.assert_allclose(shading.albedo, [RED])
    assert [lobe.kind for lobe in shading.lobes] == [MATTE, MATTE]
    np.testing.assert_allclose(sum(lobe.color * lobe.view for lobe in shading.lobes), np.tile(RED, (32, 1)))
    np.testing.assert_allclose(shading.lobes[0].color, [np.multiply(mean_reflectance(1.5), RED)])
    (glossy,) = shade([Closure("GLOSSY", {"Color": RED, "Roughness": (0.2,)}, (facing, facing))], [], PLAIN).lobes
    # (1 − (1 − √μ))² = μ, whose mean is ⅔.
    np.testing.assert_allclose(glossy.color, [np.multiply(2 / 3, RED)])
    np.testing.assert_allclose(glossy.view, np.tile(1.5 * COSINES[:, None], 3))
    shining = Closure("EMISSION", {"Color": RED, "Strength": (3.0,)}, (facing, facing))
    np.testing.assert_allclose(shade([shining], [], PLAIN).emission, [np.multiply(2.0, RED)])


def test_without_caustics_there_are_no_glossy_lobes() -> None:
    closures = [
        principled(Metallic=(0.25,), Transmission_Weight=(0.5,)),
        Closure("GLOSSY", {"Color": RED, "Roughness": (0.0,)}),
        Closure("REFRACTION", {"Color": RED, "Roughness": (0.0,), "IOR": (1.5,)}),
        Closure("TRANSLUCENT", {"Color": RED}),
    ]
    lobes = shade(closures, [], Caustics(reflective=False, refractive=False)).lobes
    assert [lobe.kind for lobe in lobes] == [TRANSLUCENT]
    lobes = shade(closures, [], Caustics(reflective=False)).lobes
    assert [lobe.kind for lobe in lobes] == [GLASS, REFRACTION, TRANSLUCENT]
    np.testing.assert_array_equal(lobes[0].color, 0.0)


def test_a_metal_may_be_given_by_its_index() -> None:
    """|(n + ik − 1)/(n + ik + 1)|²."""
    inputs = {"IOR": (0.16, 1.0, 1.5), "Extinction": (3.15, 0.0, 0.0), "Roughness": (0.1,)}
    (lobe,) = shade([Closure("METALLIC", inputs)], [], PLAIN).lobes
    np.testing.assert_allclose(lobe.color, [[abs((0.16 + 3.15j - 1) / (0.16 + 3.15j + 1)) ** 2, 0.0, 0.04]])


def test_equal_lobes_are_one() -> None:
    glossy = Closure("GLOSSY", {"Color": RED, "Roughness": (0.2,)}, (Factor((0.25,)),))
    rougher = Closure("GLOSSY", {"Color": RED, "Roughness": (0.3,)}, (Factor((0.25,)),))
    lobes = shade([glossy, glossy, rougher], [], PLAIN).lobes
    assert len(lobes) == 2
    np.testing.assert_allclose(lobes[0].color, [np.multiply(0.5, RED)])


@pytest.mark.parametrize(
    ("colour", "kept", "wrong"),
    [
        ((np.nan, 0.5, 0.5), (0, 0.5, 0.5), {"NaN"}),
        ((np.inf, 0.5, 0.5), (0, 0.5, 0.5), {"NaN"}),
        ((-1.0, 0.5, 0.5), (0, 0.5, 0.5), {"negative"}),
        ((2.0, 1.0, 0.5), (1, 1, 0.5), {"bright"}),
        ((1.0, 1.0, 1.0), (1, 1, 1), set()),
    ],
)
def test_soundness(colour: tuple[float, ...], kept: tuple[float, ...], wrong: set[str]) -> None:
    shading, found = shade([diffuse(colour)], [], PLAIN).sound()
    np.testing.assert_allclose(shading.albedo, [kept])
    assert found == wrong


def test_emission_is_not_limited() -> None:
    bright = Closure("EMISSION", {"Color": RED, "Strength": (1e9,)})
    shading, found = shade([bright], [], PLAIN).sound()
    np.testing.assert_allclose(shading.emission, [np.multiply(1e9, RED)])
    assert not found
