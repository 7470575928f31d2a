# SPDX-License-Identifier: GPL-3.0-or-later
"""A closed room of thick walls, and what stands in rooms: columns, pedestals, benches.

Slabs meet by running into each other, never by sharing a face or ending at an edge: no crack for
light, no two faces in one place. What stands on a floor goes into it a little for the same reason.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .assets import add, mesh
from .shapes import Shape, box, merged, revolve, with_plan_uv

SUNK = 0.02


@dataclass(frozen=True)
class Shell:
    """A room's inside in metres: width along x, length along y, around the origin; floor at z = 0."""

    width: float
    length: float
    height: float
    thickness: float


@dataclass(frozen=True)
class ShellMaterials:
    """The materials of the six sides; west is -x, south is -y."""

    floor: bpy.types.Material
    ceiling: bpy.types.Material
    west: bpy.types.Material
    east: bpy.types.Material
    south: bpy.types.Material
    north: bpy.types.Material


def add_shell(group: bpy.types.Collection, shell: Shell, materials: ShellMaterials) -> None:
    """Add the six slabs around a room.

    Only the side walls reach the outer bounds in x, the end walls those in y, floor and ceiling those
    in z.
    """
    t = shell.thickness
    x, y, z = shell.width / 2.0, shell.length / 2.0, shell.height
    reach = 0.5 * t
    foot, head = -0.8 * t, z + 0.8 * t
    slabs: dict[str, tuple[bpy.types.Material, Shape]] = {
        "Floor": (
            materials.floor,
            with_plan_uv(box((-x - reach, -y - reach, -t), (x + reach, y + reach, 0.0)), 2.0),
        ),
        "Ceiling": (
            materials.ceiling,
            box((-x - reach, -y - reach, z), (x + reach, y + reach, z + t)),
        ),
        "West Wall": (materials.west, box((-x - t, -y - reach, foot), (-x, y + reach, head))),
        "East Wall": (materials.east, box((x, -y - reach, foot), (x + t, y + reach, head))),
        "South Wall": (
            materials.south,
            box((-x - reach, -y - t, foot + 0.1 * t), (x + reach, -y, head - 0.1 * t)),
        ),
        "North Wall": (
            materials.north,
            box((-x - reach, y, foot + 0.1 * t), (x + reach, y + t, head - 0.1 * t)),
        ),
    }
    for name, (material, shape) in slabs.items():
        add(group, name, mesh(name, shape, material))


def column(height: float, radius: float) -> Shape:
    """Return a tapering round column on a square plinth, from the floor up into the ceiling."""
    r = radius
    plinth = box((-1.5 * r, -1.5 * r, -SUNK), (1.5 * r, 1.5 * r, 0.6 * r))
    abacus = box((-1.45 * r, -1.45 * r, height - 0.45 * r), (1.45 * r, 1.45 * r, height + SUNK))
    foot, head = 0.55 * r, height - 0.4 * r
    base = [(1.38, 0.0), (1.45, 0.14), (1.45, 0.3), (1.38, 0.44), (1.14, 0.5), (1.08, 0.66)]
    base += [(1.12, 0.74), (1.22, 0.8), (1.22, 0.92), (1.12, 0.98), (1.02, 1.02)]
    capital = [(0.86, 1.0), (0.95, 0.94), (0.95, 0.84), (0.87, 0.78), (0.92, 0.5), (1.1, 0.24)]
    capital += [(1.34, 0.12), (1.34, 0.0)]
    shaft = [(1.0 - 0.16 * share**1.8, share) for share in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)]
    low, high = foot + 1.1 * r, head - 1.05 * r
    profile = [(r * a, foot + r * b) for a, b in base]
    profile += [(r * a, low + (high - low) * share) for a, share in shaft]
    profile += [(r * a, head - r * b) for a, b in capital]
    return merged(plinth, revolve(profile, 40), abacus)


def pedestal(width: float, height: float) -> Shape:
    """Return a square pedestal with a foot and a top plate."""
    w = width / 2.0
    return merged(
        box((-1.14 * w, -1.14 * w, -SUNK), (1.14 * w, 1.14 * w, 0.1)),
        box((-w, -w, 0.08), (w, w, height - 0.04)),
        box((-1.1 * w, -1.1 * w, height - 0.06), (1.1 * w, 1.1 * w, height)),
    )


def bench(length: float, depth: float, height: float) -> Shape:
    """Return a bench, its length along y: a seat of three boards on two trestles."""
    board = depth / 3.0
    gap = 0.012
    seat = [
        box(
            (-depth / 2.0 + i * board + gap, -length / 2.0, height - 0.05),
            (-depth / 2.0 + (i + 1) * board - gap, length / 2.0, height),
        )
        for i in range(3)
    ]
    legs = [
        box(
            (-0.44 * depth, side * 0.36 * length - 0.05, -SUNK),
            (0.44 * depth, side * 0.36 * length + 0.05, height - 0.03),
        )
        for side in (-1.0, 1.0)
    ]
    return merged(*seat, *legs)
