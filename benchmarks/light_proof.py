"""Does a light shine as in Cycles? The bake's direct light against Cycles', cell by cell.

A vertex's value towards an axis is the mean of the irradiance E(p, axis) over the points p of its
dual cell. Cycles computes that irradiance at random points of each cell, others for each axis, and
the bake repeats itself with other seeds: both sides are means of independent samples, and every
sum of cells has an honest standard error on either side.

Tested are, per channel, the sum of everything, the sums over 27 blocks of cells and the single
cells, per axis. A single cell at the edge of the light is left to the sums: its lit share is known from
few points only. Each test is a Welch t-test; the smallest p-value times the number of tests (Bonferroni,
which holds for correlated tests) is the p-value of the light.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ivg_addon.blender.export_lights import export_lights
from ivg_addon.core.bake import bake
from ivg_addon.core.scene import Materials, Scene
from ivg_addon.core.settings import BakeSettings

from .light_cases import BOUNDS_MAX, BOUNDS_MIN, RESOLUTION, Case

Float64 = NDArray[np.float64]

FALSE_ALARM = 1e-4
"""Chance that a light which is right fails, with a new seed."""

_FEW_PHOTONS = 0.3
"""A sum is tested if the bakes scatter by less than this share of their mean: that is a dozen photons
or more in each bake, so that the mean over the bakes is normal."""
_HALF_QUAD = 2e-4


@dataclass(frozen=True)
class Effort:
    """How much work the two sides do.

    Parameters
    ----------
    batches, photons
        Bakes, and photons of each.
    points
        Random points per cell and axis.
    samples
        Cycles' samples for each of a point's four corners.
    """

    batches: int
    photons: int
    points: int
    samples: int


QUICK = Effort(batches=16, photons=1 << 15, points=16, samples=1)
FULL = Effort(batches=32, photons=1 << 18, points=64, samples=4)


@dataclass(frozen=True)
class Verdict:
    """How a light compares.

    Parameters
    ----------
    name
        The case's.
    cells, tests
        Cells compared, and t-tests made.
    ratio, ratio_error
        Bake over Cycles, all light together, and its standard error.
    largest_z
        The largest deviation, in standard errors of the normal distribution.
    p
        Probability of such a deviation if the light is right.
    """

    name: str
    cells: int
    tests: int
    ratio: float
    ratio_error: float
    largest_z: float
    p: float

    @property
    def passed(self) -> bool:
        """Tell whether the light shines as in Cycles."""
        return self.p >= FALSE_ALARM


def prove(case: Case, effort: Effort, seed: int = 1, factor: float = 1.0) -> Verdict:
    """Compare one light.

    Parameters
    ----------
    factor
        Multiplies the bake's light: what is not 1 should fail.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = _scene(case)
    cells = _interior_cells()
    seeds = range(1000 * seed, 1000 * seed + effort.batches)
    with ThreadPoolExecutor() as pool:
        baked = factor * np.stack(list(pool.map(lambda one: _bake(scene, cells, effort.photons, one), seeds)))
    return _judge(case.name, baked, _cycles(cells, effort, seed))


def _scene(case: Case) -> Scene:
    """Make the case's Blender scene and return its arrays."""
    geometry = case.build()
    lights, notices = export_lights(bpy.context.evaluated_depsgraph_get())
    assert not notices, notices
    return Scene(
        name=case.name,
        geometry=geometry,
        materials=Materials(
            names=("Plate",),
            albedo=np.zeros((1, 3), dtype=np.float32),
            texture=np.full(1, -1, dtype=np.int32),
            emission=np.array([case.emission], dtype=np.float32),
        ),
        textures=(),
        lights=lights,
        objects=("Plate",),
        diffuse_visible=np.ones(1, dtype=np.bool_),
    )


def _interior_cells() -> NDArray[np.int64]:
    """Return the indices (cells, 3) of vertices whose dual cell is not cut by the bounds."""
    axes = [np.arange(1, count) for count in RESOLUTION]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _bake(scene: Scene, cells: NDArray[np.int64], photons: int, seed: int) -> Float64:
    """Return the bake's irradiance of each cell towards the six axes, (cells, 6, 3)."""
    settings = BakeSettings(
        bounds_min=BOUNDS_MIN,
        bounds_max=BOUNDS_MAX,
        resolution=RESOLUTION,
        photons=photons,
        bounces=1,
        seed=seed,
        include_direct=True,
        threads=1,
        lit_points=0,
    )
    vectors = bake(scene, settings).grid.vectors[tuple(cells.T)].astype(np.float64)
    axis = np.arange(6) // 2
    towards: Float64 = vectors[:, np.arange(6), :, axis].transpose(1, 0, 2)
    return towards * np.array([1, -1] * 3)[None, :, None]


def _cycles(cells: NDArray[np.int64], effort: Effort, seed: int) -> Float64:
    """Return Cycles' irradiance at random points of each cell, (points, cells, 6, 3)."""
    voxel = np.subtract(BOUNDS_MAX, BOUNDS_MIN) / RESOLUTION
    rng = np.random.default_rng(seed)
    shape = (effort.points, len(cells), 6)
    place = cells[None, :, None, :] + rng.uniform(-0.5, 0.5, (*shape, 3))
    normals = np.zeros((6, 3))
    normals[np.arange(6), np.arange(6) // 2] = [1, -1] * 3
    irradiance = _direct_light(
        (np.asarray(BOUNDS_MIN) + voxel * place).reshape(-1, 3),
        np.broadcast_to(normals, (*shape, 3)).reshape(-1, 3),
        effort.samples,
        seed,
    )
    return irradiance.reshape(*shape, 3)


def _judge(name: str, baked: Float64, points: Float64) -> Verdict:
    """Test (batches, cells, 6, 3) of the bake against (points, cells, 6, 3) of Cycles."""
    count = len(points)
    cycles = points.mean(axis=0)
    variance = points.var(axis=0, ddof=1) / count
    edge = _at_edge(points)
    # The points of a cell at an edge may all have missed its lit part, or its dark one: what they did
    # not see is of the order of one point in their number.
    variance += edge[..., None] * (points.max(axis=(0, 1)) / count) ** 2
    deviations = [_deviations(baked[:, ~edge], cycles[~edge], variance[~edge], count - 1)]
    for blocks in (_blocks(1), _blocks(3)):
        sums = [_sum(values, blocks) for values in (baked, cycles, variance)]
        deviations.append(_deviations(*sums, (count - 1) * int(blocks.sum(axis=1).min())))
    z = np.concatenate(deviations)
    largest = float(np.abs(z).max())
    total = baked.sum(axis=(1, 2, 3))
    everything = float(cycles.sum())
    ratio = float(total.mean()) / everything
    error = math.hypot(float(total.std(ddof=1)) / math.sqrt(len(total)), ratio * math.sqrt(variance.sum()))
    return Verdict(
        name=name,
        cells=cycles.shape[0],
        tests=len(z),
        ratio=ratio,
        ratio_error=error / everything,
        largest_z=largest,
        p=min(1.0, len(z) * math.erfc(largest / math.sqrt(2.0))),
    )


def _at_edge(points: Float64) -> NDArray[np.bool_]:
    """Tell per cell and axis, (cells, 6), whether it and its neighbours have both lit and dark points."""
    shape = tuple(n - 1 for n in RESOLUTION)
    lit = points.max(axis=-1) > 0.0

    def nearby(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
        padded = np.pad(cells.reshape(*shape, 6), ((1, 1), (1, 1), (1, 1), (0, 0)))
        windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3, 3), axis=(0, 1, 2))
        return windows.any(axis=(-1, -2, -3)).reshape(-1, 6)

    return nearby(lit.any(axis=0)) & nearby(~lit.all(axis=0))


def _blocks(divisions: int) -> Float64:
    """Return which cells belong to which of divisions³ blocks, (blocks, cells) of zeros and ones."""
    thirds = [np.arange(n - 1) * divisions // (n - 1) for n in RESOLUTION]
    i, j, k = np.meshgrid(*thirds, indexing="ij")
    block = ((i * divisions + j) * divisions + k).reshape(-1)
    return (np.arange(divisions**3)[:, None] == block).astype(np.float64)


def _sum(values: Float64, blocks: Float64) -> Float64:
    """Return (…, blocks, 6, 3) sums of (…, cells, 6, 3)."""
    total: Float64 = np.einsum("bc,...cxy->...bxy", blocks, values)
    return total


def _deviations(baked: Float64, cycles: Float64, variance: Float64, degrees: int) -> Float64:
    """Return Welch's t of each sum as the z of the normal distribution of the same p-value.

    The transformation is Wallace's, "Bounds on Normal Approximations to Student's and the Chi-Square
    Distributions" (1959).

    Parameters
    ----------
    baked : (batches, …)
    cycles, variance : (…)
        Means of Cycles and their squared standard errors, with so many `degrees` of freedom.
    """
    batches = len(baked)
    mean, scatter2 = baked.mean(axis=0), baked.var(axis=0, ddof=1)
    error2 = scatter2 / batches + variance
    tested = (error2 > 0.0) & (scatter2 < (_FEW_PHOTONS * mean) ** 2)
    e2, c2 = error2[tested], variance[tested]
    freedom = e2**2 / ((e2 - c2) ** 2 / (batches - 1) + c2**2 / degrees)
    t = (mean - cycles)[tested] / np.sqrt(e2)
    z = np.sqrt(freedom * np.log1p(t * t / freedom)) * (8 * freedom + 1) / (8 * freedom + 3)
    return np.copysign(z, t)


def _direct_light(points: Float64, normals: Float64, samples: int, seed: int) -> Float64:
    """Return the direct irradiance that Cycles computes, (n, 3) W/m² (docs/method.md)."""
    tangent = np.roll(normals, 1, axis=1)
    bitangent = np.cross(normals, tangent)
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    vertices = np.stack([points + _HALF_QUAD * (a * tangent + b * bitangent) for a, b in corners], axis=1)
    count = len(points)
    mesh = bpy.data.meshes.new("Receivers")
    mesh.vertices.add(4 * count)
    mesh.vertices.foreach_set("co", vertices.ravel())
    mesh.loops.add(4 * count)
    mesh.loops.foreach_set("vertex_index", np.arange(4 * count))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", 4 * np.arange(count))
    mesh.update()
    mesh.materials.append(_white())
    mesh.color_attributes.new("irradiance", "FLOAT_COLOR", "CORNER")
    mesh.color_attributes.active_color_index = 0
    receiver = bpy.data.objects.new("Receivers", mesh)
    for ray in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(receiver, f"visible_{ray}", False)
    scene = bpy.context.scene
    scene.collection.objects.link(receiver)
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.samples, cycles.seed = samples, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    receiver.select_set(True)
    bpy.context.view_layer.objects.active = receiver
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT"}, target="VERTEX_COLORS")
    colors = np.empty(16 * count, dtype=np.float32)
    mesh.color_attributes["irradiance"].data.foreach_get("color", colors)
    return math.pi * colors.reshape(count, 4, 4)[:, :, :3].mean(axis=1, dtype=np.float64)


def _white() -> bpy.types.Material:
    """Return a material that reflects all light diffusely."""
    made = bpy.data.materials.new("White")
    tree = made.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return made
