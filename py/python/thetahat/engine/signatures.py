"""What `inspect.signature`, and with it a question mark in a notebook, shows: aliases of types in full, and the types of compiled classes."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterable, Mapping
from functools import lru_cache
from math import inf
from pathlib import Path
from types import FunctionType
from typing import Any

from thetahat.engine import values as _values

_ALIAS = re.compile(rf"\b({'|'.join(name for name in vars(_values) if name[0].isupper())})\b")


def spelled_out(annotation: Any, names: Mapping[str, Any]) -> Any:
    """An annotation with an alias as the types that it stands for; another one, and one that this Python cannot read, as it is."""
    if not isinstance(annotation, str) or _ALIAS.search(annotation) is None:
        return annotation
    try:
        return eval(annotation, dict(names))  # noqa: S307
    except (NameError, TypeError):
        return annotation


def spell_out(public: Iterable[Any]) -> None:
    """Show the annotations of functions and classes in full."""
    for one in public:
        if isinstance(one, FunctionType):
            _spell_out(one)
        elif isinstance(one, type) and one.__module__ == "thetahat" and "__init__" not in vars(one):
            one.__signature__ = _OfStub()  # type: ignore[attr-defined]
        elif isinstance(one, type):
            for method in vars(one).values():
                function = getattr(method, "__func__", method)
                if isinstance(function, FunctionType):
                    _spell_out(function)


def _spell_out(function: FunctionType) -> None:
    for name, annotation in function.__annotations__.items():
        function.__annotations__[name] = spelled_out(annotation, function.__globals__)


class _OfStub:
    """The signature of a compiled class, read from the stub when somebody asks: compiled code has none with types."""

    def __get__(self, instance: object, owner: type) -> inspect.Signature:
        found = _stub().get(owner.__name__)
        if found is None:
            raise AttributeError(f"type object {owner.__name__!r} has no attribute '__signature__'")
        return found


@lru_cache(None)
def _stub() -> dict[str, inspect.Signature]:
    """The signatures of the classes in the stub, by their names."""
    text = Path(__file__).parent.parent.joinpath("_thetahat.pyi").read_text(encoding="utf-8")
    body = ast.parse(text).body
    aliases = {
        one.targets[0].id: ast.unparse(one.value)
        for one in body
        if isinstance(one, ast.Assign) and isinstance(one.targets[0], ast.Name) and one.targets[0].id.startswith("_")
    }
    return {
        one.name: _signature(method.args, aliases)
        for one in body
        if isinstance(one, ast.ClassDef)
        for method in one.body
        if isinstance(method, ast.FunctionDef) and method.name == "__new__"
    }


def _signature(arguments: ast.arguments, aliases: Mapping[str, str]) -> inspect.Signature:
    def parameter(argument: ast.arg, kind: Any, default: ast.expr | None) -> inspect.Parameter:
        annotation = "" if argument.annotation is None else ast.unparse(argument.annotation)
        annotation = re.sub(r"\b_\w+", lambda name: aliases.get(name[0], name[0]), annotation)
        known = inspect.Parameter.empty if default is None else ast.literal_eval(default)
        if known is Ellipsis:
            # The stub has dots where no literal says infinity.
            known = inf
        return inspect.Parameter(argument.arg, kind, default=known, annotation=annotation or inspect.Parameter.empty)

    placed = arguments.args[1:]
    defaults = [None] * (len(placed) - len(arguments.defaults)) + list(arguments.defaults)
    by_place = [parameter(one, inspect.Parameter.POSITIONAL_OR_KEYWORD, given) for one, given in zip(placed, defaults)]
    by_name = [parameter(one, inspect.Parameter.KEYWORD_ONLY, given) for one, given in zip(arguments.kwonlyargs, arguments.kw_defaults)]
    return inspect.Signature([*by_place, *by_name])
