# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray casting: the only file that knows Embree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import DependencyError
from .scene import Float32, Geometry, Int32

try:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene
except Exception as error:  # a missing shared library raises OSError or ImportError
    raise DependencyError(
        f"embreex does not load ({error}): reinstall the extension for this Blender, "
        "or `pip install embreex` for this Python"
    ) from error

MISS = -1


@dataclass(frozen=True)
class Hits:
    """Where n rays meet their first triangle.

    Parameters
    ----------
    triangle : (n,) int32
        Index of the triangle, `MISS` where there is none.
    u, v : (n,) float32
        Barycentric coordinates: the point is (1 − u − v)·p₀ + u·p₁ + v·p₂.
    distance : (n,) float32
        In units of the direction's length; 1e37 for a miss.
    """

    triangle: Int32
    u: Float32
    v: Float32
    distance: Float32


class Tracer:
    """A geometry's acceleration structure. Several threads may trace at the same time.

    Parameters
    ----------
    geometry
        The triangles; those whose `keep` is False are left out.
    keep : (nt,) bool, optional
        Which triangles rays see. Hits always name indices into `geometry`.
    """

    def __init__(self, geometry: Geometry, keep: NDArray[np.bool_] | None = None) -> None:
        triangles = geometry.triangles
        self._index: Int32 | None = None
        if keep is not None and not keep.all():
            self._index = np.flatnonzero(keep).astype(np.int32)
            triangles = triangles[self._index]
        self._scene = EmbreeScene(robust=True)
        self._empty = len(triangles) == 0
        if not self._empty:
            TriangleMesh(self._scene, geometry.vertices, np.ascontiguousarray(triangles))
            # The structure is built at the first query: ask now, while there is one thread.
            one = np.ones((1, 3), dtype=np.float32)
            self._scene.run(one, one, query="OCCLUDED")

    def intersect(self, origins: Float32, directions: Float32) -> Hits:
        """Return the first hits of n rays; origins, directions (n, 3) float32. Frees the GIL."""
        n = len(origins)
        if self._empty or n == 0:
            return Hits(
                triangle=np.full(n, MISS, dtype=np.int32),
                u=np.zeros(n, dtype=np.float32),
                v=np.zeros(n, dtype=np.float32),
                distance=np.full(n, 1e37, dtype=np.float32),
            )
        out = self._scene.run(origins, directions, query="INTERSECT", output=True)
        triangle = out["primID"]
        if self._index is not None:
            triangle = np.where(triangle >= 0, self._index[triangle], MISS).astype(np.int32)
        return Hits(triangle=triangle, u=out["u"], v=out["v"], distance=out["tfar"])
