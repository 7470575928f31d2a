# SPDX-License-Identifier: GPL-3.0-or-later
"""The diffuse lobe's share, against measurements of Cycles and against limits that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ivg_addon.core.principled import (
    COSINE_WEIGHTS,
    COSINES,
    Layers,
    coat_share,
    diffuse_share,
    layer_reflectance,
    oren_nayar_share,
)

unit = st.floats(0, 1)

# Mean of the Diffuse Color pass over a sphere seen by an orthographic camera, relative to a white Diffuse BSDF: that is
# the integral over 2μ dμ. Blender 5.2.3; 5.0.1 gave the same within 0.0001.
MEASURED = [
    (Layers(), 0.93881),
    (Layers(roughness=0.0), 0.90779),
    (Layers(roughness=0.25), 0.91602),
    (Layers(roughness=1.0), 0.97823),
    (Layers(ior=1.2), 0.97690),
    (Layers(ior=2.0), 0.87489),
    (Layers(ior=3.0), 0.75983),
    (Layers(ior=0.8), 0.96915),
    (Layers(ior=3.0, roughness=0.25), 0.73085),
    (Layers(specular_ior_level=0.25), 0.96063),
    (Layers(specular_ior_level=0.75), 0.91970),
    (Layers(specular_ior_level=1.0), 0.90140),
    (Layers(specular_tint=(1.0, 0.5, 0.2)), 0.93881),
    (Layers(metallic=0.3), 0.65716),
    (Layers(transmission=0.4), 0.56328),
    (Layers(coat=0.5), 0.89719),
]
TABLE_ERROR = 0.0015
"""What Cycles' tables of 16³ entries differ from the integrals by, at most, over the range measured."""


@pytest.mark.parametrize(("layers", "share"), MEASURED, ids=str)
def test_agrees_with_cycles(layers: Layers, share: float) -> None:
    np.testing.assert_allclose(diffuse_share(layers), share, atol=TABLE_ERROR)


def test_agrees_closely_at_the_defaults() -> None:
    assert diffuse_share(Layers())[0] == pytest.approx(0.93881, abs=1e-4)


def test_quadrature_weights_are_those_of_a_cosine() -> None:
    assert COSINE_WEIGHTS.sum() == pytest.approx(1, abs=1e-14)
    assert COSINE_WEIGHTS @ COSINES == pytest.approx(2 / 3, abs=1e-14)


@pytest.mark.parametrize("eta", [1.1, 1.5, 2.5])
def test_a_smooth_layer_is_fresnels(eta: float) -> None:
    sine = np.sqrt(1 - COSINES**2) / eta
    inside = np.sqrt(1 - sine**2)
    perpendicular = ((COSINES - eta * inside) / (COSINES + eta * inside)) ** 2
    parallel = ((eta * COSINES - inside) / (eta * COSINES + inside)) ** 2
    got = layer_reflectance(((eta - 1) / (eta + 1)) ** 2, eta, 0.0, multiscatter=False)
    # Its facets still tilt by about α = 1e-4, and reflectance changes by at most 10 per radian (at grazing angles).
    np.testing.assert_allclose(got, (perpendicular + parallel) / 2, atol=10 * 1e-4)


@given(metallic=unit, transmission=unit, ior=st.floats(1, 3), level=unit, roughness=unit, coat=unit)
@settings(max_examples=40, deadline=None)
def test_shares_are_shares(
    metallic: float, transmission: float, ior: float, level: float, roughness: float, coat: float
) -> None:
    layers = Layers(metallic, transmission, ior, level, roughness=roughness, coat=coat)
    share = diffuse_share(layers)
    assert (share >= 0).all()
    assert (share <= (1 - metallic) * (1 - transmission) + 1e-12).all()
    assert (share <= coat_share(layers) + 1e-12).all()


def test_nothing_lies_over_it_where_there_is_nothing() -> None:
    np.testing.assert_array_equal(diffuse_share(Layers(ior=1.0)), 1)
    np.testing.assert_array_equal(diffuse_share(Layers(specular_ior_level=0.0)), 1)
    np.testing.assert_array_equal(diffuse_share(Layers(specular=False)), 1)
    np.testing.assert_array_equal(diffuse_share(Layers(metallic=1.0)), 0)


# Radiance of a sphere in a white world, orthographic camera, over alpha; Blender 5.2.3, 64 samples a pixel.
@pytest.mark.parametrize(
    ("roughness", "measured"),
    [(0.0, (1.0, 0.5, 0.2)), (0.3, (0.99998, 0.47747, 0.18856)), (1.0, (0.99995, 0.43538, 0.16771))],
)
def test_rough_diffuse_reflects_what_cycles_does(roughness: float, measured: tuple[float, ...]) -> None:
    colour = np.array([1.0, 0.5, 0.2])
    got = colour * oren_nayar_share(colour, roughness)
    np.testing.assert_allclose(got, measured, atol=1e-4)
