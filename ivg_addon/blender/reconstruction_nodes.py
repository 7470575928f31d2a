# SPDX-License-Identifier: GPL-3.0-or-later
"""The least-squares reconstruction as nodes: the twelve coefficients that a normal gives F and D (core/moments.py).

E(n) = ½ (F·n + Σ_kj W_kj(n) D_kj)                                       (core/reconstruction.py has W)
"""

from __future__ import annotations

import math

from .node_formulas import NodeFormulas, Socket

_TURNED = 1.0 / (math.pi - 2.0)
"""Of a_k n_l − a_l n_k in W_kl."""


def coefficients(maths: NodeFormulas, normal: Socket) -> list[Socket]:
    """Return the coefficients of F_x … D_zz at a unit normal, numbers; at 0 those of the mean over all normals."""
    # Rounding makes unit vectors longer than one, of which EEVEE's arc sine is 0.
    n = maths.vector("MINIMUM", maths.vector("MAXIMUM", normal, (-1.0,) * 3), (1.0,) * 3)
    components = maths.separated(n)
    arcs = [maths.math("ARCSINE", component) for component in components]
    a = maths.combined(*arcs)
    # ½ W_kk = ½ n_k² for unit normals, 1/6 for none.
    rest = maths.math("MULTIPLY_ADD", maths.dot(n, n), -1.0 / 6.0, 1.0 / 6.0)
    own = maths.vector("MULTIPLY_ADD", n, maths.scaled(n, 0.5), maths.combined(rest, rest, rest))
    # ½ W_kl = n_l (¼ n_k + ½ _TURNED a_k) − a_l ½ _TURNED n_k
    along = maths.separated(maths.vector("MULTIPLY_ADD", a, (0.5 * _TURNED,) * 3, maths.scaled(n, 0.25)))
    across = maths.scaled(a, -0.5 * _TURNED)
    diagonal = maths.separated(own)
    found = list(maths.separated(maths.scaled(n, 0.5)))
    for k in range(3):
        row = maths.vector("ADD", maths.scaled(n, along[k]), maths.scaled(across, components[k]))
        found += [diagonal[k] if j == k else component for j, component in enumerate(maths.separated(row))]
    return found
