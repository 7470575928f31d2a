# SPDX-License-Identifier: GPL-3.0-or-later
"""The stage that the scenes are played on, and what stands on it.

The cells (`proof.CELLS`) fill the middle. Below them lies a floor, two walls stand aside, the rest is open; lamps hang
above. What a scene is about is named `TESTED`: its object, material, light, world or image, so that a notice about it
can be told from others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

from .nodes import Colour, Maker, diffuse, material

Vec3 = tuple[float, float, float]

TESTED = "Tested"
GREY = (0.6, 0.6, 0.6)
RED = (0.7, 0.25, 0.15)
GREEN = (0.2, 0.6, 0.3)
FLOOR = -0.3
ABOVE = (-0.35, 0.25, 1.9)
"""Where things are hung between the lamp and the cells."""
TILT = (0.5, -0.35, 0.4)
LAMP = (0.3, -0.2, 2.7)


@dataclass(frozen=True)
class Case:
    """One scene of the battery.

    Parameters
    ----------
    name
        Group, colon, feature.
    build
        Fills the empty scene.
    paths
        How many times as many paths of indirect light Cycles needs, to find what mirrors and glass throw.
    """

    name: str
    build: Callable[[], object]
    paths: int = 1


def add_object(name: str, data: bpy.types.ID | None, **values: object) -> bpy.types.Object:
    """Put an object into the scene."""
    made = bpy.data.objects.new(name, data)
    for key, value in values.items():
        setattr(made, key, value)
    bpy.context.scene.collection.objects.link(made)
    return made


def mesh(
    name: str, vertices: Sequence[Vec3], faces: Sequence[Sequence[int]], of: bpy.types.Material | None = None
) -> bpy.types.Mesh:
    """Return a mesh of one material."""
    data = bpy.data.meshes.new(name)
    data.from_pydata([tuple(map(float, v)) for v in vertices], [], faces)
    if of is not None:
        data.materials.append(of)
    return data


def card_mesh(half: float, of: bpy.types.Material | None = None, cuts: int = 1, name: str = "Card") -> bpy.types.Mesh:
    """Return a square in the plane z = 0 of cuts² faces, with UVs from 0 to 1."""
    steps = np.linspace(-half, half, cuts + 1)
    vertices = [(x, y, 0.0) for y in steps for x in steps]
    row = cuts + 1
    faces = [
        (j * row + i, j * row + i + 1, (j + 1) * row + i + 1, (j + 1) * row + i)
        for j in range(cuts)
        for i in range(cuts)
    ]
    data = mesh(name, vertices, faces, of)
    corners = np.array(vertices)[np.concatenate(faces)][:, :2]
    data.uv_layers.new(name="UVMap").uv.foreach_set("vector", (corners / (2 * half) + 0.5).astype(np.float32).ravel())
    return data


def card(
    of: bpy.types.Material, half: float = 0.45, location: Vec3 = ABOVE, rotation: Vec3 = TILT, **values: object
) -> bpy.types.Object:
    """Hang a tilted square between the lamp and the cells; it has its material's name."""
    return add_object(of.name, card_mesh(half, of), location=location, rotation_euler=rotation, **values)


def ball_mesh(radius: float, of: bpy.types.Material | None = None, smooth: bool = True) -> bpy.types.Mesh:
    """Return a sphere of 2,048 triangles or so."""
    rings, sectors = 24, 48
    vertices: list[Vec3] = [(0.0, 0.0, radius)]
    for i in range(1, rings):
        t = np.pi * i / rings
        for j in range(sectors):
            p = 2 * np.pi * j / sectors
            vertices.append((radius * np.sin(t) * np.cos(p), radius * np.sin(t) * np.sin(p), radius * np.cos(t)))
    vertices.append((0.0, 0.0, -radius))
    last = len(vertices) - 1
    faces: list[Sequence[int]] = []
    for j in range(sectors):
        k = (j + 1) % sectors
        faces.append((0, 1 + j, 1 + k))
        for i in range(rings - 2):
            a, b = 1 + i * sectors, 1 + (i + 1) * sectors
            faces.append((a + j, b + j, b + k, a + k))
        base = 1 + (rings - 2) * sectors
        faces.append((last, base + k, base + j))
    data = mesh("Ball", vertices, faces, of)
    if smooth:
        data.shade_smooth()
    return data


def ball(of: bpy.types.Material, radius: float = 0.3, location: Vec3 = ABOVE, **values: object) -> bpy.types.Object:
    """Hang a smooth ball between the lamp and the cells."""
    return add_object(TESTED, ball_mesh(radius, of), location=location, **values)


def box_mesh(size: Vec3, of: bpy.types.Material | None = None) -> bpy.types.Mesh:
    """Return a closed box around the origin, its faces outward."""
    signs = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    vertices = [tuple(0.5 * s * edge for s, edge in zip(corner, size, strict=True)) for corner in signs]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh("Box", vertices, faces, of)


def floor(of: bpy.types.Material) -> bpy.types.Object:
    """Lay the floor."""
    name = TESTED if of.name == TESTED else "Floor"
    return add_object(name, card_mesh(1.5, of, name=name), location=(0.0, 0.0, FLOOR))


def walls() -> None:
    """Set up a grey wall at the back and a red one to the left."""
    for name, colour, location, turn in (
        ("Back", GREY, (0.0, 1.4, 1.2), (np.pi / 2, 0.0, 0.0)),
        ("Left", RED, (-1.4, 0.0, 1.2), (0.0, np.pi / 2, 0.0)),
    ):
        add_object(name, card_mesh(1.45, plain(name, colour)), location=location, rotation_euler=turn)


def plain(name: str, colour: Colour = GREY) -> bpy.types.Material:
    """Return a diffuse material."""
    return material(name, diffuse(colour))


def lamp(
    kind: str = "AREA", name: str = "Lamp", location: Vec3 = LAMP, aim: Vec3 = (0.0, 0.0, 0.0), **settings: object
) -> bpy.types.Object:
    """Hang a lamp that shines towards a place."""
    data = bpy.data.lights.new(name, kind)
    data.energy = 2.0 if kind == "SUN" else 60.0
    if kind == "AREA":
        data.shape, data.size = "DISK", 0.7
    if kind in {"POINT", "SPOT"}:
        data.shadow_soft_size = 0.2
    for key, value in settings.items():
        setattr(data, key, value)
    turn = (Vector(location) - Vector(aim)).to_track_quat("Z", "Y").to_euler()
    return add_object(name, data, location=location, rotation_euler=turn)


def room(floor_of: bpy.types.Material | None = None) -> None:
    """Set up floor, walls and lamp."""
    floor(floor_of or plain("Floor"))
    walls()
    lamp()


def with_floor(surface: Maker) -> Callable[[], object]:
    """Return what makes a room with a floor of the tested surface."""
    return lambda: room(material(TESTED, surface))


def with_turned_floor(surface: Maker) -> Callable[[], object]:
    """Return what makes a room whose floor of the tested surface lies on its front."""

    def build() -> None:
        made = material(TESTED, surface)
        room(made)
        bpy.data.objects[TESTED].rotation_euler = (np.pi, 0.0, 0.0)

    return build


def with_floor_and_card(surface: Maker) -> Callable[[], object]:
    """Return what makes a room with a floor of the tested surface and a card of it in the lamp's light."""

    def build() -> None:
        made = material(TESTED, surface)
        room(made)
        card(made)

    return build


def with_card(surface: Maker) -> Callable[[], object]:
    """Return what makes a room with a card of the tested surface in the lamp's light."""

    def build() -> None:
        room()
        card(material(TESTED, surface))

    return build


def with_ball(surface: Maker) -> Callable[[], object]:
    """Return what makes a room with a ball of the tested surface in the lamp's light."""

    def build() -> None:
        room()
        ball(material(TESTED, surface))

    return build


def turned(rotation: Vec3, location: Vec3 = (0.0, 0.0, 0.0), scale: Vec3 = (1.0, 1.0, 1.0)) -> Matrix:
    """Return a transform."""
    return Matrix.LocRotScale(Vector(location), Euler(rotation), Vector(scale))


def image(name: str, size: int = 16, seed: int = 5, alpha: bool = False) -> bpy.types.Image:
    """Return an sRGB image of large patches of colour; with alpha, of holes."""
    rng = np.random.default_rng(seed)
    blocks = rng.uniform(0.05, 0.95, (4, 4, 4))
    blocks[:, :, 3] = rng.permutation(16).reshape(4, 4) % 3 == 0 if alpha else 1.0
    made = bpy.data.images.new(name, size, size, alpha=alpha)
    made.alpha_mode = "STRAIGHT"
    made.pixels.foreach_set(np.kron(blocks, np.ones((size // 4, size // 4, 1))).astype(np.float32).ravel())
    made.update()
    return made
