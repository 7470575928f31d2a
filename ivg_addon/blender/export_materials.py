# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials as arrays: each Blender material is read once, at its first use."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..core.atlas import Atlas
from ..core.closures import Caustics, Closure, default_principled
from ..core.instancing import LIGHT_PASSES
from ..core.material_rows import (
    PROBES,
    MaterialRow,
    Quantity,
    as_constant,
    as_image,
    as_texture,
    is_proportional,
    lets_light_pass,
    make_row,
    pack_materials,
)
from ..core.report import Notice, merge
from ..core.scene import Materials, Texture
from ..core.shade import shade
from .export_colours import SHADOW_RAY, Float64, Notes
from .export_images import ImageTable, ImageUse
from .export_needs import is_missing
from .export_nodes import STAND_IN
from .export_surface import SurfaceTree, read_surface

_DEFAULT_COLOUR = (float(np.float32(0.8)),) * 3
"""To the bit that of a new material."""
_LOST = 0.02
"""Share of light whose loss is said."""
_WRONG = {
    "NaN": "has values that are not numbers: taken as 0",
    "negative": "has negative values: taken as 0",
    "bright": "reflects more light than it receives: scaled down, or light would grow at each bounce",
}


@dataclass(frozen=True)
class Unevaluated:
    """A material with leaves that are still to be evaluated.

    Parameters
    ----------
    row
        Its index among the materials; that of its back, if it has one, is the next.
    name
        The datablock's name.
    identity
        Its `session_uid`.
    """

    row: int
    name: str
    identity: int
    tree: SurfaceTree


@dataclass(frozen=True)
class Evaluated:
    """Values of a material's leaves.

    Parameters
    ----------
    atlas
        Where triangles find them.
    texels : (k,) int64
        See `Atlas.texels`.
    leaves
        (k, 3) or (k, 1) each.
    """

    atlas: Atlas
    texels: np.ndarray
    leaves: Sequence[Float64]


def caustics_of(scene: bpy.types.Scene) -> Caustics:
    """Return which lobes a scene's render settings keep for light that was diffusely reflected."""
    cycles = getattr(scene, "cycles", None)  # absent where Cycles is disabled
    return Caustics(
        bool(getattr(cycles, "caustics_reflective", True)), bool(getattr(cycles, "caustics_refractive", True))
    )


class MaterialTable:
    """The materials of a scene, as they are met.

    Parameters
    ----------
    scene
        Whose render settings count; evaluated.
    override
        The view layer's material override, if any: it takes the place of every material.
    evaluate
        Leaves will be evaluated; else something simple is taken in their place, and said.
    to_camera
        As camera rays see them: with the glossy lobes and layers that surfaces have not, to light that was diffusely
        reflected, where caustics are switched off.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        override: bpy.types.Material | None = None,
        evaluate: bool = False,
        to_camera: bool = False,
    ) -> None:
        self._caustics = Caustics() if to_camera else caustics_of(scene)
        self._override = override
        self._evaluate = evaluate
        self._images = ImageTable()
        self._index: dict[str, int] = {}
        self._uv_maps: dict[int, str] = {}
        self._rows: list[MaterialRow | None] = []
        self._names: list[str] = []
        self._notices: list[Notice] = []
        self._shadowless: set[int] = set()
        self.unevaluated: dict[int, Unevaluated] = {}

    def index(self, material: bpy.types.Material | None) -> int:
        """Return a material's index, or `LIGHT_PASSES`; None is Cycles' default."""
        material = self._override or material
        key = "" if material is None else str(material.name_full)
        if key not in self._index:
            self._index[key] = self._add(material)
        return self._index[key]

    def casts_shadow(self, index: int) -> bool:
        """Tell whether a material stops shadow rays at all."""
        return index not in self._shadowless

    def uv_map(self, index: int) -> str | None:
        """Return the UV map that a material's image lies on ("" the active one), None without image."""
        return self._uv_maps.get(index)

    def finish(self, evaluated: Mapping[int, Evaluated]) -> tuple[Materials, tuple[Texture, ...], tuple[Notice, ...]]:
        """Return all materials met, their textures and what is to be said; touches no Blender data.

        Parameters
        ----------
        evaluated
            Values for each of `unevaluated`, by the same key; those that are missing reflect nothing.
        """
        textures = list(self._images.textures)
        for row, pending in self.unevaluated.items():
            values = evaluated.get(row)
            if values is None:
                self._fill(row, pending.name, pending.tree, [np.zeros((1, 3))] * len(pending.tree.leaves), as_constant)
                continue
            adding = _TextureList(textures, pending.name, values)
            self._fill(row, pending.name, pending.tree, values.leaves, as_texture(adding))
        rows = [row for row in self._rows if row is not None]
        return pack_materials(rows), tuple(textures), merge((*self._notices, *self._images.notices))

    @property
    def read_directly(self) -> int:
        """Return how many materials need no evaluation."""
        return len(self._index) - len(self.unevaluated)

    def _add(self, material: bpy.types.Material | None) -> int:
        """Read a material; return its index, or `LIGHT_PASSES`."""
        name = "(none)" if material is None or STAND_IN in material else str(material.name)
        notes = Notes(f"material '{name}'")
        shadowless = False
        if material is None:
            tree = SurfaceTree((default_principled(_DEFAULT_COLOUR),))
        elif material.node_tree is None:
            red, green, blue, _ = material.diffuse_color
            tree = SurfaceTree((Closure("DIFFUSE", {"Color": (red, green, blue), "Roughness": (0.0,)}),))
        else:
            tree = read_surface(material, notes)
            shadowless = bool(tree.needs.paths & set(SHADOW_RAY)) and self._is_clear(
                read_surface(material, Notes(""), SHADOW_RAY)
            )
            if shadowless:
                notes = Notes(f"material '{name}'")
                tree = read_surface(material, notes, settled=SHADOW_RAY)
        self._notices += notes.notices
        if self._is_clear(tree):
            return LIGHT_PASSES
        row = len(self._names)
        if shadowless:
            self._shadowless.add(row)
        sides = 1 if tree.back is None else 2
        self._names += [name] * sides
        self._rows += [None] * sides
        image = self._single_image(tree)
        if not tree.leaves:
            self._fill(row, name, tree, [], as_constant)
        elif image is not None:
            self._fill(row, name, tree, [PROBES] * len(tree.leaves), as_image(self._images.texture(image)))
            self._uv_maps[row] = image.uv_map
            self._note_bright(row, image)
        elif self._evaluate and material is not None:
            for leaf in tree.leaves:
                if leaf.image is not None and leaf.image.image is not None and is_missing(leaf.image.image):
                    what = f"{leaf.name}: image '{leaf.image.name}' cannot be read: magenta, as in Cycles"
                    self._notices.append(Notice("warning", f"material '{name}'", what))
            self.unevaluated[row] = Unevaluated(row, name, int(material.original.session_uid), tree)
        else:
            self._fill(row, name, tree, self._instead(tree, notes), as_constant)
            self._notices += notes.notices
        return row

    def _is_clear(self, tree: SurfaceTree) -> bool:
        """Tell whether light passes as if nothing were there."""
        sides = (tree.front,) if tree.back is None else (tree.front, tree.back)
        return not tree.leaves and all(lets_light_pass(shade(side, [], self._caustics)) for side in sides)

    def _single_image(self, tree: SurfaceTree) -> ImageUse | None:
        """Return the image, if there is one, that all of a surface is proportional to."""
        uses = {leaf.image for leaf in tree.leaves}
        if len(uses) != 1 or None in uses:
            return None
        if self._evaluate and any(use is not None and _has_tiles(use.image) for use in uses):
            return None
        probes = [PROBES] * len(tree.leaves)
        sides = (tree.front,) if tree.back is None else (tree.front, tree.back)
        if not all(is_proportional(shade(side, probes, self._caustics)) for side in sides):
            return None
        return uses.pop()

    def _note_bright(self, row: int, image: ImageUse) -> None:
        """Say so where an image makes a surface reflect more than all light."""
        made = self._rows[row]
        if made is not None and self._images.brightest(image) * np.max(made.albedo.colour, initial=0.0) > 1.0:
            message = f"image '{image.name}' reflects above 1 in places: clamped there"
            self._notices.append(Notice("warning", f"material '{made.name}'", message))

    def _instead(self, tree: SurfaceTree, notes: Notes) -> list[Float64]:
        """Return something simple in place of leaves: an image's mean, or the socket's own value."""
        values = []
        for leaf in tree.leaves:
            if leaf.image is not None:
                notes.add("simplified", f"{leaf.name}: mean colour of image '{leaf.image.name}' taken")
                values.append(self._images.mean(leaf.image)[None])
            else:
                own = ", ".join(f"{value:.3g}" for value in leaf.fallback)
                notes.add("simplified", f"{leaf.name}: its own value ({own}) taken instead of its nodes")
                values.append(np.array([leaf.fallback]))
        return values

    def _fill(
        self,
        row: int,
        name: str,
        tree: SurfaceTree,
        leaves: Sequence[Float64],
        quantity: Callable[[Float64], Quantity],
    ) -> None:
        """Make a material's rows of the values of its leaves."""
        sides = [tree.front] if tree.back is None else [tree.front, tree.back]
        for side, closures in enumerate(sides):
            shading, wrong = shade(closures, leaves, self._caustics).sound()
            for kind in _WRONG:
                if kind in wrong:
                    self._notices.append(Notice("warning", f"material '{name}'", _WRONG[kind]))
            lost = sum(lobe.lost_at_rims() for lobe in shading.lobes)
            if lost >= _LOST:
                what = f"smooth reflection by bumps: about {lost:.0%} of the light, seen at grazing angles, is left out"
                self._notices.append(Notice("simplified", f"material '{name}'", what))
            back = row + 1 if tree.back is not None else row
            self._rows[row + side] = make_row(name, shading, back, quantity)


def _has_tiles(image: bpy.types.Image | None) -> bool:
    return image is not None and image.source == "TILED" and len(image.tiles) > 1


class _TextureList:
    """Adds textures of evaluated values to a list, equal ones once."""

    def __init__(self, textures: list[Texture], name: str, values: Evaluated) -> None:
        self._textures = textures
        self._name = name
        self._values = values
        self._known: dict[bytes, int] = {}

    def __call__(self, values: Float64) -> int:
        """Return the index of a texture of values (k, 3)."""
        key = values.tobytes()
        if key not in self._known:
            self._known[key] = len(self._textures)
            pixels = self._values.atlas.image(self._values.texels, values)
            self._textures.append(Texture(f"material '{self._name}'", pixels, interpolate=False, extension="EXTEND"))
        return self._known[key]
