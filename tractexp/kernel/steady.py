"""The steady state before an event: Newton's method on lanes, one function for the kernels of all
models.

Each lane ends by itself, so that its bits do not depend on its neighbors; what is computed for it
afterwards is not taken. The Jacobian is by differences, its equations solved by Gaussian
elimination with partial pivoting.
"""

from tractexp.kernel.function import Function
from tractexp.kernel.numbers import Numbers

NEWTON_ITERATIONS = 40
STATE_DIFFERENCE = 1e-7  # of 1 + |x|
LARGEST_SETTLED_MOVE = 1e-12  # of 1 + |x|: a lane that moves less has ended
# of what has ended: how far it moved last, and what is left of its balances
SETTLED, BALANCED = 1e-9, 1e-6
LARGEST_MISS = 1e6  # by which a steady state is missed
ARGUMENTS = "ptr %rest, ptr %event, ptr %given, ptr %x, ptr %missed, ptr %work, i64 %n"


def count_vectors(states: int) -> int:
    """Vectors of work space that the method needs."""
    return states * (states + 2)


def write_steady(width: int) -> str:
    """IR of `@steady`: solves rest(event, given, x, balances) = 0 for n states x; `missed` is 0
    where it is solved.

    x (n, width) holds the first guess and then the solution; `work` has room for n (n + 2) vectors.
    """
    return _Newton(width).text()


class _Newton:
    """Newton's method for the steady state of all lanes, as LLVM IR."""

    def __init__(self, width: int):
        """Begin the function for so many lanes: balances, moved balances and the Jacobian stand one
        after the other in its work space.
        """
        self.f = Function()
        self.n = Numbers(self.f, width)
        self.balance = "%work"
        self.beside = self.offset_address(self.balance, "%n")
        self.jacobian = self.offset_address(self.beside, "%n")
        self.moved, self.size = self.f.room(self.n.kind), self.f.room(self.n.kind)
        self.going = self.f.room("i64", 8)

    def text(self) -> str:
        """The module's text: iterate until every lane's balances vanish or no step helps."""
        f, n = self.f, self.n
        n.store(n.constant(1.0), self.moved)
        f.do(f"store i64 1, ptr {self.going}, align 8")
        load = f"load i64, ptr {self.going}, align 8"
        with f.loop(0, NEWTON_ITERATIONS), f.when(f.fresh(f"icmp ne i64 {f.fresh(load)}, 0")):
            self.rest(self.balance)
            self.differences()
            self.elimination()
            self.substitution()
            self.step()
        self.verdict()
        body = f.text(f"define void @steady({ARGUMENTS}) nounwind")
        return "\n".join([*f.intrinsics.values(), body])

    def offset_address(self, address: str, k: str) -> str:
        """The address of the k-th number of all lanes."""
        return self.f.offset_address(address, self.f.integer("mul", k, self.n.width))

    def cell(self, row: str, column: str) -> str:
        """The address of an entry of the Jacobian."""
        return self.offset_address(
            self.jacobian, self.f.integer("add", self.f.integer("mul", row, "%n"), column)
        )

    def rest(self, balances: str) -> None:
        """Compute the balances at x into an address."""
        self.f.do(f"call void %rest(ptr %event, ptr %given, ptr %x, ptr {balances})")

    def differences(self) -> None:
        """The Jacobian, a column a state."""
        f, n = self.f, self.n
        with f.loop(0, "%n", always=True) as k:
            place = self.offset_address("%x", k)
            x = n.load(place)
            ahead = n.multiply(n.constant(STATE_DIFFERENCE), n.add(n.constant(1.0), n.size(x)))
            n.store(n.add(x, ahead), place)
            self.rest(self.beside)
            n.store(x, place)
            with f.loop(0, "%n", always=True) as r:
                rise = n.subtract(
                    n.load(self.offset_address(self.beside, r)),
                    n.load(self.offset_address(self.balance, r)),
                )
                n.store(n.divide(rise, ahead), self.cell(r, k))

    def elimination(self) -> None:
        """The Jacobian made triangular; the balances follow."""
        f, n = self.f, self.n
        with f.loop(0, "%n", always=True) as k:
            below = f.integer("add", k, 1)
            with f.loop(below, "%n") as r:
                larger = n.compare(
                    "ogt", n.size(n.load(self.cell(r, k))), n.size(n.load(self.cell(k, k)))
                )
                with f.loop(k, "%n", always=True) as c:
                    self.exchange(larger, self.cell(k, c), self.cell(r, c))
                self.exchange(
                    larger,
                    self.offset_address(self.balance, k),
                    self.offset_address(self.balance, r),
                )
            with f.loop(below, "%n") as r:
                factor = n.divide(n.load(self.cell(r, k)), n.load(self.cell(k, k)))
                with f.loop(k, "%n", always=True) as c:
                    self.reduce(self.cell(r, c), factor, self.cell(k, c))
                self.reduce(
                    self.offset_address(self.balance, r),
                    factor,
                    self.offset_address(self.balance, k),
                )

    def exchange(self, where: str, one: str, other: str) -> None:
        """Exchange two numbers in the lanes where a condition holds."""
        n = self.n
        a, b = n.load(one), n.load(other)
        n.store(n.select(where, b, a), one)
        n.store(n.select(where, a, b), other)

    def reduce(self, place: str, factor: str, by: str) -> None:
        """Subtract `factor` times one number from another, in place."""
        n = self.n
        n.store(n.subtract(n.load(place), n.multiply(factor, n.load(by))), place)

    def substitution(self) -> None:
        """Newton's step in place of the balances, and its size."""
        f, n = self.f, self.n
        n.store(n.constant(0.0), self.size)
        with f.loop(0, "%n", always=True) as up:
            k = f.integer("sub", f.integer("sub", "%n", 1), up)
            place = self.offset_address(self.balance, k)
            with f.loop(f.integer("add", k, 1), "%n") as c:
                self.reduce(place, n.load(self.cell(k, c)), self.offset_address(self.balance, c))
            step = n.divide(n.load(place), n.load(self.cell(k, k)))
            n.store(step, place)
            share = n.divide(
                n.size(step), n.add(n.constant(1.0), n.size(n.load(self.offset_address("%x", k))))
            )
            self.widen(share)

    def widen(self, by: str) -> None:
        """The larger size so far; once nan, it stays nan."""
        n, size = self.n, self.n.load(self.size)
        stays = n.logic("or", n.compare("ogt", size, by), n.compare("uno", size, size))
        n.store(n.select(stays, size, by), self.size)

    def step(self) -> None:
        """Half of 1 + |x| at most, by the lanes that have not ended."""
        f, n = self.f, self.n
        size, before = n.load(self.size), n.load(self.moved)
        active = n.compare("ogt", before, n.constant(LARGEST_SETTLED_MOVE))
        short = n.select(
            n.compare("olt", size, n.constant(0.5)),
            n.constant(1.0),
            n.divide(n.constant(0.5), size),
        )
        with f.loop(0, "%n", always=True) as k:
            place = self.offset_address("%x", k)
            x = n.load(place)
            ahead = n.subtract(x, n.multiply(short, n.load(self.offset_address(self.balance, k))))
            n.store(n.select(active, ahead, x), place)
        moved = n.select(active, size, before)
        n.store(moved, self.moved)
        some = n.some(n.compare("ogt", moved, n.constant(LARGEST_SETTLED_MOVE)))
        f.do(f"store i64 {f.value(f'zext i1 {some} to i64')}, ptr {self.going}, align 8")

    def verdict(self) -> None:
        """By how much the steady state is missed."""
        f, n = self.f, self.n
        self.rest(self.balance)
        n.store(n.constant(0.0), self.size)
        with f.loop(0, "%n", always=True) as k:
            self.widen(n.size(n.load(self.offset_address(self.balance, k))))
        left, moved = n.load(self.size), n.load(self.moved)
        still = n.compare("ole", moved, n.constant(SETTLED))
        settled = n.logic("and", still, n.compare("olt", left, n.constant(BALANCED)))
        finite = n.compare("oge", left, n.constant(0.0))
        far = n.select(
            finite,
            n.smaller(n.add(n.constant(1.0), left), n.constant(LARGEST_MISS)),
            n.constant(LARGEST_MISS),
        )
        n.store(n.select(settled, n.constant(0.0), far), "%missed")
