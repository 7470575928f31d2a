# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene in, grid out: the bake, step by step.

emission → photon walk → tally → vectors per dual cell → lit parts → grid → its surfaces
"""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from .aim import Aim, aim_steps
from .dual_cells import Lattice
from .embree import Tracer
from .emission import Emission, prepare_emission
from .errors import SceneError
from .grid import BakeRecord, IrradianceVectorGrid, grid_bytes
from .lit_volume import LightKnowledge, LitParts, lit_part_steps
from .memory import require
from .outshone import outshone_steps
from .partitioning import parting, partition_steps
from .partitions import Partitions
from .photon_walk import BATCH, Course, Walk, Walkers, thread_count, walk_steps
from .progress import Progress, finish, part
from .report import Notice, merge
from .restricted_light import RestrictedLight
from .scene import Float32, Int32, Scene
from .settings import BakeSettings, Estimator, Vec3
from .surface_bins import PATCHES_PER_VOXEL, PHOTONS_PER_PATCH, SurfaceBins
from .surface_fit import fit_steps
from .surfaces import Surfaces
from .tally import Tally
from .version import VERSION

LEAST_LIT_SHARE = 0.01
"""Below this lit share a vertex is left out: its estimate would be a few photons divided by next
to nothing, and its neighbours know better."""

_FITTED = 0.95
"""Of a bake's work is done when the grid is fitted to the surfaces."""

_MOSTLY_LIT = 0.5
"""From this lit share on a cell in which no photon flew is dark; it knows that."""


@dataclass(frozen=True)
class BakeStatistics:
    """What a bake did.

    Parameters
    ----------
    photons, rays
        Photons emitted and flights traced; rays/photons is the mean number of flights.
    emitted, absorbed, escaped, cut
        Power in W, linear RGB: of all lights; absorbed by surfaces; lost into the void; still
        under way after the last bounce.
    prepare_seconds, photon_seconds, lit_seconds
        Wall-clock time of the phases.
    embree_seconds
        Time spent inside Embree during the photon phase, summed over threads.
    threads
        Worker threads.
    grid_bytes
        Memory of the grid.
    aim
        How many photons of the surroundings were of use; None where there are no surroundings, or too few photons to
        find out.
    """

    photons: int
    rays: int
    emitted: Vec3
    absorbed: Vec3
    escaped: Vec3
    cut: Vec3
    prepare_seconds: float
    photon_seconds: float
    lit_seconds: float
    embree_seconds: float
    threads: int
    grid_bytes: int
    aim: Aim | None = None

    @property
    def photons_per_second(self) -> float:
        """Return photons emitted per second of the photon phase."""
        return self.photons / max(self.photon_seconds, 1e-9)

    @property
    def seconds(self) -> float:
        """Return the wall-clock time of all phases."""
        return self.prepare_seconds + self.photon_seconds + self.lit_seconds


@dataclass(frozen=True)
class BakeResult:
    """A grid, what it took, and what should be known about it."""

    grid: IrradianceVectorGrid
    statistics: BakeStatistics
    notices: tuple[Notice, ...]


def memory_needed(settings: BakeSettings) -> int:
    """Return the most memory that the sums and the grid of a bake take together, bytes."""
    lattice = _lattice(settings)
    tallies = thread_count(settings) * Tally.bytes(lattice, settings.estimator)
    # The vectors exist in double precision for a moment, whole-cell means beside those of the lit part.
    return tallies + 4 * grid_bytes(settings.resolution)


def bake(scene: Scene, settings: BakeSettings) -> BakeResult:
    """Bake without interruption; raises `SceneError`, `SettingsError`, `MemoryLimitError`."""
    return finish(bake_steps(scene, settings))


def bake_steps(scene: Scene, settings: BakeSettings) -> Generator[Progress, None, BakeResult]:
    """Bake in small steps; close the generator to cancel. Returns a `BakeResult`."""
    start = time.perf_counter()
    require(
        memory_needed(settings),
        f"a grid of {' × '.join(map(str, settings.resolution))} voxels",
        "lower the resolution or the number of threads",
    )
    yield Progress("Preparing the scene", 0.0)
    lattice = _lattice(settings)
    course = prepare_course(scene, lattice, settings.photons)
    yield Progress("Compiling for this processor, once after installing", 0.0)
    record = _record(scene, settings, course.emission)
    _compile_kernels(scene, course, settings, record)
    course, aim = yield from part(aim_steps(course, lattice, settings), 0.0, 0.0)
    prepare_seconds = time.perf_counter() - start

    photon_share = 0.8 if _measures_lit_volume(settings) else 1.0
    flown = yield from part(_flight_steps(scene, course, lattice, settings), 0.0, photon_share)
    walk, partitions = flown.walk, flown.partitions
    lit_start = time.perf_counter()
    if _measures_lit_volume(settings):
        knowledge = light_knowledge(scene, course, walk.bin_counts)
        search = outshone_steps(knowledge, course.walls, lattice, partitions, settings.seed, settings.threads)
        outshone = yield from part(search, photon_share, photon_share)
        which = settings.lit_points, settings.seed, settings.threads
        measuring = lit_part_steps(knowledge, lattice, partitions, outshone, *which)
        parts = yield from part(measuring, photon_share, _FITTED)
    else:
        parts = LitParts.whole(lattice)
    grid = _grid(flown.vectors, parts, partitions, lattice, record)
    if _measures_lit_volume(settings):
        landed = (walk.received, course.emission.flux_scale)
        fitting = fit_steps(grid, knowledge, course.surfaces, *landed, settings.threads)
        corrected, corrections = yield from part(fitting, _FITTED, 1.0)
        grid = replace(grid, corrected=corrected, corrections=corrections)
    statistics = _statistics(settings, course.emission, walk)
    return BakeResult(
        grid=grid,
        statistics=replace(
            statistics,
            prepare_seconds=prepare_seconds,
            lit_seconds=time.perf_counter() - lit_start + flown.partition_seconds,
            aim=aim,
        ),
        notices=merge([*scene.notices, *_doubts(grid, walk)]),
    )


@dataclass(frozen=True)
class _Flown:
    """What the photons left behind.

    Parameters
    ----------
    walk
        Of all photons.
    vectors : (Ni+1, Nj+1, Nk+1, 6, 3, 3) float64
        Means over whole dual cells, of what flew on their vertices' sides.
    partitions
        Those sides.
    partition_seconds
        What it took to find them.
    """

    walk: Walk
    vectors: NDArray[np.float64]
    partitions: Partitions
    partition_seconds: float


def _flight_steps(
    scene: Scene, course: Course, lattice: Lattice, settings: BakeSettings
) -> Generator[Progress, None, _Flown]:
    """Let all photons fly; look for thin walls on the way, as soon as it is known where light is."""
    walkers = Walkers(course, lattice, settings)
    partitions = Partitions.none(lattice.vertex_count)
    scouts, seconds = 0, 0.0
    if _measures_lit_volume(settings):
        scouts = _scouts(settings.photons)
        yield from walkers.fly_steps(0, scouts)
        start = time.perf_counter()
        knowledge = light_knowledge(scene, course, walkers.bin_counts())
        search = partition_steps(knowledge, course.walls, lattice, settings.seed, settings.threads)
        share = scouts / settings.photons
        partitions = yield from part(search, share, share)
        walkers.divide(partitions)
        seconds = time.perf_counter() - start
    yield from walkers.fly_steps(scouts, settings.photons)
    walk = walkers.walk()
    vectors = walk.tally.vectors(course.emission.flux_scale / settings.photons)
    # These have not counted the scouts.
    vectors[partitions.divided.reshape(lattice.shape)] *= settings.photons / (settings.photons - scouts)
    return _Flown(walk, vectors, partitions, seconds)


def _lattice(settings: BakeSettings) -> Lattice:
    """Return the grid's lattice."""
    return Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)


def _measures_lit_volume(settings: BakeSettings) -> bool:
    """Tell whether vectors are divided by lit volumes: the report's estimator knows none."""
    return settings.estimator is not Estimator.REPORT and settings.lit_points > 0


def prepare_course(scene: Scene, lattice: Lattice, photons: int) -> Course:
    """Build what the walk of so many photons needs; raises `SceneError` without geometry or light."""
    if scene.geometry.triangle_count == 0:
        raise SceneError(
            f"scene '{scene.name}' has no geometry that renders: add a mesh, or enable its render visibility"
        )
    emission = prepare_emission(
        scene,
        np.asarray(lattice.bounds_min, dtype=np.float32),
        np.asarray(lattice.bounds_max, dtype=np.float32),
    )
    patch_size = float(lattice.voxel_size.min()) / PATCHES_PER_VOXEL
    bins = SurfaceBins.of(scene.geometry, patch_size, photons // PHOTONS_PER_PATCH)
    first = Tracer(scene.geometry)
    seen = scene.diffuse_visible[scene.geometry.object]
    later = first if seen.all() else Tracer(scene.geometry, keep=seen)
    parts = parting(scene)
    walls = later if parts.all() else Tracer(scene.geometry, keep=seen & parts)
    return Course(emission, first, later, walls, Surfaces.of(scene, bins), bins, RestrictedLight.of(scene, emission))


def _scouts(photons: int) -> int:
    """Return how many photons fly before thin walls are looked for; vertices beside these do not count them."""
    return min(max(photons // 4, BATCH), photons // 2)


def light_knowledge(scene: Scene, course: Course, bin_counts: Int32) -> LightKnowledge:
    """Gather what the photons found out about the surfaces."""
    return LightKnowledge(
        geometry=scene.geometry,
        tracer=course.later,
        bins=course.bins,
        bin_counts=bin_counts,
        world_shines=scene.lights.world_shines,
    )


def _compile_kernels(scene: Scene, course: Course, settings: BakeSettings, record: BakeRecord) -> None:
    """Run every kernel that the bake needs once, on next to nothing, so that none compiles later.

    All but the tally's for divided vertices: most scenes have none.
    """
    tiny = replace(settings, resolution=(1, 1, 1), photons=1, threads=1, include_direct=True)
    lattice = _lattice(tiny)
    walk = finish(walk_steps(course, lattice, tiny))
    if _measures_lit_volume(settings):
        knowledge = light_knowledge(scene, course, walk.bin_counts)
        partitions = finish(partition_steps(knowledge, course.walls, lattice, 0, 1))
        outshone = finish(outshone_steps(knowledge, course.walls, lattice, partitions, 0, 1))
        parts = finish(lit_part_steps(knowledge, lattice, partitions, outshone, 1, 0, 1))
        grid = _grid(walk.tally.vectors(1.0), parts, partitions, lattice, record)
        finish(fit_steps(grid, knowledge, course.surfaces, walk.received, 1.0, 1))


def _grid(
    means: NDArray[np.float64], parts: LitParts, partitions: Partitions, lattice: Lattice, record: BakeRecord
) -> IrradianceVectorGrid:
    """Return the grid of means over whole cells, (…, 6, 3, 3)."""
    vectors, validity = _normalise(means, parts.share)
    return IrradianceVectorGrid(
        vectors=vectors.astype(np.float32),
        validity=validity,
        lit_weights=parts.weights,
        plane_start=partitions.start,
        planes=partitions.planes,
        lattice=lattice,
        record=record,
    )


def _normalise(vectors: np.ndarray, share: Float32) -> tuple[np.ndarray, Float32]:
    """Divide whole-cell means by the lit share; vertices with next to none become invalid.

    So do those of mostly dark cells in which no photon flew: what was taken for lit there was none (the inside of a
    wall, by rays that leave it at an edge).
    """
    counted = vectors.any(axis=(-1, -2, -3))
    valid = (share >= LEAST_LIT_SHARE) & (counted | (share >= _MOSTLY_LIT))
    validity = np.where(valid, share, np.float32(0))
    scale = np.where(valid, 1.0 / np.maximum(share, LEAST_LIT_SHARE), 0.0)
    return vectors * scale[..., None, None, None], validity


def _record(scene: Scene, settings: BakeSettings, emission: Emission) -> BakeRecord:
    """Return the record of this bake."""
    red, green, blue = (float(x) for x in emission.power)
    return BakeRecord(
        scene=scene.name,
        checksum=scene.fingerprint(),
        settings=settings,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        version=VERSION,
        emitted=(red, green, blue),
    )


def _statistics(settings: BakeSettings, emission: Emission, walk: Walk) -> BakeStatistics:
    """Gather numbers; the phases other than the photons' are filled in by the caller."""

    def watts(share: np.ndarray) -> Vec3:
        red, green, blue = (float(x) for x in share * emission.flux_scale)
        return red, green, blue

    return BakeStatistics(
        photons=settings.photons,
        rays=walk.rays,
        emitted=watts(emission.power / emission.flux_scale),
        absorbed=watts(walk.absorbed),
        escaped=watts(walk.escaped),
        cut=watts(walk.cut),
        prepare_seconds=0.0,
        photon_seconds=walk.seconds,
        lit_seconds=0.0,
        embree_seconds=walk.embree_seconds,
        threads=thread_count(settings),
        grid_bytes=grid_bytes(settings.resolution),
    )


def _doubts(grid: IrradianceVectorGrid, walk: Walk) -> list[Notice]:
    """Return warnings about the result as a whole."""
    doubts = []
    if not grid.validity.any() or not grid.vectors.any():
        doubts.append(
            Notice(
                "warning",
                "grid",
                "no light reaches the grid: it lies inside a solid or outside of the lit room; move its bounds",
            )
        )
    lost = float(walk.escaped.sum() / max(1e-30, (walk.escaped + walk.absorbed + walk.cut).sum()))
    if lost > 0.9:
        doubts.append(
            Notice(
                "warning",
                "photons",
                f"{lost:.0%} of the light left the scene without hitting anything twice; more photons lower the noise",
            )
        )
    return doubts
