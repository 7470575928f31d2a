# SPDX-License-Identifier: GPL-3.0-or-later
"""Find out which photons of the surroundings are of use, and send more of those.

Of the light of a sky that falls on a house, what comes through a window is a small part; photons
that meet the outer walls are wasted. A pilot of some photons per cent flies first. The merit of a
photon is the length of its flights that count inside the grid's box, weighted: what it adds to the
sums, squared and summed over cells, is in proportion to that. Leaves of `division.py` learn where
the merit is, in three rounds, each aimed by those before it; `guide.py` makes the rest of the bake
follow them. The bake's own photons are others than the pilot's, and whatever the pilot found, each
carries as much less flux as there are more of its kind: the result is unbiased.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel
from .dual_cells import Lattice
from .emission import Emission
from .emission.division import Leaf, divide, mean_merit, with_ratios
from .emission.guide import Leaves
from .photon_walk import BATCH, Course, Worker, thread_count
from .progress import Progress
from .scene import Float32
from .settings import BakeSettings
from .tally import clip_to_box, in_voxels
from .vectors import largest_of

if TYPE_CHECKING:
    from .emission.prepare import Draws

Float64 = NDArray[np.float64]

_FIRST_PHOTON = 1 << 40
"""Photons of the pilot have indices that no photon of a bake has."""
_SHARE = 12
"""One photon of the pilot for so many of the bake."""
_FEWEST, _MOST = 1 << 12, 1 << 20
_ROUNDS = (0.2, 0.3, 0.5)
_LARGEST_RATIO = 256.0
"""Of photons in one place to those in another: what was missed by the pilot is never rarer than that."""
_WORTH_IT = 1.1
"""Expected gain from which on photons are aimed at all."""


@dataclass(frozen=True)
class Aim:
    """What the pilot found out about the photons of suns, world and environment.

    Parameters
    ----------
    photons
        Photons of the pilot.
    useful, useful_without
        Share of the photons of the surroundings that add to the grid: as the bake sends them, and as they would be
        without aim.
    gain
        Variance without aim over variance with it, as the pilot expects it; 1 where nothing is aimed.
    """

    photons: int
    useful: float
    useful_without: float
    gain: float


def aim_steps(
    course: Course, lattice: Lattice, settings: BakeSettings
) -> Generator[Progress, None, tuple[Course, Aim | None]]:
    """Return the course with its emission aimed, and what that is worth; yields before every round.

    Without surroundings that shine, or with too few photons to spare some, the course is what it was, and there is no
    `Aim`.
    """
    plain = course.emission
    pilot = min(settings.photons // _SHARE, _MOST)
    if pilot < _FEWEST or not plain.strengths[plain.guided].any():
        return course, None
    found = _Findings(plain)
    emission, first = found.start(), _FIRST_PHOTON
    for index, share in enumerate(_ROUNDS):
        yield Progress("Aiming the light of the surroundings", index / len(_ROUNDS))
        count = int(share * pilot)
        found.add(*_fly(_with(course, emission), lattice, settings, first, count))
        first += count
        emission = found.aimed()
    aim = found.aim(first - _FIRST_PHOTON)
    if aim.gain < _WORTH_IT:
        return course, replace(aim, useful=aim.useful_without, gain=1.0)
    return _with(course, emission), aim


def _with(course: Course, emission: Emission) -> Course:
    """Return a course that begins otherwise."""
    rules = course.restricted
    return replace(course, emission=emission, restricted=rules and rules.aimed(emission))


class _Findings:
    """The leaves of each emitter that can be aimed, and all others' merit."""

    def __init__(self, plain: Emission) -> None:
        self._plain = plain
        self._strengths = plain.strengths[plain.guided]
        self._rest_strength = float(plain.strengths.sum() - self._strengths.sum())
        self._leaves = [[Leaf.whole()] for _ in self._strengths]
        self._rest = np.zeros(2)
        self._typical = 0.0

    def start(self) -> Emission:
        """Return the emission of the first round: as many photons for each of the nested boxes."""
        by_box = self._strengths.reshape(self._plain.boxes, -1)
        most = by_box.sum(axis=1).max()
        ratios = np.clip(most / np.maximum(by_box.sum(axis=1), 1e-30), 1.0, _LARGEST_RATIO)
        each = np.repeat(ratios, by_box.shape[1])
        return self._plain.aimed([replace(Leaves.whole(), ratio=np.array([r])) for r in each], 1.0)

    def add(self, drawn: Draws, merit: Float64) -> None:
        """Take in a round of the pilot, which flew by the leaves found so far, and divide them further."""
        flat = [leaf for leaves in self._leaves for leaf in leaves]
        of_rest = drawn.guided < 0
        self._rest += (merit[of_rest].sum(), of_rest.sum())
        places = np.where(of_rest, len(flat), drawn.leaf)
        order = np.argsort(places, kind="stable")
        ends = np.cumsum(np.bincount(places, minlength=len(flat) + 1))
        for leaf, start, end in zip(flat, np.r_[0, ends], ends, strict=False):
            rows = order[start:end]
            leaf.add(drawn.numbers[rows], merit[rows])
        merits = np.concatenate([leaf.merit for leaf in flat])
        useful = merits[merits > 0.0]
        self._typical = float(useful.mean()) if len(useful) else 0.0
        if self._typical > 0.0:
            self._leaves = [divide(leaves, self._typical) for leaves in self._leaves]

    def aimed(self) -> Emission:
        """Return the emission, aimed by what is known so far."""
        if not self._typical > 0.0:
            return self._plain
        ratios, rest = self._ratios()
        leaves = [with_ratios(*pair) for pair in zip(self._leaves, ratios, strict=True)]
        return self._plain.aimed(leaves, rest)

    def _ratios(self) -> tuple[list[Float64], float]:
        """Return r of each emitter's leaves, √ū over the smallest √ū, and of all other emitters."""
        roots = [np.sqrt(self._means(leaves)) for leaves in self._leaves]
        rest = float(np.sqrt(mean_merit(self._rest[0], self._rest[1], self._typical)))
        counted = [root for root, s in zip(roots, self._strengths, strict=True) if s > 0.0]
        everything = np.concatenate([*counted, [rest] if self._rest_strength > 0.0 else []])
        floor = max(float(everything.min()), float(everything.max()) / _LARGEST_RATIO)
        return [np.maximum(root / floor, 1.0) for root in roots], max(rest / floor, 1.0)

    def _means(self, leaves: list[Leaf]) -> Float64:
        return np.array([float(mean_merit(leaf.merit.sum(), len(leaf.merit), self._typical)) for leaf in leaves])

    def aim(self, photons: int) -> Aim:
        """Return what aiming is worth."""
        if not self._typical > 0.0:
            return Aim(photons, 0.0, 0.0, 1.0)
        ratios, rest = self._ratios()
        rest_mean = float(mean_merit(self._rest[0], self._rest[1], self._typical))
        sent, useful = np.zeros(2), np.zeros(2)  # aimed, and without
        second = self._rest_strength * np.array([rest_mean / rest, rest_mean])
        for leaves, ratio, s in zip(self._leaves, ratios, self._strengths, strict=True):
            volume = s * np.array([leaf.volume for leaf in leaves])
            hits = np.array([(leaf.merit > 0.0).mean() if len(leaf.merit) else 0.0 for leaf in leaves])
            means = self._means(leaves)
            sent += (volume @ ratio, volume.sum())
            useful += ((volume * ratio) @ hits, volume @ hits)
            second += (volume @ (means / ratio), volume @ means)
        # Second moments of a photon's contribution; picking goes by s r of all emitters together.
        second *= sent + self._rest_strength * np.array([rest, 1.0])
        return Aim(photons, float(useful[0] / sent[0]), float(useful[1] / sent[1]), float(second[1] / second[0]))


def _fly(course: Course, lattice: Lattice, settings: BakeSettings, first: int, count: int) -> tuple[Draws, Float64]:
    """Let photons fly; return what they were made of, and their merit (n,)."""
    merit = np.zeros(count)
    firsts: queue.SimpleQueue[int] = queue.SimpleQueue()
    for at in range(first, first + count, BATCH):
        firsts.put(at)

    def run(_: int) -> None:
        pilot = _Pilot(course, lattice, settings, first, merit)
        with contextlib.suppress(queue.Empty):
            while True:
                at = firsts.get_nowait()
                pilot.fly(at, min(BATCH, first + count - at), threading.Event())

    threads = min(thread_count(settings), -(-count // BATCH))
    with ThreadPoolExecutor(threads, thread_name_prefix="ivg-aim") as pool:
        list(pool.map(run, range(threads)))
    return course.emission.draws(settings.seed, first, count), merit


class _Pilot(Worker):
    """A worker that keeps no sums but the merit of each photon."""

    def __init__(self, course: Course, lattice: Lattice, settings: BakeSettings, first: int, merit: Float64) -> None:
        super().__init__(course, Lattice(lattice.bounds_min, lattice.bounds_max, (1, 1, 1)), settings)
        self._first, self._merit = first, merit
        self._low = np.asarray(lattice.bounds_min, dtype=np.float64)
        self._extent = np.subtract(lattice.bounds_max, self._low)

    def deposit(self, origins: Float32, directions: Float32, weights: Float32, lengths: Float32) -> None:
        """Add to the merits what flights are worth."""
        photons = self.photons[: len(origins)]
        flights = (origins, directions, weights, self.standard, lengths)
        add_merit(photons, self._first, *flights, self._low, self._extent, self._merit)


@kernel
def add_merit(photons, first, origins, directions, weights, standard, lengths, low, extent, merit):
    """Add to the merit of each photon what one flight is worth: its length in a box, by its weight.

    Parameters
    ----------
    photons : (n,) int64
        Indices; merit of the photon `first` comes first.
    origins, directions, weights : (n, 3) float32
    standard : (2^k,) float32
        As for `scatter`.
    lengths : (n,) float32
        Metres to the hit.
    low, extent : (3,) float64
        The box.
    merit : float64
        In units of the box's diagonal; changed in place.
    """
    diagonal = np.sqrt(extent[0] ** 2 + extent[1] ** 2 + extent[2] ** 2)
    for ray in range(len(photons)):
        d = (float(directions[ray, 0]), float(directions[ray, 1]), float(directions[ray, 2]))
        x, inverse = in_voxels(origins, ray, d, low, extent)
        t0, t1 = clip_to_box(x, inverse, 0.0, float(lengths[ray]), (1.0, 1.0, 1.0), -1)
        if t0 < t1:
            largest = largest_of(weights[ray, 0], weights[ray, 1], weights[ray, 2])
            weight = largest / standard[photons[ray] & (len(standard) - 1)]
            merit[photons[ray] - first] += weight * weight * (t1 - t0) / diagonal
