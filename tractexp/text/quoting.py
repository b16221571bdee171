"""Text of others, such as names in records, as it stands in what is read as code: one function for
each language.

Whatever the text holds, what is read back is the text, and nothing of it is obeyed.
"""

import html as _html
import json
import os
import re
import shlex
from collections.abc import Mapping
from typing import Any

# what OmegaConf replaces, and the backslashes that keep it from that
INTERPOLATION = re.compile(r"(\\*)\$\{")
# what neither cmd.exe nor PowerShell reads as more than letters
WINDOWS_WORD = re.compile(r"[\w.=:/\\+-]+")
# what a POSIX shell does not take as it stands within double quotes
DOUBLE_UNSAFE = re.compile(r'["$`\\!]')
MARKDOWN = frozenset("\\`*_<>[]|$~&#")
# what begins a formula where a spreadsheet opens a table
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


def python(text: str) -> str:
    """The inside of a string literal of Python that is not raw, whatever its quotes: of a
    docstring, too.

    What is no character, as in the name of a file that is no UTF-8, is read back as its escape.
    """
    text = text.encode(errors="backslashreplace").decode()
    return "".join(
        f"\\{c}" if c in "\\\"'" else c if c.isprintable() else _code(ord(c)) for c in text
    )


def _code(point: int) -> str:
    """A character as an escape of Python."""
    return (
        f"\\x{point:02x}"
        if point < 0x100
        else f"\\u{point:04x}"
        if point < 0x10000
        else f"\\U{point:08x}"
    )


def modelica(text: str) -> str:
    r"""A string of Modelica with its quotes.

    Source: Modelica specification 3.6, section 2.4.3.

    Examples
    --------
    >>> print(modelica('bus "A"'))
    "bus \"A\""
    """
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def html(text: str) -> str:
    """A text as it stands in an element of HTML, or in an attribute with its quotes around.

    Examples
    --------
    >>> html("<b>")
    '&lt;b&gt;'
    """
    return _html.escape(text)


def unescape_html(text: str) -> str:
    """The text that `html` was given."""
    return _html.unescape(text)


def script(data: Any) -> str:
    """JSON within a <script> element, which no text in it ends."""
    return json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":")).replace(
        "<", "\\u003c"
    )


def markdown(text: str) -> str:
    r"""A text as it stands in a line of Markdown, of a table, too.

    Examples
    --------
    >>> print(markdown("a_b"))
    a\_b
    """
    return "".join(f"\\{c}" if c in MARKDOWN else c for c in " ".join(text.splitlines()))


def markdown_again(text: str) -> str:
    """Markdown that somebody else may have written, as what `markdown` makes of its text: no link,
    no picture.
    """
    return markdown(re.sub(r"\\([\\`*_<>\[\]|$~&#])", r"\1", text))


def fence_markdown(text: str) -> str:
    """A block of code of Markdown, which no backticks in the text end.

    Examples
    --------
    >>> fence_markdown("``````").splitlines()[0]
    '```````'
    """
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return f"{fence}\n{text}\n{fence}"


def hydra(text: str, *, literal: bool = True) -> str:
    """A value of Hydra's grammar in quotes; where it is `literal`, an interpolation within it is
    text, too.
    """
    return (
        "'" + re.sub(r"\\*('|$)", _double_backslashes, omegaconf(text) if literal else text) + "'"
    )


def _double_backslashes(match: re.Match[str]) -> str:
    """Backslashes before a quote, or at the end: only there are they read as an escape."""
    mark, slashes = match[1], match[0].removesuffix(match[1])
    return 2 * slashes + ("\\'" if mark else "")


def omegaconf(text: str) -> str:
    """A text of a configuration, within which an interpolation is text."""
    return INTERPOLATION.sub(lambda match: 2 * match[1] + "\\${", text)


def yaml(content: Mapping[str, Any]) -> str:
    """A configuration's file: keys stay in order, and no text in it is an interpolation."""
    import yaml as library

    return library.safe_dump(_literal(content), sort_keys=False, allow_unicode=True)


def _literal(content: Any) -> Any:
    """Plain data whose texts OmegaConf does not interpolate."""
    if isinstance(content, Mapping):
        return {key: _literal(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_literal(value) for value in content]
    return omegaconf(content) if isinstance(content, str) else content


def comment(text: str) -> str:
    """Text in a comment of one line, in YAML: nothing in it ends the line."""
    return "".join(c if c.isprintable() else " " for c in text)


def shell(*words: str) -> str:
    """A command as a shell of this system takes it."""
    quote = quote_for_windows if os.name == "nt" else _quote_for_posix
    return " ".join(map(quote, words))


def _quote_for_posix(word: str) -> str:
    """A word that holds single quotes is read more easily in double ones, where these are safe."""
    return f'"{word}"' if "'" in word and not DOUBLE_UNSAFE.search(word) else shlex.quote(word)


def quote_for_windows(word: str) -> str:
    """A word as cmd.exe and PowerShell take it, both: single quotes are letters to the one, and a
    comma ends a word for the other.

    A backslash is one but before a quote. What cmd.exe puts in for %NAME%, and PowerShell for
    $NAME, no quotes of both keep from that.
    """
    if WINDOWS_WORD.fullmatch(word):
        return word
    escaped = re.sub(r'(\\*)"', r'\1\1\\"', word)
    closed = re.sub(r"(\\+)$", r"\1\1", escaped)
    return f'"{closed}"'


def csv(text: str) -> str:
    """A cell of a row of CSV."""
    marked = cell(text)
    return '"' + marked.replace('"', '""') + '"' if set(marked) & set(',"\r\n') else marked


def cell(text: str) -> str:
    """The content of such a cell: where a spreadsheet would take it for a formula, an apostrophe
    makes it text.
    """
    return f"'{text}" if text.startswith(FORMULA) else text
