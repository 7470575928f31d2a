# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as arrays: what the photon walk needs, and nothing of Blender.

Lengths are metres, powers watts, colours linear RGB (Cycles' scene-linear), positions in world
space. Arrays are C-contiguous; ``float32`` and ``int32`` unless said otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .checksum import checksum
from .light_rules import LightRules
from .lights import Lights
from .report import Notice

Float32 = NDArray[np.float32]
Int32 = NDArray[np.int32]

NO_TEXTURE = -1


@dataclass(frozen=True)
class Geometry:
    """All triangles of a scene, instances flattened, in world space.

    Parameters
    ----------
    vertices : (nv, 3) float32
    triangles : (nt, 3) int32
        Vertex indices; counter-clockwise seen from the front side.
    corner_normals : (nt, 3, 3) float32
        Unit shading normal at each triangle's corners, on the front side. Flat triangles repeat
        their geometric normal.
    uvs : (nt, 3, 2) float32
        Texture coordinates at the corners, in the UV map that the triangle's material reads; zero
        where it reads none.
    material : (nt,) int32
        Index into `Materials`.
    object : (nt,) int32
        Index into `Scene.objects`.
    """

    vertices: Float32
    triangles: Int32
    corner_normals: Float32
    uvs: Float32
    material: Int32
    object: Int32

    @property
    def triangle_count(self) -> int:
        """Return the number of triangles."""
        return len(self.triangles)

    def bounds(self) -> tuple[Float32, Float32]:
        """Return the smallest axis-aligned box around the triangles: (min (3,), max (3,))."""
        used = self.vertices[self.triangles.reshape(-1)]
        return used.min(axis=0), used.max(axis=0)


@dataclass(frozen=True)
class Texture:
    """An image, looked up bilinearly (or at the nearest texel) at texture coordinates.

    Parameters
    ----------
    name
        The image datablock's name.
    pixels : (height, width, 3) float32
        RGB, not negative unless it holds normals, first row at v = 0; linear, or sRGB-encoded where `encoded` says so.
    interpolate
        Bilinear; False takes the nearest texel.
    extension
        "REPEAT", "EXTEND" (edge texels go on), "CLIP" (black outside) or "MIRROR".
    encoded
        Pixels are sRGB-encoded, and decoded after interpolation: Cycles does it in this order.
    """

    name: str
    pixels: Float32
    interpolate: bool = True
    extension: str = "REPEAT"
    encoded: bool = False


def _none(*shape: int, kind: type = np.float32) -> NDArray[Any]:
    return np.zeros((0, *shape), dtype=kind)


@dataclass(frozen=True)
class Lobes:
    """Ways in which materials scatter light besides diffuse reflection: l rows, sorted by material.

    What a lobe reflects or lets through is, with f its Fresnel factor at a microfacet, 0 at normal and 1 at grazing
    incidence:

        GLOSSY       color + (second − color) f − edge second μ (1 − μ)⁶        (NONE: color; edge with SCHLICK only)
        GLASS        F color reflected, (1 − F) second refracted, F the dielectric reflectance of `ior`
        REFRACTION   color, all of it refracted
        TRANSLUCENT  color, with a cosine on the other side
        TRANSPARENT  color, straight on
        MATTE        color, about as a rough diffuse surface of albedo `second` would; see `matte`
        PANE         color, through a thin wall: a glossy reflection, mirrored to the other side
        SHEEN        color, as `sheen` has it; `view` is to hold how that depends on the direction of view

    A lobe may look different from direction to direction: it then sends `view` times as much.

    Parameters
    ----------
    material : (l,) int32
        Index into `Materials`, never decreasing.
    kind : (l,) int32
        One of `GLOSSY`, `GLASS`, `REFRACTION`, `TRANSLUCENT`, `TRANSPARENT`, `MATTE`, `SHEEN`, `PANE`. Where a material
        has matte lobes they are all of its diffuse reflection, and `Materials.albedo` says how much that is.
    color, second : (l, 3) float32
        Linear RGB, the lobe's weight in the material included; see above.
    color_texture, second_texture : (l,) int32
        Textures that multiply them, or `NO_TEXTURE`.
    roughness : (l,) float32
        Square root of GGX's α, in [0, 1]; 0 is a mirror. Of a matte lobe Oren and Nayar's, 0 is a cosine.
    roughness_texture : (l,) int32
        A texture whose red channel multiplies it, or `NO_TEXTURE`.
    ior : (l,) float32
        Index of refraction, of what lies behind the front over what lies before it. A glossy lobe has the same on both
        sides.
    fresnel : (l,) int32
        `NONE`, `SCHLICK` or `DIELECTRIC`: the shape of f of a glossy lobe.
    multiscatter : (l,) bool
        Light that bounces between facets is not lost ("Multiscatter GGX").
    weight : (l, 3) float32, optional
        The factor in `color` and `second` that is the lobe's weight in the material; ones where this is not given.
        Light that bounces between facets is coloured by the rest, several times.
    view : (l, VIEW_STEPS, 3) float32, optional
        Factor of what is sent towards directions at cosines 0 … 1 to the shading normal, linear in between;
        ∫ view 2μ dμ = 1. Ones where this is not given.
    edge : (l, 3) float32, optional
        How far a metal's curve stays behind Schlick's before grazing incidence, or is ahead of it where negative;
        zeros where this is not given.
    bump : (l,) int32, optional
        Where the lobe has a normal of its own, what that is: flags of `bumps`. Zeros where this is not given.
    normal : (l, 3) float32, optional
        That normal relative to the surface, see `bumps`.
    normal_texture : (l,) int32, optional
        A texture that multiplies it, or `NO_TEXTURE`; none has one where this is not given.
    """

    material: Int32 = field(default_factory=lambda: _none(kind=np.int32))
    kind: Int32 = field(default_factory=lambda: _none(kind=np.int32))
    color: Float32 = field(default_factory=lambda: _none(3))
    color_texture: Int32 = field(default_factory=lambda: _none(kind=np.int32))
    second: Float32 = field(default_factory=lambda: _none(3))
    second_texture: Int32 = field(default_factory=lambda: _none(kind=np.int32))
    roughness: Float32 = field(default_factory=lambda: _none())
    roughness_texture: Int32 = field(default_factory=lambda: _none(kind=np.int32))
    ior: Float32 = field(default_factory=lambda: _none())
    fresnel: Int32 = field(default_factory=lambda: _none(kind=np.int32))
    multiscatter: NDArray[np.bool_] = field(default_factory=lambda: _none(kind=np.bool_))
    weight: Float32 | None = None
    view: Float32 | None = None
    edge: Float32 | None = None
    bump: Int32 | None = None
    normal: Float32 | None = None
    normal_texture: Int32 | None = None


VIEW_STEPS = 65
GLOSSY, GLASS, REFRACTION, TRANSLUCENT, TRANSPARENT, MATTE, SHEEN, PANE = range(8)
"""Kinds of lobes."""
LETTING_THROUGH = (GLASS, REFRACTION, TRANSLUCENT, TRANSPARENT, PANE)
"""Those by which light goes through; glass reflects too, all others do nothing else."""
NONE, SCHLICK, DIELECTRIC = range(3)
"""Shapes of a glossy lobe's Fresnel factor: constant; (1 − cos θ)⁵; that of a dielectric of the lobe's IOR."""


@dataclass(frozen=True)
class Materials:
    """What surfaces do with light, as arrays indexed by material.

    A material describes the side that its triangles show to the front; the side seen from behind may be another row.
    "Seen" is meant as Cycles means it, from where light goes to: what is reflected is described by the side that light
    meets, what is let through by the side that it leaves by.

    Parameters
    ----------
    names : tuple of m str
    albedo : (m, 3) float32
        Diffuse reflectance ρ in [0, 1]. Where there is a texture it multiplies the texture.
    texture : (m,) int32
        Index into `Scene.textures`, or `NO_TEXTURE`.
    emission : (m, 3) float32
        Radiance, W/(m² sr). Where there is a texture it multiplies the texture.
    emission_texture : (m,) int32, optional
        Index into `Scene.textures`, or `NO_TEXTURE`; none has one where this is not given.
    emission_view : (m, VIEW_STEPS, 3) float32, optional
        Factor of what is emitted towards directions at cosines 0 … 1 to the surface, linear in between;
        ∫ view 2μ dμ = 1. Ones where this is not given.
    back : (m,) int32, optional
        The material that describes the back side; without it both sides of each are alike.
    lobes
        What is scattered otherwise than by diffuse reflection.
    """

    names: tuple[str, ...]
    albedo: Float32
    texture: Int32
    emission: Float32
    emission_texture: Int32 | None = None
    back: Int32 | None = None
    lobes: Lobes = field(default_factory=Lobes)
    emission_view: Float32 | None = None


@dataclass(frozen=True)
class SurfaceRecord:
    """Where the materials and the world of a scene came from.

    Parameters
    ----------
    direct
        How many were read as they are: constants, and images on UV maps.
    evaluated, recalled
        How many Cycles evaluated, and how many it had evaluated before.
    seconds
        What evaluating took.
    world_seconds
        What evaluating the world took; 0 if it had been evaluated before, None if it was read as it is.
    """

    direct: int = 0
    evaluated: int = 0
    recalled: int = 0
    seconds: float = 0.0
    world_seconds: float | None = None


@dataclass(frozen=True)
class Scene:
    """Everything that a bake reads.

    Parameters
    ----------
    name
        The Blender scene's name.
    diffuse_visible : (objects,) bool
        False for an object that diffuse rays do not see: it casts shadows but reflects nothing.
    lights
        Every emitter: light datablocks, emissive triangles and the world.
    notices
        What the export simplified or left out.
    light_rules
        What lights do not light, or do not stop at; None where all light, and stop at, everything.
    surfaces
        Where its materials came from.
    """

    name: str
    geometry: Geometry
    materials: Materials
    textures: tuple[Texture, ...]
    lights: Lights
    objects: tuple[str, ...]
    diffuse_visible: NDArray[np.bool_]
    notices: tuple[Notice, ...] = field(default=())
    light_rules: LightRules | None = None
    surfaces: SurfaceRecord = field(default=SurfaceRecord())

    def fingerprint(self) -> str:
        """Return a checksum of all that light depends on: not of what was said of it, or how long it took to read."""
        return checksum(replace(self, notices=(), surfaces=SurfaceRecord()))
