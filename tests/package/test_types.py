# SPDX-License-Identifier: GPL-3.0-or-later
"""In the core, only what Numba compiles goes without type annotations; mypy checks the rest."""

from __future__ import annotations

import ast

from scripts.wheel_lock import ROOT

CORE = ROOT / "ivg_addon" / "core"
KERNEL_DECORATORS = {"kernel", "inlined", "merged"}


def decorators(function: ast.FunctionDef) -> set[str]:
    """Return the names of a function's decorators, without their arguments."""
    expressions = [item.func if isinstance(item, ast.Call) else item for item in function.decorator_list]
    return {item.id for item in expressions if isinstance(item, ast.Name)}


def is_annotated(function: ast.FunctionDef) -> bool:
    """Return whether a function has any annotation: mypy sees to it that it then has all."""
    arguments = function.args.posonlyargs + function.args.args + function.args.kwonlyargs
    return function.returns is not None or any(argument.annotation for argument in arguments)


def test_only_kernels_go_without_types() -> None:
    untyped = [
        f"{path.relative_to(CORE)}:{node.lineno} {node.name}"
        for path in sorted(CORE.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.FunctionDef) and not is_annotated(node) and not decorators(node) & KERNEL_DECORATORS
    ]
    assert untyped == []
