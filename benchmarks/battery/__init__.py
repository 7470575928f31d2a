# SPDX-License-Identifier: GPL-3.0-or-later
"""The proof that what Cycles lights, the bake lights: small scenes, one feature each.

Run it by `python -m benchmarks.battery`.
"""
