"""Names that a record, a station, a channel or a file may have, and that somebody may have chosen to do harm."""

import sys
import unicodedata

# a letter of each script, by the first word of its name
_OF = {unicodedata.name(c, "").partition(" ")[0]: c for c in map(chr, range(sys.maxunicode)) if c.isalpha()}
SCRIPTS = ("站北", "Ф1", "الحمل", "ฟ้าผ่า", "Ünïcödé", "🚆", "e\u0301", "".join(_OF.values()))
NASTY = (
    '"""', "'''", '"', "'", "it's", 'x"""\nimport os\nos.system("touch owned")\n"""', "x'''; touch owned; '''",
    "\\", "tail\\", 'tail\\"', "\\'", "\\N{BULLET} \\x41 \\u0041", "a\\b", "%s %(x)s {0} {x} {{}}",
    "</script><script>owned()</script>", "<!--<script>", "<img src=x onerror=owned()>", "&lt;b&gt;",
    '" onload="owned()',
    "]]>", "${oc.env:HOME}", "\\${oc.env:HOME}", "\\\\${x}", "${", "x${oc.env:HOME}'", "$(touch owned)",
    "`touch owned`",
    "; touch owned", "| touch owned", "a\nb", "a\r\nb", "a\u2028b", "\t", "\x1b[31mred\x1b[0m", "\x7f",
    "a\u202eb\u2066",
    "-rf", "--config-dir=x", "~", "*", "[1]", "[a,b]", "{a: b}", "a,b", "a=b", "a: b", "- a", "# a",
    "!!python/name:os", "&a",
    "null", "true", "1e3", "???", " a ", "```", "````\n```", "$\\frac{$", "$x$", "| a | b |", "[a](javascript:owned())",
    "=cmd|' /C calc'!A0", "+1", "@SUM(A1)", "\0", "../../x", "/etc/passwd", "C:\\x", "", " ", "a\udcffb", *SCRIPTS,
)  # fmt: skip
