"""The scene as arrays: what the photon walk needs, and nothing of Blender.

Lengths are metres, powers watts, colours linear RGB (Cycles' scene-linear), positions in world
space. Arrays are C-contiguous; ``float32`` and ``int32`` unless said otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

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
        RGB, first row at v = 0; linear, or sRGB-encoded where `encoded` says so.
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


@dataclass(frozen=True)
class Materials:
    """Diffuse reflection and emission of each material, as arrays indexed by material.

    Parameters
    ----------
    names : tuple of m str
    albedo : (m, 3) float32
        Diffuse reflectance ρ in [0, 1]. Where there is a texture it multiplies the texture.
    texture : (m,) int32
        Index into `Scene.textures`, or `NO_TEXTURE`.
    emission : (m, 3) float32
        Radiance that both sides emit, W/(m² sr).
    """

    names: tuple[str, ...]
    albedo: Float32
    texture: Int32
    emission: Float32


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
    """

    name: str
    geometry: Geometry
    materials: Materials
    textures: tuple[Texture, ...]
    lights: Lights
    objects: tuple[str, ...]
    diffuse_visible: NDArray[np.bool_]
    notices: tuple[Notice, ...] = field(default=())
