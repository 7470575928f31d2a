# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons of lights that may not light everything, stop at everything, or bounce for ever.

The first flight of such a photon goes on through objects that do not block its light, to the first that does. Of the
j surfaces on its way that its light may light it meets one, each with the probability 1/j, and has j times the weight
there: all of them receive the light, as they do in Cycles, where what casts no shadow is lit all the same. In the air
its light counts up to the end of its way, if the light lights objects that its collections do not name.

Mirrors and clear glass are lit by what a ray that leaves them finds: there Cycles asks no shadow ray for lamps. So they
are no surface on the way where diffuse rays see another before them.

Light that a transparent surface lets pass goes on as restricted as it came; what a surface reflects lights everything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel
from .embree import MISS, Hits, Tracer
from .emission import Emission
from .emission.photons import pick
from .light_rules import LightRules
from .lights import NO_LIMIT
from .microfacets import MIRROR_ALPHA
from .random import STREAM_EMISSION, random4
from .scattering import CUT, ENERGY_STEPS
from .scene import GLASS, GLOSSY, PANE, REFRACTION, TRANSPARENT, Float32, Int32, Materials, Scene
from .tally import WEIGHT_LIMIT

_STREAM = STREAM_EMISSION + 15
"""The last of the streams of emission, which no light draws from."""
_STEP = 2e-6
"""By what share of the largest coordinate a flight goes on behind a surface that it passes."""


@dataclass(frozen=True)
class RestrictedLight:
    """The rules of a scene's lights, by emitter.

    Parameters
    ----------
    rules
    cumulative : (emitters,) float64
        From `emission.photons.Emitters`.
    group, limit : (emitters,) int32
        Each emitter's group and most bounces.
    object : (nt,) int32
        From `scene.Geometry`.
    hides, sharp : (nt,) bool
        What diffuse rays see, and what is nothing but mirrors and clear glass.
    """

    rules: LightRules | None
    cumulative: NDArray[np.float64]
    group: Int32
    limit: Int32
    object: Int32
    hides: NDArray[np.bool_]
    sharp: NDArray[np.bool_]

    @classmethod
    def of(cls, scene: Scene, emission: Emission) -> RestrictedLight | None:
        """Return what applies the scene's rules; None where no light has any."""
        lights, rules = scene.lights, scene.light_rules
        pieces = len(emission.emitters.triangles.pieces.triangle)
        # Lights in their order, the rest of the surroundings, emissive triangles.
        group = np.zeros(len(emission.emitters.cumulative), dtype=np.int32)
        limit = np.full(len(group), NO_LIMIT, dtype=np.int32)
        if rules is not None:
            shining = scene.geometry.object[emission.emitters.triangles.pieces.triangle]
            group[len(group) - pieces :] = rules.object_group[shining]
            if lights.group is not None:
                group[: len(lights.group)] = lights.group
        if lights.max_bounces is not None:
            limit[: len(lights.max_bounces)] = lights.max_bounces
        _repeat_for_boxes(emission, group)
        _repeat_for_boxes(emission, limit)
        chooses = group.any() or (rules is not None and rules.restrict_all)
        if not chooses and limit.min() >= NO_LIMIT:
            return None
        return cls(
            rules=rules,
            cumulative=emission.emitters.cumulative,
            group=group,
            limit=limit,
            object=scene.geometry.object,
            hides=scene.diffuse_visible[scene.geometry.object],
            sharp=_sharp(scene.materials)[scene.geometry.material],
        )

    def aimed(self, emission: Emission) -> RestrictedLight:
        """Return the same rules for an emission whose emitters are picked otherwise."""
        return replace(self, cumulative=emission.emitters.cumulative)

    @property
    def ends(self) -> bool:
        """Whether some light ends after a number of bounces."""
        return bool(self.limit.min() < NO_LIMIT)

    @property
    def chooses(self) -> bool:
        """Whether some light does not light, or stop at, everything."""
        return self.rules is not None and (self.rules.restrict_all or bool(self.group.any()))

    def end(
        self,
        seed: int,
        photons: NDArray[np.int64],
        origins: Float32,
        directions: Float32,
        weights: Float32,
        bounces: NDArray[np.int16],
        dark: Float32,
        energy: NDArray[np.int64],
    ) -> int:
        """Take out photons whose light does not go on after their bounces; return how many are left, at the front."""
        flights = (origins, directions, weights, bounces, dark)
        return int(end_photons(seed, self.cumulative, self.limit, photons, *flights, energy))

    def follow(
        self,
        tracer: Tracer,
        seed: int,
        flight: int,
        photons: NDArray[np.int64],
        bounces: NDArray[np.int16],
        origins: Float32,
        directions: Float32,
        dark: Float32,
        hits: Hits,
    ) -> Float32:
        """Let direct light go on to its ends; return the weight's factor at the surface that each photon meets, (n,).

        Parameters
        ----------
        seed
            Key of the random numbers.
        flight
            Flights that came before: light that has only passed transparent surfaces is still direct.
        photons : (n,) int64, bounces : (n,) int16, directions : (n, 3) float32
        origins : (n, 3) float32, dark : (n,) float32
            As for `emission.leave_darkness`; changed for restricted light, which begins there.
        hits
            Changed in place: the surface that is lit, and how far light counts in the air.
        """
        assert self.rules is not None
        factor = np.ones(len(photons), dtype=np.float32)
        group = np.empty(len(photons), dtype=np.int32)
        find_groups(seed, photons, self.cumulative, self.group, group)
        rows = np.flatnonzero((bounces == 0) & (self.rules.restrict_all | (group > 0)))
        way = _Way(
            self,
            self.rules,
            tracer,
            seed,
            flight,
            photons[rows],
            group[rows],
            origins[rows],
            directions[rows],
            dark[rows],
        )
        found = way.to_the_end(Hits(hits.triangle[rows], hits.u[rows], hits.v[rows], hits.distance[rows]))
        hits.triangle[rows], hits.u[rows], hits.v[rows] = found.triangle, found.u, found.v
        hits.distance[rows] = np.where(self.rules.lights_others[group[rows]], found.distance, 0.0)
        origins[rows] += dark[rows, None] * directions[rows]
        dark[rows] = 0.0
        factor[rows] = np.maximum(way.lit, 1)
        return factor


def _repeat_for_boxes(emission: Emission, values: Int32) -> None:
    """Give each sun the value that it has among the emitters for the first box also among those for the others."""
    surroundings, suns = values[emission.guided].reshape(emission.boxes, -1), len(emission.emitters.suns.direction)
    surroundings[1:, :suns] = surroundings[0, :suns]


def _sharp(materials: Materials) -> NDArray[np.bool_]:
    """Tell which materials, (m,), scatter light but into single directions."""
    lobes = materials.lobes
    mirrors = np.isin(lobes.kind, (GLOSSY, GLASS, REFRACTION, PANE)) & (lobes.roughness**2 <= MIRROR_ALPHA)
    sharp = np.zeros(len(materials.names), dtype=np.bool_)
    sharp[lobes.material[mirrors]] = True
    sharp &= ~materials.albedo.any(axis=1)
    sharp[lobes.material[~mirrors & (lobes.kind != TRANSPARENT)]] = False
    return sharp


class _Way:
    """The first flights of n restricted photons, from surface to surface."""

    def __init__(
        self,
        light: RestrictedLight,
        rules: LightRules,
        tracer: Tracer,
        seed: int,
        flight: int,
        photons: NDArray[np.int64],
        group: Int32,
        origins: Float32,
        directions: Float32,
        dark: Float32,
    ) -> None:
        self._object, self._hides, self._sharp = light.object, light.hides, light.sharp
        self._tracer = tracer
        self._origins, self._directions, self._dark = origins, directions, dark
        bit = np.left_shift(np.uint64(1), group.astype(np.uint64))
        self._receives = lambda rows, objects: (rules.receives[objects] & bit[rows]) != 0
        self._blocks = lambda rows, objects: (rules.blocks[objects] & bit[rows]) != 0
        self._coin = np.empty(len(photons))
        draw(seed, flight, photons, self._coin)
        self._hidden = np.zeros(len(photons), dtype=np.bool_)
        self.lit = np.zeros(len(photons), dtype=np.int32)

    def to_the_end(self, first: Hits) -> Hits:
        """Return the surface that each photon lights, and the length of its way from where it carries light."""
        n = len(self._coin)
        found = Hits(np.full(n, MISS, dtype=np.int32), np.zeros(n, np.float32), np.zeros(n, np.float32), first.distance)
        rows, hits, travelled = np.arange(n), first, np.zeros(n, dtype=np.float32)
        last = np.full(n, MISS, dtype=np.int32)
        while len(rows):
            place = travelled + hits.distance
            hit = hits.triangle != MISS
            found.distance[rows] = np.where(hit, place, np.float32(1e37))
            rows, place, hits = rows[hit], place[hit], _at(hits, hit)
            # A step that was too short meets the same triangle once more.
            new = hits.triangle != last[rows]
            last[rows] = hits.triangle
            self._light(rows[new], place[new], _at(hits, new), found)
            ends = self._blocks(rows, self._object[hits.triangle]) | (self.lit[rows] >= WEIGHT_LIMIT)
            rows, travelled = rows[~ends], self._behind(rows[~ends], place[~ends])
            origins = self._origins[rows] + travelled[:, None] * self._directions[rows]
            hits = self._tracer.intersect(origins, np.ascontiguousarray(self._directions[rows]))
        reached = np.maximum(found.distance - self._dark, 0.0)
        return Hits(found.triangle, found.u, found.v, reached)

    def _light(self, rows: NDArray[np.int64], place: Float32, hits: Hits, found: Hits) -> None:
        """Choose this surface among those that are lit so far, with equal chances."""
        lit = self._receives(rows, self._object[hits.triangle]) & (place > self._dark[rows])
        lit &= ~(self._hidden[rows] & self._sharp[hits.triangle])
        self._hidden[rows] |= self._hides[hits.triangle]
        rows, hits = rows[lit], _at(hits, lit)
        self.lit[rows] += 1
        share = 1.0 / self.lit[rows]
        chosen = self._coin[rows] < share
        # What is left of a uniform number after it has decided is a uniform number again.
        rest = np.where(chosen, self._coin[rows] / share, (self._coin[rows] - share) / np.maximum(1.0 - share, 1e-12))
        self._coin[rows] = rest
        for kept, new in ((found.triangle, hits.triangle), (found.u, hits.u), (found.v, hits.v)):
            kept[rows[chosen]] = new[chosen]

    def _behind(self, rows: NDArray[np.int64], place: Float32) -> Float32:
        """Return the distance at which a flight is just behind the surface at `place`."""
        largest = np.abs(self._origins[rows]).max(axis=1, initial=0.0) + place
        return np.asarray(place + _STEP * largest, dtype=np.float32)


def _at(hits: Hits, chosen: NDArray[np.bool_]) -> Hits:
    return Hits(hits.triangle[chosen], hits.u[chosen], hits.v[chosen], hits.distance[chosen])


@kernel
def find_groups(seed, photons, cumulative, group, groups):
    """Fill groups (n,) int32 with that of each photon's emitter."""
    for i in range(len(photons)):
        coarse, fine, _, _ = random4(seed, photons[i], STREAM_EMISSION)
        groups[i] = group[pick(cumulative, coarse, fine)]


@kernel
def draw(seed, flight, photons, numbers):
    """Fill numbers (n,) float64 with a uniform number of each photon and flight."""
    for i in range(len(photons)):
        numbers[i] = random4(seed, photons[i] + (flight << 48), _STREAM)[0]


@kernel
def end_photons(seed, cumulative, limit, photons, origins, directions, weights, bounces, dark, energy):
    """Move photons whose light goes on to the front; return their number. Others count as cut."""
    alive = 0
    for i in range(len(photons)):
        coarse, fine, _, _ = random4(seed, photons[i], STREAM_EMISSION)
        if limit[pick(cumulative, coarse, fine)] < bounces[i]:
            for channel in range(3):
                energy[CUT, channel] += np.int64(weights[i, channel] * ENERGY_STEPS)
            continue
        photons[alive] = photons[i]
        bounces[alive] = bounces[i]
        dark[alive] = dark[i]
        for axis in range(3):
            origins[alive, axis] = origins[i, axis]
            directions[alive, axis] = directions[i, axis]
            weights[alive, axis] = weights[i, axis]
        alive += 1
    return alive
