# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds, over a floor with two walls and a card that casts a shadow."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from .nodes import Colour, Maker, Value, mix, node, ramp, set_world
from .stage import GREEN, TESTED, Case, card, floor, plain, walls

_SKY = {"sky_type": "MULTIPLE_SCATTERING", "sun_elevation": 0.7, "sun_rotation": 0.6}


def _under(surface: Callable[[], Maker]) -> Callable[[], None]:
    def build() -> None:
        floor(plain("Floor"))
        walls()
        card(plain("Card", GREEN))
        set_world(TESTED, surface())

    return build


def _background(colour: Colour | Maker, strength: Value = 1.0) -> Maker:
    return node("Background", Color=colour, Strength=strength)


def _spot_image() -> bpy.types.Image:
    """Return an environment of dim sky and dark ground with a spot of 3 × 2 pixels that outshines it."""
    pixels = np.zeros((64, 128, 4), dtype=np.float32)
    pixels[32:] = (0.3, 0.4, 0.6, 1.0)
    pixels[:32] = (0.1, 0.08, 0.05, 1.0)
    pixels[50:52, 40:43] = (300.0, 250.0, 200.0, 1.0)
    made = bpy.data.images.new(TESTED, 128, 64, float_buffer=True)
    made.pixels.foreach_set(pixels.ravel())
    made.update()
    return made


def _direction(output: str) -> Maker:
    return node("SeparateXYZ", 2, Vector=node("TexCoord", output))


def _camera_only() -> Maker:
    return mix(node("LightPath", "Is Camera Ray"), _background((0.7, 0.5, 0.3)), _background((0.0, 5.0, 0.0)))


CASES = (
    Case("world: one colour", _under(lambda: _background((0.7, 0.5, 0.3)))),
    Case(
        "world: sky without sun disc",
        _under(lambda: _background(node("TexSky", settings={**_SKY, "sun_disc": False}), 0.2)),
    ),
    Case(
        "world: sky with sun disc",
        _under(lambda: _background(node("TexSky", settings={**_SKY, "sun_disc": True}), 0.05)),
    ),
    Case(
        "world: image with a bright spot",
        _under(lambda: _background(node("TexEnvironment", settings={"image": _spot_image()}))),
    ),
    Case(
        "world: gradient by Generated",
        _under(lambda: _background(ramp(_direction("Generated"), (0.0, (0.6, 0.2, 0.1)), (0.8, (0.2, 0.5, 1.0))))),
    ),
    Case(
        "world: gradient by Normal",
        _under(lambda: _background(ramp(_direction("Normal"), (0.0, (0.6, 0.2, 0.1)), (0.8, (0.2, 0.5, 1.0))))),
    ),
    Case("world: noise", _under(lambda: _background(node("TexNoise", "Color", Scale=2.0)))),
    Case("world: another colour for the camera", _under(_camera_only)),
    Case(
        "world: dark to diffuse rays",
        _under(
            lambda: mix(node("LightPath", "Is Diffuse Ray"), _background((3.0, 0.5, 0.3)), _background((0.2, 0.4, 0.6)))
        ),
    ),
    Case(
        "world: mixed backgrounds",
        _under(lambda: mix(0.3, _background((1.0, 0.2, 0.2)), _background((0.2, 0.2, 1.0), 2.0))),
    ),
    Case("world: a colour as surface", _under(lambda: node("RGB"))),
)
