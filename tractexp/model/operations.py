"""The arithmetic of a kernel, counted in its source: what a simulation costs, whatever machine runs it.

Additions, multiplications and divisions are those written, `_exp` and `_log` taken apart into theirs; what does not
differ between the lanes counts for one in all of them. Signs, conversions and the indices of arrays count for nothing.
"""

import ast
from collections import Counter
from collections.abc import Iterable
from dataclasses import astuple, dataclass

KINDS = {ast.Add: "additions", ast.Sub: "additions", ast.Mult: "multiplications", ast.Div: "divisions"}
Varying = set[str]  # names whose values differ between the lanes, or all that are not known beforehand


@dataclass(frozen=True)
class Operations:
    """Operations in double precision. `others` are minima, maxima, roots, roundings, comparisons and shifts."""

    additions: float = 0
    multiplications: float = 0
    divisions: float = 0
    others: float = 0

    @property
    def total(self) -> float:
        return sum(astuple(self))

    def __add__(self, other: "Operations") -> "Operations":
        return Operations(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def __mul__(self, times: float) -> "Operations":
        return Operations(*(times * each for each in astuple(self)))


@dataclass(frozen=True)
class Cost:
    """What one candidate costs: a Runge-Kutta step, and a sample without its steps."""

    step: Operations
    sample: Operations

    def per_sample(self, substeps: int) -> Operations:
        """A sample with its steps."""
        return self.sample + self.step * substeps


def count(source: str) -> Cost:
    """The operations of a kernel module as `codegen.source` writes it."""
    module = ast.parse(source)
    reader = _Reader({f.name: f for f in module.body if isinstance(f, ast.FunctionDef)})
    samples = next(loop for loop in _loops(reader.functions["run"]) if loop.iter_over("first") and loop.lanes)
    steps = [loop for loop in _loops(samples.node) if loop.iter_over("substeps")]
    return Cost(
        sum((reader.per_lane(loop.node.body) for loop in steps), Operations()), reader.per_lane(samples.node.body)
    )


@dataclass(frozen=True)
class _Loop:
    node: ast.For

    def iter_over(self, name: str) -> bool:
        """Whether the loop runs to an element of this array."""
        return any(isinstance(n, ast.Subscript) and _name(n.value) == name for n in ast.walk(self.node.iter))

    @property
    def lanes(self) -> int:
        """How many lanes the loop advances together; 0 where it does not loop over them itself."""
        return next((n for statement in self.node.body if (n := _lanes(statement))), 0)


def _loops(inside: ast.AST) -> list[_Loop]:
    return [_Loop(node) for node in ast.walk(inside) if isinstance(node, ast.For) and node is not inside]


def _lanes(statement: ast.stmt) -> int:
    """The length of a loop over lanes: `for l in range(16)`; 0 for anything else."""
    if isinstance(statement, ast.For) and _name(statement.target) == "l" and isinstance(statement.iter, ast.Call):
        length = statement.iter.args[-1]
        return length.value if isinstance(length, ast.Constant) and isinstance(length.value, int) else 0
    return 0


def _name(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else ""


class _Reader:
    """Counts in the functions of a module."""

    def __init__(self, functions: dict[str, ast.FunctionDef]):
        self.functions = functions

    def per_lane(self, body: Iterable[ast.stmt]) -> Operations:
        """The lane's own operations, and its share of those that serve all lanes."""
        own, shared, lanes = Counter[str](), Counter[str](), 1
        for statement in body:
            if n := _lanes(statement):
                lanes = n
                own += self._block(statement.body, {"l"})  # type: ignore[attr-defined]
            elif isinstance(statement, ast.Assign):
                shared += self._block([statement], None)
        return Operations(**own) + Operations(**shared) * (1 / lanes)

    def _block(self, body: Iterable[ast.stmt], varying: Varying | None) -> Counter[str]:
        """Of assignments in order; the names they make vary where their values do. None: everything varies."""
        total = Counter[str]()
        for statement in body:
            if isinstance(statement, ast.AugAssign):
                made, differs = self._value(statement.value, varying)
                total += made + Counter({KINDS.get(type(statement.op), "others"): 1})
            elif isinstance(statement, ast.Assign):
                made, differs = self._value(statement.value, varying)
                total += made
                if differs and varying is not None:
                    varying |= {_name(n) for t in statement.targets for n in ast.walk(t)} - {"", "l"}
        return total

    def _value(self, node: ast.expr, varying: Varying | None) -> tuple[Counter[str], bool]:
        """The operations behind a value, and whether it varies; those on what does not are made beforehand."""
        if isinstance(node, ast.Constant):
            return Counter(), False
        if isinstance(node, ast.Name | ast.Subscript):
            return Counter(), varying is None or any(_name(n) in varying for n in ast.walk(node))
        if isinstance(node, ast.Call) and _name(node.func) in self.functions:
            return self._call(node, varying)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "view":
            return self._value(node.func.value, varying)
        parts = [self._value(part, varying) for part in _parts(node)]
        total, differs = sum((made for made, _ in parts), Counter[str]()), any(d for _, d in parts)
        if differs:
            total += _own(node)
        return total, differs

    def _call(self, node: ast.Call, varying: Varying | None) -> tuple[Counter[str], bool]:
        function = self.functions[_name(node.func)]
        given = [self._value(argument, varying) for argument in node.args]
        names = [argument.arg for argument in function.args.args]
        inside = {name for name, (_, differs) in zip(names, given, strict=True) if differs}
        total = sum((made for made, _ in given), Counter[str]())
        total += self._block(function.body, inside)
        last = function.body[-1]
        assert isinstance(last, ast.Return)
        assert last.value is not None
        made, differs = self._value(last.value, inside)
        return total + made, differs


def _parts(node: ast.expr) -> list[ast.expr]:
    """The values that a value is made of."""
    if isinstance(node, ast.Call):
        return list(node.args)
    return [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]


def _own(node: ast.expr) -> Counter[str]:
    """What a node does itself with its parts."""
    if isinstance(node, ast.BinOp):
        return Counter({KINDS.get(type(node.op), "others"): 1})
    if isinstance(node, ast.Call):
        name = _name(node.func)
        converts = isinstance(node.func, ast.Attribute) and node.func.attr in ("int64", "float64")
        return Counter({"others": 0 if converts else max(1, len(node.args) - 1) if name in ("min", "max") else 1})
    return Counter({"others": int(isinstance(node, ast.Compare | ast.IfExp))})
