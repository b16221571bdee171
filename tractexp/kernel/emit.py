"""A kernel's IR from lowered equations: many candidates simulated over events, their squared errors
summed.

Candidates are lanes of vectors. What does not differ between lanes, the inputs at the points in
time that a step looks at and what follows from them, is computed once an event, many samples at
once. Then, block by block of lanes that fit the cache, sample by sample and step by step, each
group of lanes takes its outputs, its errors and its step, without a branch between lanes. Nothing
per sample is stored unless asked for.

Work space, a group of lanes: a row of `width` doubles each for states, memories, what is constant
over an event, outputs, sums of squared errors, and by how much the steady state is missed.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict

from tractexp.kernel import steady
from tractexp.kernel.expressions import Expressions
from tractexp.kernel.function import Function
from tractexp.kernel.graph import Symbol
from tractexp.kernel.kernel import PREFIX, Room
from tractexp.kernel.layout import EVENT, INPUTS, SMOOTH, VECTOR_LANES
from tractexp.kernel.lowered import Lowered, collect_phase_symbols
from tractexp.kernel.numbers import Numbers

# of a step: how far the two stages in the middle go along a slope
HALF_WAY = {"classical": 0.5, "printed": 1 / 6}
ARRAYS = (
    "candidates",
    "event",
    "first",
    "inputs",
    "measured",
    "weights",
    "substeps",
    "sums",
    "miss",
    "outputs",
    "starts",
    "work",
    "points",
    "signals",
)
SIZES = ("events", "n", "samples", "block", "stored", "started")
Values = Mapping[Symbol, str]
Samples = Callable[[str], str]  # an input by its name as a vector of the samples from one on


def write_kernel(lowered: Lowered, title: str, integration: str, width: int = VECTOR_LANES) -> str:
    """The kernel's IR, for vectors of `width` doubles. The same equations give the same text.

    Its second line tells the room that a call needs.
    """
    return _Emitter(lowered, integration, width).text(title)


def _make_real(name: str) -> Symbol:
    """A real symbol of that name."""
    return Symbol(name, real=True)


class _Emitter:
    """One kernel's text. Names of the IR's arguments are those of `ARRAYS` and `SIZES`."""

    def __init__(self, lowered: Lowered, integration: str, width: int):
        """Write the kernel of lowered equations for lanes of `width` candidates, integrated by a
        named method.
        """
        self.lowered, self.half_way, self.width = lowered, HALF_WAY[integration], width
        self.given = [*lowered.parameters, _make_real("P0"), _make_real("Q0")]
        self.used = {
            name: collect_phase_symbols(getattr(lowered, name))
            for name in ("derivative", "renewal", "output")
        }
        sampled = self.used["renewal"] | self.used["output"]
        lane = [*self.given, *lowered.starts, *lowered.constants]
        self.carried = [s for s in lane if s in sampled | self.used["derivative"]]
        moving = (*lowered.inputs, *(s for s, _ in lowered.derivative.signals))
        self.moving = [s for s in moving if s in self.used["derivative"]] if lowered.states else []
        self.signals = dict([*lowered.output.signals, *lowered.renewal.signals])
        sums = (f"_sum_{o}" for o in lowered.outputs)  # no name of a symbol begins like this
        shown = (f"_{o}" for o in lowered.outputs)
        own = (*lowered.states, *lowered.memories, *self.carried, *shown, *sums, "_miss")
        self.rows = {str(name): k for k, name in enumerate(own)}
        self.solves = lowered.rest is not None and bool(lowered.states)
        self.functions: list[Function] = []

    def text(self, title: str) -> str:
        """The whole module of LLVM IR, with the room that its callers must make."""
        room = Room(
            width=self.width,
            given=len(self.given),
            event=len(EVENT),
            outputs=len(self.lowered.outputs),
            starts=len(self.lowered.starts),
            rows=len(self.rows),
            points=len(self.moving),
            signals=len(self.signals),
        )
        bodies = [*([self._rest()] if self.solves else []), self._run()]
        intrinsics = {name: line for f in self.functions for name, line in f.intrinsics.items()}
        head = [f"; {title}", PREFIX + json.dumps(asdict(room))]
        return "\n".join([*head, "", *intrinsics.values(), "", *bodies])

    def _function(self) -> tuple[Function, Numbers, Numbers]:
        """A new function, its lanes and its scalars."""
        f = Function()
        self.functions.append(f)
        return f, Numbers(f, self.width), Numbers(f, 1)

    # The steady state

    def _rest(self) -> str:
        """The text of a function that computes what vanishes before the event, as `steady` calls
        it.
        """
        f, lanes, scalars = self._function()
        lowered = self.lowered
        phase = self.lowered.rest
        assert phase is not None
        scope = {
            _make_real(s): lanes.everywhere(scalars.load(f.offset_address("%event", k)))
            for k, s in enumerate(EVENT)
        }
        memories = lowered.starts[len(lowered.states) :]
        scope |= {
            s: lanes.load(f.offset_address("%given", k * self.width))
            for k, s in enumerate((*self.given, *memories))
        }
        states = enumerate(lowered.starts[: len(lowered.states)])
        scope |= {s: lanes.load(f.offset_address("%x", k * self.width)) for k, s in states}
        for k, balance in enumerate(Expressions(lanes, scope).evaluate_phase(phase)):
            lanes.store(balance, f.offset_address("%balances", k * self.width))
        return f.text(
            "define internal void @rest(ptr %event, ptr %given, ptr %x, ptr noalias %balances)"
            " nounwind"
        )

    # All events

    def _run(self) -> str:
        """The function that runs all events for all candidates."""
        self.f, self.lanes, self.scalars = self._function()
        f = self.f
        scalars = self.scalars
        self.reachable = f.room("i64", 8)
        memories = len(self.lowered.memories)
        states = len(self.lowered.states)
        self.copied = f.room(f"[{(len(self.given) + memories) * self.width} x double]")
        vectors = steady.count_vectors(states) + len(self.lowered.starts) + 1
        self.solved = f.room(f"[{vectors * self.width} x double]")
        with f.loop(0, "%events") as e:
            self.event_at = f.offset_address("%event", f.integer("mul", e, len(EVENT)))
            self.event = {
                _make_real(s): scalars.part(f.offset_address(self.event_at, k), "")
                for k, s in enumerate(EVENT)
            }
            self.begin, self.end = f.count("%first", e), f.count("%first", f.integer("add", e, 1))
            self.substeps = f.count("%substeps", e)
            self._point_pass()
            self._signal_pass()
            with f.loop(0, "%n", "%block") as first:
                self._block(e, first)
        arguments = (
            *(f"ptr noalias %{a}" for a in ARRAYS),
            "ptr %steady",
            *(f"i64 %{s}" for s in SIZES),
        )
        return f.text(f"define void @run({', '.join(arguments)}) nounwind")

    def _block(self, e: str, first: str) -> None:
        """Some lanes over one event."""
        f = self.f
        some = f.smaller(f.integer("sub", "%n", first), "%block")
        self.groups = f.integer("sdiv", f.integer("add", some, self.width - 1), self.width)
        f.do(f"store i64 0, ptr {self.reachable}, align 8")
        with f.loop(0, self.groups, always=True) as g:
            self._start(e, f.integer("add", first, f.integer("mul", g, self.width)), self._group(g))
        reached = f.fresh(f"icmp ne i64 {f.fresh(f'load i64, ptr {self.reachable}, align 8')}, 0")
        with f.when(reached), f.loop(self.begin, self.end) as i:
            self._sample(i)
            with f.when(f.value("icmp ne i64 %stored, 0")), f.loop(0, some, always=True) as lane:
                self._store_outputs(i, first, lane)
        with f.loop(0, some, always=True) as lane:
            self._store_sums(e, first, lane)

    def _group(self, g: str) -> str:
        """Where a group's rows begin."""
        return self.f.offset_address("%work", self.f.integer("mul", g, len(self.rows) * self.width))

    def _row(self, group: str, name: object) -> str:
        """The address of a symbol's row in the arrays of one candidate group."""
        return self.f.offset_address(group, self.rows[str(name)] * self.width)

    def _read(self, group: str, names: Iterable[Symbol]) -> dict[Symbol, str]:
        """{symbol: its value in all lanes}, loaded from a group's rows."""
        return {s: self.lanes.load(self._row(group, s)) for s in names}

    # What is the same in all lanes, for many samples at once

    def _samples(self, i: str, ahead: int = 0) -> Samples:
        """The inputs from sample i on, of those in the record."""
        remaining = self.f.integer("sub", "%samples", self.f.integer("add", i, ahead))
        first = self.f.integer("add", i, ahead) if ahead else i
        return lambda name: self.lanes.part(
            self.f.offset_address(self._input(name), first), remaining
        )

    def _point_pass(self) -> None:
        """Inputs and signals of the derivative at both ends and in the middle of each step."""
        if not self.moving:
            return
        f, scalars, count = self.f, self.scalars, len(self.moving)
        per_sample = f.integer("mul", self.substeps, 2)
        step = self.lanes.everywhere(self.event[_make_real("step")])
        event = {s: self.lanes.everywhere(value) for s, value in self.event.items()}
        with (
            f.loop(self.begin, self.end, self.width) as i,
            f.loop(0, per_sample, always=True) as q,
            f.passage("points"),
        ):
            here = self._samples(i)
            there = self._samples(i, 1)
            share = scalars.divide(
                f.value(f"sitofp i64 {q} to double"), f.value(f"sitofp i64 {per_sample} to double")
            )
            x = self.lanes.everywhere(share)
            scope = dict(event)
            for symbol in self.lowered.inputs:
                scope[symbol] = self._between(symbol.name, here, there, x, step)
            values = Expressions(self.lanes, scope)
            scope |= {s: values(e) for s, e in self.lowered.derivative.signals}
            place = f.integer(
                "add", f.integer("mul", f.integer("sub", i, self.begin), per_sample), q
            )
            self._scatter([scope[s] for s in self.moving], "%points", place, per_sample, count)

    def _signal_pass(self) -> None:
        """Signals of outputs and memories, a sample each."""
        if not self.signals:
            return
        f = self.f
        event = {s: self.lanes.everywhere(value) for s, value in self.event.items()}
        with f.loop(self.begin, self.end, self.width) as i, f.passage("signals"):
            here = self._samples(i)
            values = Expressions(self.lanes, event | {s: here(s.name) for s in self.lowered.inputs})
            signals = [values(e) for e in self.signals.values()]
            self._scatter(signals, "%signals", f.integer("sub", i, self.begin), 1, len(signals))

    def _scatter(
        self, values: Sequence[str], array: str, place: str, stride: object, count: int
    ) -> None:
        """Write lanes of values side by side: those of sample k into the row `place` + k `stride`
        of an array of `count` values a row.
        """
        f = self.f
        for k in range(self.width):
            row = f.integer("add", place, f.integer("mul", stride, k)) if k else place
            address = f.offset_address(array, f.integer("mul", row, count))
            for j, value in enumerate(values):
                lane = self.lanes.lane(value, k)
                there = f.offset_address(address, j)
                f.do(f"store double {lane}, ptr {there}, align 8")

    def _between(self, name: str, here: Samples, there: Samples, x: str, step: str) -> str:
        """An input by x from one sample to the next: on the cubic of its slopes, or on a straight
        line.
        """
        n = self.lanes
        rates = {rate: smooth for smooth, rate in SMOOTH.items()}
        smooth = rates.get(name, name)
        if smooth not in SMOOTH:
            return n.multiply_add(n.subtract(there(name), here(name)), x, here(name))
        a = here(smooth)
        b = there(smooth)
        da, db = (n.multiply(step, end(SMOOTH[smooth])) for end in (here, there))
        rise = n.subtract(b, a)
        square = n.subtract(
            n.subtract(n.multiply(n.constant(3.0), rise), n.multiply(n.constant(2.0), da)), db
        )
        cube = n.subtract(n.add(da, db), n.multiply(n.constant(2.0), rise))
        if name == smooth:
            return n.multiply_add(x, n.multiply_add(x, n.multiply_add(x, cube, square), da), a)
        bend = n.multiply_add(
            n.multiply(n.constant(3.0), x), cube, n.multiply(n.constant(2.0), square)
        )
        return n.divide(n.multiply_add(x, bend, da), step)

    # Before an event

    def _start(self, e: str, first: str, group: str) -> None:
        """States, constants and misses of a group of lanes, the last candidate repeated where lanes
        are left over.
        """
        f, n, lowered = self.f, self.lanes, self.lowered
        self._copy_candidates(e, first)
        scope = {s: n.everywhere(value) for s, value in self.event.items()}
        scope |= {
            s: n.load(f.offset_address(self.copied, k * self.width))
            for k, s in enumerate(self.given)
        }
        values = Expressions(n, scope).evaluate_phase(lowered.start)
        starts = values[: len(lowered.starts)]
        miss = self._emit_miss(values[len(lowered.starts) :])
        if self.solves:
            starts, miss = self._emit_steady_state(starts, miss)
        with f.when(f.value("icmp ne i64 %started, 0")):
            self._store_starts(e, first, starts)
        scope |= zip(lowered.starts, starts, strict=True)
        scope |= zip(
            lowered.constants, Expressions(n, scope).evaluate_phase(lowered.constant), strict=True
        )
        zero = n.constant(0.0)
        begin: dict[object, str] = dict(
            zip((*lowered.states, *lowered.memories), starts, strict=True)
        )
        begin |= (
            {s: scope[s] for s in self.carried}
            | {f"_sum_{o}": zero for o in lowered.outputs}
            | {"_miss": miss}
        )
        for name, value in begin.items():
            n.store(value, self._row(group, name))
        good = f.value(f"zext i1 {n.some(n.compare('ole', miss, zero))} to i64")
        before = f.fresh(f"load i64, ptr {self.reachable}, align 8")
        f.do(f"store i64 {f.fresh(f'or i64 {before}, {good}')}, ptr {self.reachable}, align 8")

    def _copy_candidates(self, event: str, first_candidate: str) -> None:
        """Copy one candidate's parameters to each lane; surplus lanes repeat the last candidate.

        Both arguments are names of LLVM values.
        """
        f = self.f
        count = len(self.given)
        last = f.integer("sub", "%n", 1)
        source = f.offset_address(
            "%candidates", f.integer("mul", f.integer("mul", event, count), "%n")
        )
        with f.loop(0, self.width, always=True) as lane:
            candidate, target = (
                f.offset_address(source, f.smaller(f.integer("add", first_candidate, lane), last)),
                f.offset_address(self.copied, lane),
            )
            for k in range(count):
                value = self._double(f.offset_address(candidate, f.integer("mul", "%n", k)))
                f.do(
                    f"store double {value}, ptr {f.offset_address(target, k * self.width)}, align 8"
                )

    def _emit_miss(self, slacks: Sequence[str]) -> str:
        """By how much the requirements are missed in all; 0 where a steady state exists."""
        n = self.lanes
        zero = n.constant(0.0)
        most = n.constant(steady.LARGEST_MISS)
        miss = zero
        for slack in slacks:
            short = n.larger(zero, n.negative(slack))
            miss = short if miss == zero else n.add(miss, short)
        miss = n.smaller(miss, most)
        return n.select(n.compare("oge", miss, zero), miss, most)

    def _emit_steady_state(self, starts: Sequence[str], miss: str) -> tuple[list[str], str]:
        """The states solved for, and by how much more the steady state is missed."""
        f, n, states = self.f, self.lanes, len(self.lowered.states)
        for k, memory in enumerate(starts[states:], len(self.given)):
            n.store(memory, f.offset_address(self.copied, k * self.width))
        x = self.solved
        left = f.offset_address(self.solved, states * self.width)
        work = f.offset_address(self.solved, (states + 1) * self.width)
        for k, value in enumerate(starts[:states]):
            n.store(value, f.offset_address(x, k * self.width))
        f.do(
            f"call void %steady(ptr @rest, ptr {self.event_at}, ptr {self.copied}, ptr {x}, ptr"
            f" {left}, ptr {work}, i64 {states})"
        )
        solution = [n.load(f.offset_address(x, k * self.width)) for k in range(states)]
        return [*solution, *starts[states:]], n.smaller(
            n.add(miss, n.load(left)), n.constant(steady.LARGEST_MISS)
        )

    # A sample and its steps

    def _sample(self, i: str) -> None:
        """Outputs and errors at sample i, and the steps to the next; the last one's step is
        computed in vain.
        """
        f = self.f
        states = bool(self.lowered.states)
        self.i, local = i, f.integer("sub", i, self.begin)
        self.signal_at = f.offset_address("%signals", f.integer("mul", local, len(self.signals)))
        if not states:
            with f.loop(0, self.groups, always=True) as g, f.passage("outputs"):
                self._outputs(self._group(g), {})
            return
        last = f.value(f"icmp eq i64 {f.integer('add', i, 1)}, {self.end}")
        steps = f.value(f"select i1 {last}, i64 1, i64 {self.substeps}")
        length = self.scalars.divide(
            self.event[_make_real("step")], f.value(f"sitofp i64 {self.substeps} to double")
        )
        with f.loop(0, steps, always=True) as j:
            row = f.integer(
                "mul",
                f.integer("add", f.integer("mul", local, self.substeps), j),
                2 * len(self.moving),
            )
            points = self._points(f.offset_address("%points", row))
            first = f.value(f"icmp eq i64 {j}, 0")
            ahead = {
                share: self.lanes.everywhere(
                    self.scalars.multiply(self.scalars.constant(share), length)
                )
                for share in (self.half_way, 1.0, 1 / 6)
            }
            with f.loop(0, self.groups, always=True) as g, f.passage("step"):
                self._step(self._group(g), first, points, ahead)

    def _points(self, address: str) -> list[dict[Symbol, str]]:
        """The values that are the same in all lanes at the beginning, the middle and the end of a
        step.
        """
        count = len(self.moving)
        return [
            {
                s: self._wide(self.f.offset_address(address, k * count + j))
                for j, s in enumerate(self.moving)
            }
            for k in range(3)
        ]

    def _wide(self, address: str) -> str:
        """The double at an address, in every lane."""
        return self.lanes.everywhere(self._double(address))

    def _double(self, address: str) -> str:
        """The double at an address."""
        return self.f.fresh(f"load double, ptr {address}, align 8")

    def _step(
        self, group: str, first: str, points: Sequence[Values], ahead: Mapping[float, str]
    ) -> None:
        """A step of four stages, Eq. (4), by shares `ahead` of its length; before the first of a
        sample its outputs.
        """
        f, n, lowered = self.f, self.lanes, self.lowered
        y = [n.load(self._row(group, s)) for s in lowered.states]
        scope = self._read(group, (s for s in self.carried if s in self.used["derivative"]))

        def slope(stage: str, states: Sequence[str], point: Values) -> list[str]:
            f.remark(stage)
            at = {**scope, **point, **dict(zip(lowered.states, states, strict=True))}
            return Expressions(n, at).evaluate_phase(lowered.derivative)

        def along(states: Sequence[str], share: float, slopes: Sequence[str]) -> list[str]:
            return [
                n.multiply_add(ahead[share], slope, s)
                for s, slope in zip(states, slopes, strict=True)
            ]

        a, b, c = points
        k1 = [] if lowered.memories else slope("slope at the beginning", y, a)
        with f.when(first), f.passage("outputs"):
            self._outputs(group, scope | dict(zip(lowered.states, y, strict=True)))
        if lowered.memories:
            scope |= self._read(
                group, (m for m in lowered.memories if m in self.used["derivative"])
            )
            k1 = slope("slope at the beginning", y, a)
        k2 = slope("first slope in the middle", along(y, self.half_way, k1), b)
        k3 = slope("second slope in the middle", along(y, self.half_way, k2), b)
        k4 = slope("slope at the end", along(y, 1.0, k3), c)
        total = [
            n.add(n.multiply_add(n.constant(2.0), n.add(second, third), one), four)
            for one, second, third, four in zip(k1, k2, k3, k4, strict=True)
        ]
        for symbol, state in zip(lowered.states, along(y, 1 / 6, total), strict=True):
            n.store(state, self._row(group, symbol))

    def _renew_memories(self, group: str, scope: Mapping[Symbol, str]) -> dict[Symbol, str]:
        """Write memories by their renewal, and give their new values."""
        values = Expressions(self.lanes, scope).evaluate_phase(self.lowered.renewal)
        renewed = dict(zip(self.lowered.memories, values, strict=True))
        for symbol, value in renewed.items():
            self.lanes.store(value, self._row(group, symbol))
        return renewed

    def _outputs(self, group: str, scope: Mapping[Symbol, str]) -> None:
        """Memories renewed, outputs, and their errors added to the sums."""
        f, n, lowered = self.f, self.lanes, self.lowered
        used = self.used["renewal"] | self.used["output"]
        own = (*lowered.states, *lowered.memories, *self.carried)
        scope = dict(scope) | self._read(group, (s for s in own if s in used and s not in scope))
        for s in lowered.inputs:
            if s in used:
                scope[s] = self._wide(f.offset_address(self._input(s.name), self.i))
        scope |= {
            s: self._wide(f.offset_address(self.signal_at, j))
            for j, s in enumerate(self.signals)
            if s in used
        }
        if lowered.memories:
            scope |= self._renew_memories(group, scope)
        for c, (name, value) in enumerate(
            zip(lowered.outputs, Expressions(n, scope).evaluate_phase(lowered.output), strict=True)
        ):
            n.store(value, self._row(group, f"_{name}"))
            place = f.integer("add", f.integer("mul", "%samples", c), self.i)
            off = n.subtract(self._wide(f.offset_address("%measured", place)), value)
            row = self._row(group, f"_sum_{name}")
            n.store(
                n.multiply_add(
                    n.multiply(self._wide(f.offset_address("%weights", place)), off),
                    off,
                    n.load(row),
                ),
                row,
            )

    def _input(self, name: str) -> str:
        """The address of an input's samples."""
        return self.f.offset_address(
            "%inputs", self.f.integer("mul", "%samples", INPUTS.index(name))
        )

    # Results, lane by lane

    def _copy(self, lane: str, name: str, target: str) -> None:
        """Store what a row holds of a lane of this block."""
        f = self.f
        group = self._group(f.integer("sdiv", lane, self.width))
        value = self._double(
            self._row(f.offset_address(group, f.integer("srem", lane, self.width)), name)
        )
        f.do(f"store double {value}, ptr {target}, align 8")

    def _store_outputs(self, i: str, first: str, lane: str) -> None:
        """outputs (C, n, N)."""
        f = self.f
        for c, name in enumerate(self.lowered.outputs):
            row = f.integer("add", f.integer("mul", "%n", c), f.integer("add", first, lane))
            self._copy(
                lane,
                f"_{name}",
                f.offset_address(
                    "%outputs", f.integer("add", f.integer("mul", row, "%samples"), i)
                ),
            )

    def _store_sums(self, e: str, first: str, lane: str) -> None:
        """sums (E, C, n) and miss (E, n)."""
        f, count, candidate = self.f, len(self.lowered.outputs), self.f.integer("add", first, lane)
        for c, name in enumerate(self.lowered.outputs):
            row = f.integer("add", f.integer("mul", e, count), c)
            self._copy(
                lane,
                f"_sum_{name}",
                f.offset_address("%sums", f.integer("add", f.integer("mul", row, "%n"), candidate)),
            )
        self._copy(
            lane,
            "_miss",
            f.offset_address("%miss", f.integer("add", f.integer("mul", e, "%n"), candidate)),
        )

    def _store_starts(self, e: str, first: str, starts: Sequence[str]) -> None:
        """starts (E, K, n)."""
        f = self.f
        count = len(starts)
        for k, value in enumerate(starts):
            self.lanes.store(value, f.offset_address(self.solved, k * self.width))
        remaining = f.integer("sub", "%n", first)
        with f.loop(0, f.smaller(remaining, self.width), always=True) as lane:
            for k in range(count):
                value = self._double(
                    f.offset_address(f.offset_address(self.solved, lane), k * self.width)
                )
                row = f.integer("mul", f.integer("add", f.integer("mul", e, count), k), "%n")
                place = f.integer("add", row, f.integer("add", first, lane))
                f.do(f"store double {value}, ptr {f.offset_address('%starts', place)}, align 8")
