"""Arithmetic on numbers of one type, written into a function: doubles, or vectors of them, one lane
a candidate.

`FAST` lets LLVM fuse and reorder, as vectors and scalars gain by it; nan and infinity keep their
meaning, since they mark candidates that diverged. `ORDERED` does not reorder: where the order of
operations is the point.
"""

import struct

from tractexp.kernel.function import Function

FAST, ORDERED = "contract reassoc arcp nsz", "contract arcp nsz"
COMMUTES = {"fadd", "fmul", "and", "or", "xor", "add"}


class Numbers:
    """Operations on doubles (width 1) or vectors of `width` doubles; operands and results are names
    of values.
    """

    def __init__(self, function: Function, width: int):
        """Numbers of a function's instructions: vectors of `width` doubles, or doubles."""
        self.f, self.width = function, width
        self.kind, self.integers, self.bits = (
            one if width == 1 else f"<{width} x {one}>" for one in ("double", "i64", "i1")
        )
        self._suffix = "f64" if width == 1 else f"v{width}f64"

    # Constants

    def constant(self, x: float) -> str:
        """A number, to the bit."""
        exact = "0x" + struct.pack(">d", float(x)).hex().upper()
        return exact if self.width == 1 else f"splat (double {exact})"

    def whole(self, x: int) -> str:
        """An integer in every lane."""
        return str(x) if self.width == 1 else f"splat (i64 {x})"

    def truth(self, holds: bool) -> str:
        """A truth value in every lane."""
        bit = "true" if holds else "false"
        return bit if self.width == 1 else f"splat (i1 {bit})"

    # Arithmetic

    def add(self, a: str, b: str, flags: str = FAST) -> str:
        """a + b."""
        return self._two("fadd", a, b, flags)

    def subtract(self, a: str, b: str, flags: str = FAST) -> str:
        """a - b."""
        return self._two("fsub", a, b, flags)

    def multiply(self, a: str, b: str, flags: str = FAST) -> str:
        """a b."""
        return self._two("fmul", a, b, flags)

    def divide(self, a: str, b: str, flags: str = FAST) -> str:
        """a / b."""
        return self._two("fdiv", a, b, flags)

    def negative(self, a: str) -> str:
        """-a."""
        return self.f.value(f"fneg {FAST} {self.kind} {a}")

    def multiply_add(self, a: str, b: str, c: str, flags: str = FAST) -> str:
        """a b + c, which LLVM makes one operation where the processor has it."""
        return self.add(self.multiply(a, b, flags), c, flags)

    def polynomial(self, x: str, coefficients: tuple[float, ...], flags: str = FAST) -> str:
        """Horner's scheme, highest power first."""
        first, *others = map(self.constant, coefficients)
        for coefficient in others:
            first = self.multiply_add(first, x, coefficient, flags)
        return first

    def _two(self, name: str, a: str, b: str, flags: str) -> str:
        """The result of an operation on two numbers; of those that commute the operands have one
        order, so that equal results are found.
        """
        if name in COMMUTES and b < a:
            a, b = b, a
        return self.f.value(f"{name} {flags} {self.kind} {a}, {b}")

    # Comparison and choice

    def compare(self, how: str, a: str, b: str) -> str:
        """Where a comparison holds, by LLVM's name of it."""
        return self.f.value(f"fcmp {how} {self.kind} {a}, {b}")

    def differ(self, a: str, b: str) -> str:
        """Whether whole numbers are not the same."""
        return self.f.value(f"icmp ne {self.integers} {a}, {b}")

    def select(self, condition: str, a: str, b: str) -> str:
        """a where the condition holds, else b."""
        return self.f.value(f"select {self.bits} {condition}, {self.kind} {a}, {self.kind} {b}")

    def larger(self, a: str, b: str) -> str:
        """b where one of them is nan."""
        return self.select(self.compare("ogt", a, b), a, b)

    def smaller(self, a: str, b: str) -> str:
        """b where one of them is nan."""
        return self.select(self.compare("olt", a, b), a, b)

    def logic(self, operation: str, a: str, b: str) -> str:
        """and, or, xor of truth values."""
        if b < a:
            a, b = b, a
        return self.f.value(f"{operation} {self.bits} {a}, {b}")

    def some(self, condition: str) -> str:
        """Whether a condition holds in any lane (i1)."""
        if self.width == 1:
            return condition
        packed = self.f.value(f"bitcast {self.bits} {condition} to i{self.width}")
        return self.f.value(f"icmp ne i{self.width} {packed}, 0")

    # Functions of the processor

    def call(self, name: str, *arguments: str) -> str:
        """An intrinsic of LLVM."""
        full = f"llvm.{name}.{self._suffix}"
        self.f.intrinsics[full] = (
            f"declare {self.kind} @{full}({', '.join([self.kind] * len(arguments))})"
        )
        given = ", ".join(f"{self.kind} {a}" for a in arguments)
        return self.f.value(f"call {FAST} {self.kind} @{full}({given})")

    def size(self, a: str) -> str:
        """The absolute value."""
        return self.call("fabs", a)

    def root(self, a: str) -> str:
        """The square root."""
        return self.call("sqrt", a)

    # The bits of doubles

    def as_bits(self, a: str) -> str:
        """The 64 bits of each number."""
        return self.f.value(f"bitcast {self.kind} {a} to {self.integers}")

    def of_bits(self, a: str) -> str:
        """The numbers of which these are the bits."""
        return self.f.value(f"bitcast {self.integers} {a} to {self.kind}")

    def integer(self, operation: str, a: str, b: str) -> str:
        """An operation on integers, by LLVM's name of it."""
        return self.f.value(f"{operation} {self.integers} {a}, {b}")

    # Memory

    def everywhere(self, scalar: str) -> str:
        """A double in all lanes."""
        if self.width == 1:
            return scalar
        first = self.f.value(f"insertelement {self.kind} poison, double {scalar}, i64 0")
        return self.f.value(
            f"shufflevector {self.kind} {first}, {self.kind} poison, <{self.width} x i32>"
            " zeroinitializer"
        )

    def lane(self, a: str, k: int) -> str:
        """The number in the k-th lane."""
        return a if self.width == 1 else self.f.value(f"extractelement {self.kind} {a}, i64 {k}")

    def load(self, address: str, alignment: int | None = None) -> str:
        """A vector from where whole vectors lie, or at an `alignment` [B]."""
        return self.f.fresh(f"load {self.kind}, ptr {address}, align {alignment or 8 * self.width}")

    def store(self, a: str, address: str, alignment: int | None = None) -> None:
        """Write numbers to an address; doubles one after the other are aligned to the whole
        vector.
        """
        self.f.do(f"store {self.kind} {a}, ptr {address}, align {alignment or 8 * self.width}")

    def ramp(self, first: str) -> str:
        """The doubles `first` (an integer), `first` + 1, ... in the lanes."""
        return self.f.value(
            f"sitofp {self.integers} {self.integer('add', self._splat(first), self._indices)} to"
            f" {self.kind}"
        )

    def prefix_sums(self, a: str) -> str:
        """The sum of each lane and all before it."""
        k = 1
        while k < self.width:
            lanes = ", ".join(
                f"i32 {self.width + lane - k if lane >= k else lane}" for lane in range(self.width)
            )
            moved = (
                f"shufflevector {self.kind} zeroinitializer, {self.kind} {a}, <{self.width} x i32>"
                f" <{lanes}>"
            )
            a = self.add(a, self.f.value(moved), ORDERED)
            k *= 2
        return a

    def part(self, address: str, left: str) -> str:
        """The next samples of an array that does not change, wherever they lie: those that are
        `left`, at most all.
        """
        if self.width == 1:
            return self.f.value(f"load double, ptr {address}, align 8")
        name = f"llvm.masked.load.{self._suffix}.p0"
        self.f.intrinsics[name] = f"declare {self.kind} @{name}(ptr, i32, {self.bits}, {self.kind})"
        counted = self._mask_lanes(left)
        return self.f.value(
            f"call {self.kind} @{name}(ptr {address}, i32 8, {self.bits} {counted}, {self.kind}"
            " zeroinitializer)"
        )

    def store_part(self, a: str, address: str, left: str) -> None:
        """The first `left` lanes, at most all, to wherever they lie."""
        name = f"llvm.masked.store.{self._suffix}.p0"
        self.f.intrinsics[name] = f"declare void @{name}({self.kind}, ptr, i32, {self.bits})"
        self.f.do(
            f"call void @{name}({self.kind} {a}, ptr {address}, i32 8, {self.bits}"
            f" {self._mask_lanes(left)})"
        )

    def _mask_lanes(self, left: str) -> str:
        """The first `left` lanes."""
        return self.f.value(f"icmp slt {self.integers} {self._indices}, {self._splat(left)}")

    @property
    def _indices(self) -> str:
        """The lanes' numbers from 0 on."""
        return f"<{', '.join(f'i64 {k}' for k in range(self.width))}>"

    def _splat(self, integer: str) -> str:
        """An integer in every lane."""
        kind = self.integers
        first = self.f.value(f"insertelement {kind} poison, i64 {integer}, i64 0")
        return self.f.value(
            f"shufflevector {kind} {first}, {kind} poison, <{self.width} x i32> zeroinitializer"
        )
