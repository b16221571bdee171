"""The text of one function in LLVM IR while it is written, its values numbered.

What was computed before on every way to a place is not computed twice there: values are known by
their operation, in scopes that open and close with loops and branches. So no expression has to be
searched for common parts beforehand.
"""

from collections.abc import Iterator
from contextlib import contextmanager


class Function:
    """Lines of a function's body, and the intrinsics it calls."""

    def __init__(self) -> None:
        """A function without instructions."""
        self.lines: list[str] = []
        self.allocations: list[str] = []
        self.intrinsics: dict[str, str] = {}
        self._numbers = 0
        self._scopes: list[dict[str, str]] = [{}]
        self._block = "entry"

    def text(self, head: str) -> str:
        """The whole function; `head` is its definition up to the brace."""
        body = "\n".join([*self.allocations, *self.lines])
        return f"{head} {{\nentry:\n{body}\n  ret void\n}}\n"

    # Values

    def value(self, operation: str) -> str:
        """The value of an operation that depends on its operands alone: the one already there, or a
        new one.
        """
        for scope in reversed(self._scopes):
            if operation in scope:
                return scope[operation]
        name = self._scopes[-1][operation] = self.fresh(operation)
        return name

    def fresh(self, operation: str) -> str:
        """A new value, of an operation that may give another one each time, such as
        reading memory.
        """
        name = self._name("v")
        self.lines.append(f"  {name} = {operation}")
        return name

    def do(self, instruction: str) -> None:
        """An instruction without a value."""
        self.lines.append(f"  {instruction}")

    def room(self, kind: str, alignment: int = 64) -> str:
        """A place on the stack, whose address is given."""
        name = self._name("room")
        self.allocations.append(f"  {name} = alloca {kind}, align {alignment}")
        return name

    def remark(self, text: str) -> None:
        """A line for those who read the IR."""
        self.lines.append(f"  ; {text}")

    @contextmanager
    def passage(self, name: str) -> Iterator[None]:
        """Lines that a reader finds by their name."""
        self.remark(f"begin {name}")
        yield
        self.remark(f"end {name}")

    # Integers and addresses

    def integer(self, operation: str, a: object, b: object) -> str:
        """The result of an operation on two integers of 64 bits."""
        return self.value(f"{operation} i64 {a}, {b}")

    def smaller(self, a: object, b: object) -> str:
        """The smaller of two integers."""
        return self.value(f"select i1 {self.integer('icmp slt', a, b)}, i64 {a}, i64 {b}")

    def offset_address(self, address: str, index: object) -> str:
        """The address `index` doubles further."""
        return (
            address
            if index == 0
            else self.value(f"getelementptr double, ptr {address}, i64 {index}")
        )

    def count(self, address: str, index: object) -> str:
        """The integer there, of an array that does not change."""
        return self.value(
            f"load i64, ptr {self.value(f'getelementptr i64, ptr {address}, i64 {index}')}, align 8"
        )

    def address(self, addresses: str, index: int) -> str:
        """The address there, of an array that does not change."""
        return self.value(
            f"load ptr, ptr {self.value(f'getelementptr ptr, ptr {addresses}, i64 {index}')}, align"
            " 8"
        )

    # Control

    @contextmanager
    def loop(
        self, start: object, stop: object, step: object = 1, always: bool = False
    ) -> Iterator[str]:
        """A loop over integers from `start` to below `stop`; `always`: the first time without
        asking.
        """
        i, after, head, end = self._name("i"), self._name("i"), self._label(), self._label()
        before = self._block
        self.do(f"br label %{head}")
        self._begin(head)
        phi = len(self.lines)
        self.lines.append("")
        if not always:
            inside = self._label()
            self.do(
                f"br i1 {self.fresh(f'icmp slt i64 {i}, {stop}')}, label %{inside}, label %{end}"
            )
            self._begin(inside)
        self._scopes.append({})
        yield i
        self._scopes.pop()
        self.do(f"{after} = add nsw i64 {i}, {step}")
        last = self._block
        if always:
            self.do(
                f"br i1 {self.fresh(f'icmp slt i64 {after}, {stop}')}, label %{head}, label %{end}"
            )
        else:
            self.do(f"br label %{head}")
        self.lines[phi] = f"  {i} = phi i64 [ {start}, %{before} ], [ {after}, %{last} ]"
        self._begin(end)

    @contextmanager
    def when(self, condition: str) -> Iterator[None]:
        """Within it, instructions that run only where a condition (i1) holds."""
        inside, end = self._label(), self._label()
        self.do(f"br i1 {condition}, label %{inside}, label %{end}")
        self._begin(inside)
        self._scopes.append({})
        yield
        self._scopes.pop()
        self.do(f"br label %{end}")
        self._begin(end)

    def _begin(self, label: str) -> None:
        """Begin a block of instructions."""
        self.lines.append(f"{label}:")
        self._block = label

    def _name(self, kind: str) -> str:
        """A name that no other value has."""
        self._numbers += 1
        return f"%{kind}{self._numbers}"

    def _label(self) -> str:
        """A label that no other block has."""
        return self._name("b")[1:]
