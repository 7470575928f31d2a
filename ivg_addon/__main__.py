# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m ivg_addon …`: the command line over the bpy module."""

import sys

from .blender.command_line import main

sys.exit(main(sys.argv[1:], "python -m ivg_addon"))
