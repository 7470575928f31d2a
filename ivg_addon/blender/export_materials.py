# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials as arrays: each Blender material is read once, at its first use."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.instancing import LIGHT_PASSES
from ..core.principled import Layers, diffuse_share
from ..core.report import Notice, merge
from ..core.scene import NO_TEXTURE, Materials, Texture
from .export_colours import ColourReader, Float64, Notes, Paint
from .export_images import ImageTable
from .export_surface import Surface, SurfaceReader

_DEFAULT_COLOUR = 0.8
"""Where there is no material Cycles takes a Principled BSDF as it is when it is added: this grey."""


class MaterialTable:
    """The materials of a scene, as they are met.

    Parameters
    ----------
    scene
        Whose render settings count; evaluated.
    override
        The view layer's material override, if any: it takes the place of every material.
    """

    def __init__(self, scene: bpy.types.Scene, override: bpy.types.Material | None = None) -> None:
        cycles = getattr(scene, "cycles", None)  # absent where Cycles is disabled
        self._caustics = bool(getattr(cycles, "caustics_reflective", True))
        self._override = override
        self._images = ImageTable()
        self._index: dict[str, int] = {}
        self._uv_maps: dict[int, str] = {}
        self._names: list[str] = []
        self._albedo: list[Float64] = []
        self._texture: list[int] = []
        self._emission: list[Float64] = []
        self._notices: list[Notice] = []

    def index(self, material: bpy.types.Material | None) -> int:
        """Return a material's index, or `LIGHT_PASSES`; None is Cycles' default."""
        material = self._override or material
        key = "" if material is None else str(material.name_full)
        if key not in self._index:
            self._index[key] = self._add(material)
        return self._index[key]

    def uv_map(self, index: int) -> str | None:
        """Return the UV map that a material's texture lies on ("" the active one), None without texture."""
        return self._uv_maps.get(index)

    def materials(self) -> Materials:
        """Return all materials met so far."""
        return Materials(
            names=tuple(self._names),
            albedo=np.array(self._albedo, dtype=np.float32).reshape(-1, 3),
            texture=np.array(self._texture, dtype=np.int32),
            emission=np.array(self._emission, dtype=np.float32).reshape(-1, 3),
        )

    @property
    def textures(self) -> tuple[Texture, ...]:
        """Return the textures that `materials` names."""
        return self._images.textures

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Return what was simplified or left out."""
        return merge((*self._notices, *self._images.notices))

    def _add(self, material: bpy.types.Material | None) -> int:
        """Read a material; return its index, or `LIGHT_PASSES`."""
        name = "(none)" if material is None else str(material.name)
        notes = Notes(f"material '{name}'")
        colours = ColourReader(self._images, notes)
        if material is None:
            layers = Layers(specular=self._caustics)
            surface = Surface((Paint(_DEFAULT_COLOUR * diffuse_share(layers)),))
            notes.add("simplified", "diffuse reflection only, without specular")
        elif material.node_tree is None:
            surface = Surface((Paint(np.array(material.diffuse_color[:3], dtype=np.float64)),))
        else:
            surface = SurfaceReader(colours, self._caustics).read(material.node_tree)
        index = LIGHT_PASSES
        if not surface.lets_light_pass:
            index = len(self._names)
            paint = _single(surface.diffuse, colours)
            self._names.append(name)
            self._albedo.append(_limited(paint, notes))
            self._texture.append(NO_TEXTURE if paint.image is None else self._images.texture(paint.image))
            self._emission.append(_radiance(surface.emission, notes))
            if paint.image is not None:
                self._uv_maps[index] = paint.image.uv_map
                if self._images.brightest(paint.image) * np.max(self._albedo[-1]) > 1.0:
                    notes.add("warning", f"image '{paint.image.name}' reflects above 1 in places: clamped there")
        self._notices += notes.notices
        return index


def _single(paints: tuple[Paint, ...], colours: ColourReader) -> Paint:
    """Return the sum of diffuse lobes: exact if at most one of them has a texture and the others none of weight."""
    paints = tuple(paint for paint in paints if paint.colour.any())
    if len(paints) == 1:
        return paints[0]
    if any(paint.image is not None for paint in paints):
        colours.notes.add("simplified", "several diffuse closures: mean colours of their images taken")
    return Paint(np.sum([colours.mean(paint) for paint in paints], axis=0) if paints else np.zeros(3))


def _limited(paint: Paint, notes: Notes) -> Float64:
    """Return a paint's colour within what a surface can reflect."""
    if not np.isfinite(paint.colour).all():
        notes.add("warning", "colour is not a number: taken as black")
        return np.zeros(3)
    limited = np.clip(paint.colour, 0.0, 1.0)
    if (limited != paint.colour).any():
        rgb = ", ".join(f"{value:.3g}" for value in paint.colour)
        notes.add("warning", f"reflectance ({rgb}) is outside 0 to 1: clamped, or light would grow at each bounce")
    return limited


def _radiance(emission: Float64, notes: Notes) -> Float64:
    """Return an emission without negative or infinite parts."""
    if not np.isfinite(emission).all():
        notes.add("warning", "emission is not a number: taken as none")
        return np.zeros(3)
    if (emission < 0.0).any():
        notes.add("warning", "emission is negative: taken as none")
    return np.maximum(emission, 0.0)
