# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair curves, old particle hair and point clouds, out of evaluated objects."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.scene import Float32
from ..core.strands import Strands
from ..core.thinning import MOST_TRIANGLES, kept_of

_CURVE_RADIUS = 0.005
_POINT_RADIUS = 0.01
"""Metres: Cycles' own where there is no attribute of that name."""
_POLY = 1
"""Type of a curve that is straight between its points."""


def read_points(cloud: bpy.types.PointCloud) -> tuple[Float32, Float32]:
    """Return a point cloud's centres (n, 3) and radii (n,)."""
    count = len(cloud.points)
    centers = np.empty((count, 3), dtype=np.float32)
    cloud.attributes["position"].data.foreach_get("vector", centers.reshape(-1))
    return centers, _radii(cloud, count, _POINT_RADIUS)


def read_curves(curves: bpy.types.Curves, straight: bool) -> Strands:
    """Return hair curves; Cycles takes their points as keys whatever the curves' type.

    Parameters
    ----------
    straight
        The scene's shape of hair has straight pieces ("3D Linear Curves").
    """
    count, points = len(curves.curves), len(curves.points)
    offsets = np.zeros(count + 1, dtype=np.int32)
    positions = np.empty((points, 3), dtype=np.float32)
    if count:
        curves.curve_offset_data.foreach_get("value", offsets)
        curves.position_data.foreach_get("vector", positions.reshape(-1))
    radius = curves.attributes.get("radius")
    if radius is not None and radius.domain == "CURVE":
        radii = np.repeat(_values(radius, "value", (count,)), np.diff(offsets))
    else:
        radii = _radii(curves, points, _CURVE_RADIUS)
    # Cycles asks the first curve only.
    types = curves.attributes.get("curve_type")
    poly = types is not None and count > 0 and types.data[0].value == _POLY
    uvs = {
        str(attribute.name): _values(attribute, "vector", (count, 2))
        for attribute in curves.attributes
        if attribute.domain == "CURVE" and attribute.data_type == "FLOAT2"
    }
    return Strands(offsets, positions, radii, smooth=not (straight or poly), uvs=uvs)


def hair_systems(shown: bpy.types.Object, rendered: bool) -> list[tuple[bpy.types.Modifier, bpy.types.ParticleSystem]]:
    """Return the particle systems of an object that Cycles renders as hair."""
    return [
        (modifier, modifier.particle_system)
        for modifier in shown.modifiers
        if modifier.type == "PARTICLE_SYSTEM"
        and (modifier.show_render if rendered else modifier.show_viewport)
        and modifier.particle_system.settings.type == "HAIR"
        and modifier.particle_system.settings.render_type == "PATH"
    ]


def read_hair(
    shown: bpy.types.Object,
    modifier: bpy.types.Modifier,
    rendered: bool,
    straight: bool,
    uv_names: tuple[str, ...],
) -> tuple[Strands, int]:
    """Return a particle system's strands in the object's space, and how many there are.

    Each key costs a call: of more strands than a bake takes, only some are read, and those made wider.
    """
    system = modifier.particle_system
    settings = system.settings
    parents, children = len(system.particles), len(system.child_particles)
    if not rendered:
        children = children * settings.display_percentage // 100
    first = parents if settings.child_type != "NONE" and children else 0
    count = parents + children - first
    keys = (1 << (settings.render_step if rendered else settings.display_step)) + 1
    if settings.kink == "SPIRAL":
        keys += settings.kink_extra_steps
    chosen = first + kept_of(count, MOST_TRIANGLES // (6 * keys)) if count else np.zeros(0, dtype=np.int64)
    place = system.co_hair
    positions = np.array(
        [place(shown, particle_no=strand, step=key) for strand in chosen.tolist() for key in range(keys)],
        dtype=np.float64,
    ).reshape(-1, keys, 3)
    to_object = np.linalg.inv(np.array(shown.matrix_world, dtype=np.float64))
    positions = positions @ to_object[:3, :3].T + to_object[:3, 3]
    widened = np.float32(count / max(1, len(chosen)))
    strands = Strands(
        offsets=(keys * np.arange(len(chosen) + 1)).astype(np.int32),
        positions=positions.reshape(-1, 3).astype(np.float32),
        radii=(_hair_radii(settings, positions) * widened).reshape(-1),
        smooth=not straight,
        uvs={name: _root_uvs(shown, modifier, chosen, name) for name in uv_names},
    )
    return strands, count


def _hair_radii(settings: bpy.types.ParticleSettings, positions: NDArray[np.float64]) -> Float32:
    """Return the radii of strands (n, keys, 3) from root to tip, (n, keys), by the strand shape's formula."""
    steps = np.linalg.norm(np.diff(positions, axis=1), axis=2)
    along = np.concatenate([np.zeros((len(positions), 1)), np.cumsum(steps, axis=1)], axis=1)
    length = along[:, -1:]
    left = 1.0 - np.divide(along, length, out=np.zeros_like(along), where=length > 0.0)
    shape = settings.shape
    if shape != 0.0:
        # At the ends of the range the exponent is 0 or infinite: the root's radius all along, or the tip's.
        exponent = 1.0 + shape if shape < 0.0 else 1.0 / max(1.0 - shape, 1e-6)
        left = np.maximum(left, 0.0) ** exponent
    root, tip = (0.5 * settings.radius_scale * value for value in (settings.root_radius, settings.tip_radius))
    radii = tip + (root - tip) * left
    if settings.use_close_tip:
        radii[:, -1] = 0.0
    return np.asarray(radii, dtype=np.float32)


def _root_uvs(shown: bpy.types.Object, modifier: bpy.types.Modifier, strands: NDArray[np.int64], name: str) -> Float32:
    """Return the texture coordinates (n, 2) of the emitter under each strand."""
    system = modifier.particle_system
    particles = system.particles
    look_up: Callable[..., Any] = system.uv_on_emitter
    layer = shown.data.uv_layers.find(name)
    last = len(particles) - 1
    return np.array(
        [
            look_up(modifier, particle=particles[min(strand, last)], particle_no=strand, uv_no=layer)
            for strand in strands.tolist()
        ],
        dtype=np.float32,
    ).reshape(-1, 2)


def _radii(owner: bpy.types.ID, count: int, default: float) -> Float32:
    """Return the attribute "radius" of all points, (n,)."""
    attribute = owner.attributes.get("radius")
    if attribute is None or attribute.data_type != "FLOAT" or len(attribute.data) != count:
        return np.full(count, default, dtype=np.float32)
    return _values(attribute, "value", (count,))


def _values(attribute: bpy.types.Attribute, field: str, shape: tuple[int, ...]) -> Float32:
    """Copy an attribute."""
    values = np.empty(shape, dtype=np.float32)
    attribute.data.foreach_get(field, values.reshape(-1))
    return values
