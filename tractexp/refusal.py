"""Hydra's refusals of a configuration, told as one sentence with the nearest name."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tractexp.errors import UserError, among


@contextmanager
def explained() -> Iterator[None]:
    """Turn Hydra's and OmegaConf's exceptions into `UserError`."""
    from hydra.errors import HydraException, MissingConfigException
    from omegaconf.errors import OmegaConfBaseException

    try:
        yield
    except MissingConfigException as error:
        raise UserError(_missing(error)) from error
    except (HydraException, OmegaConfBaseException) as error:
        raise UserError(_told(error)) from error


def _missing(error: Any) -> str:
    name = str(error.missing_cfg_file or "")
    group, _, choice = name.rpartition("/")
    options = [o for o in error.options or () if not o.startswith("_")]
    if not group or not options:
        return _first_line(error)
    return f"{group}={choice}: there is no such choice{among(choice, options)}"


def _told(error: BaseException) -> str:
    chain = [error]
    while (cause := chain[-1].__cause__ or chain[-1].__context__) is not None and cause not in chain:
        chain.append(cause)
    for link in chain:
        key = getattr(link, "full_key", None)
        text = _first_line(link)
        if key and ("not in" in text or "is not in struct" in text):
            return _unknown_key(key, link)
        if key and ("could not be converted" in text or "incompatible" in text or "not supported" in text):
            return f"{key}: {_decapitalized(text)}"
    group = re.search(r"Could not override '([^']*)'", _first_line(error))
    if group and "No match in the defaults list" in str(error):
        groups = _groups()
        return f"there is no group '{group[1]}'{among(group[1], groups, 'Groups')}"
    return _first_line(error)


def _unknown_key(key: str, error: Any) -> str:
    parent = getattr(error, "parent_node", None)
    try:
        known = sorted(map(str, parent.keys())) if parent is not None else []
    except Exception:
        known = []
    section, _, last = key.rpartition(".")
    where = f"'{section}' has" if section else "the configuration has"
    return f"{key}: {where} no key '{last}'{among(last, known, 'Keys')}"


def _groups() -> list[str]:
    from tractexp.plugin import discover

    return sorted({*discover(), "model", "experiment"})


def _first_line(error: BaseException) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__


def _decapitalized(text: str) -> str:
    return text[:1].lower() + text[1:]
