"""What type checkers and editors are told of the calls, their results and what plugins extend."""

import inspect
import types
from functools import cached_property
from importlib import import_module
from typing import Any, Union, get_args, get_origin

import tractexp
from tractexp.api.read import Dips
from tractexp.outcome import Outcome
from tractexp.record import Event, Record, WaveEvent

# Settings of readers: Hydra's schema knows no union of a text and a mapping.
OF_SCHEMA = {"WaveformReader.connection", "WaveformReader.estimator", "Tabular.sheet"}
# `build` makes a plugin of any group, whose class is known to who names it; an effect is shown
# events of the domain that it takes; what `generations` hands on is SciPy's to say.
OF_CALLER = {"build()", "Effect.describe_sign(event)", "generations(settings)"}


def is_any(annotation):
    """Whether an annotation says nothing: `Any`, alone or in a union."""
    if isinstance(annotation, str):
        return "Any" in (part.strip() for part in annotation.split("|"))
    if get_origin(annotation) in (Union, types.UnionType):
        return any(map(is_any, get_args(annotation)))
    return annotation is Any


def list_untyped(name, function):
    """The arguments, and what is returned, of which nothing is said. `*_: Any, **parameters: Any`
    is how a base says that its subclasses name arguments of their own.
    """
    signature = inspect.signature(inspect.unwrap(function))
    told = {p.name: p for p in signature.parameters.values()}
    open_ended = {p.kind for p in told.values()} >= {inspect.Parameter.VAR_POSITIONAL}
    for p in told.values():
        starred = p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
        if is_any(p.annotation) and not (starred and open_ended and "_" in told):
            yield f"{name}({p.name})"
    if is_any(signature.return_annotation) and not (open_ended and "_" in told):
        yield f"{name}()"


def list_functions(cls):
    """The public methods and properties of a class of ours, by name."""
    for base in cls.__mro__:
        if not base.__module__.startswith("tractexp"):
            continue
        for name, value in vars(base).items():
            if isinstance(value, property):
                value = value.fget
            elif isinstance(value, cached_property):
                value = value.func
            elif isinstance(value, classmethod | staticmethod):
                value = value.__func__
            if inspect.isfunction(value) and (name[0] != "_" or name == "__getitem__"):
                yield f"{base.__name__}.{name}", value


def list_public_objects():
    """The calls and classes that a user touches."""
    for name in tractexp.PUBLIC:
        yield name, getattr(tractexp, name)
    for place in ("", ".search", ".files", ".formats", ".symbols"):
        module = import_module(f"tractexp.extend{place}")
        for name in module.__all__:
            yield name, getattr(module, name)
    for cls in (*Outcome.kinds.values(), Dips, Event, Record, WaveEvent):
        yield cls.__name__, cls


def test_no_argument_and_no_result_that_a_user_touches_is_any():
    untyped = set()
    for name, thing in list_public_objects():
        if inspect.isfunction(thing):
            untyped |= {*list_untyped(name, thing)}
        elif inspect.isclass(thing):
            for method, function in list_functions(thing):
                untyped |= {*list_untyped(method, function)}
            own = inspect.get_annotations(thing)
            untyped |= {f"{name}.{key}" for key, kind in own.items() if is_any(kind)}
    assert untyped == OF_SCHEMA | OF_CALLER
