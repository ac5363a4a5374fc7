# SPDX-License-Identifier: Apache-2.0
"""Compiled copy of the controller's energy account.

The source of `control.energy.tank` is translated, not duplicated: frozen dataclasses become named
tuples, which Numba supports, and every function is compiled. A change of the account also changes
the account of the gauntlet.
"""

import ast
import inspect
from collections import namedtuple
from collections.abc import Callable
from dataclasses import astuple, dataclass, fields, is_dataclass
from functools import cache
from types import ModuleType
from typing import Any

from noninteract_ros.control.energy import tank as energy_tank
from noninteract_ros.control.energy.tank import TankSettings
from noninteract_ros.validation.gauntlet.arrays import compiled

REMEMBERED = "EnergyTank"  # the dataclass that the account replaces from step to step


@dataclass(frozen=True)
class CompiledAccount:
    """Functions and types of the account as compiled code can use them.

    Attributes:
        full_tank: (settings, potential) -> tank.
        step: (tank, interval, settings) -> tank.
        observed: (tank, sigma) -> tank, for laws without gates.
        interval: Type of the quantities of one tick; same fields as `energy_tank.Interval`.
        tank: Type of the account's state; same fields as `energy_tank.EnergyTank`.
        settings: Type of the settings; same fields as `energy_tank.TankSettings`.
    """

    full_tank: Callable[..., Any]
    step: Callable[..., Any]
    observed: Callable[..., Any]
    interval: type
    tank: type
    settings: type

    def settings_of(self, chosen: TankSettings) -> Any:
        """Convert settings for compiled code."""
        return self.settings(*(float(value) for value in astuple(chosen)))


@cache
def compiled_account() -> CompiledAccount:
    """Translate the account; its functions are compiled at their first call."""
    types = _twins(energy_tank)
    translated = _Translation(types)
    functions = translated.visit(_functions(energy_tank))
    replacing = [replacement(names, types[REMEMBERED]) for names in translated.used]
    space: dict[str, Any] = dict(types)
    for source in (*replacing, *map(ast.unparse, functions.body)):
        exec(source, space)
    originals = [item for item in space.values() if inspect.isfunction(item)]
    # Compiled cases are scalar; the original functions accept arrays as well.
    scalar = {"_less": _less, "_greater": _greater}
    for item in originals:
        space[item.__name__] = compiled(scalar.get(item.__name__, item))
    names = ("full_tank", "step", "observed", "Interval", REMEMBERED, "TankSettings")
    return CompiledAccount(*(space[name] for name in names))


def _less(first: float, second: float) -> float:
    return first if first <= second else second


def _greater(first: float, second: float) -> float:
    return first if first >= second else second


def _twins(module: ModuleType) -> dict[str, Any]:
    """Create a named tuple with the fields of each dataclass of a module."""
    return {
        name: namedtuple(name, [item.name for item in fields(kind)])
        for name, kind in vars(module).items()
        if inspect.isclass(kind) and is_dataclass(kind) and kind.__module__ == module.__name__
    }


def _functions(module: ModuleType) -> ast.Module:
    tree = ast.parse(inspect.getsource(module))
    return ast.Module([node for node in tree.body if isinstance(node, ast.FunctionDef)], [])


class _Translation(ast.NodeTransformer):
    """Translation of `replace(tank, a=x)` to `replace_a(tank, x)`, without annotations.

    Args:
        types: The named tuples, by name.

    Attributes:
        used: Sets of fields that are replaced together, each sorted.
    """

    def __init__(self, types: dict[str, Any]) -> None:
        self._types = types
        self.used: set[tuple[str, ...]] = set()

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        """Remove the annotations of a function."""
        for argument in node.args.args:
            argument.annotation = None
        node.returns = None
        self.generic_visit(node)
        return node

    def visit_Call(self, node: ast.Call) -> ast.Call:
        """Translate a call of `replace` or of a constructor."""
        self.generic_visit(node)
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name in self._types:
            return ast.Call(node.func, self._all_fields(self._types[name], node), [])
        if name != "replace":
            return node
        changed = sorted(node.keywords, key=lambda item: str(item.arg))
        names = tuple(str(item.arg) for item in changed)
        self.used.add(names)
        arguments = [*node.args, *(item.value for item in changed)]
        return ast.Call(ast.Name("_".join(("replace", *names)), ast.Load()), arguments, [])

    @staticmethod
    def _all_fields(kind: Any, node: ast.Call) -> list[ast.expr]:
        """Return the values of all fields in order, as compiled constructors require."""
        given = dict(zip(kind._fields, node.args, strict=False))
        given |= {str(item.arg): item.value for item in node.keywords}
        return [given[name] for name in kind._fields]


def replacement(names: tuple[str, ...], kind: Any) -> str:
    """Return the source of a function that replaces fields of a named tuple."""
    values = ", ".join(name if name in names else f"old.{name}" for name in kind._fields)
    head = f"def {'_'.join(('replace', *names))}(old, {', '.join(names)}):"
    return f"{head}\n    return {kind.__name__}({values})\n"
