// The recorded inputs at x from sample i to the next: on the cubic of their slopes, or on a straight line.
const RATES = Object.fromEntries(Object.entries(SMOOTH).map(([smooth, rate]) => [rate, smooth]));
const between = (inputs, name, i, x, step) => {
  const smooth = RATES[name] || name, next = Math.min(i + 1, inputs[smooth].length - 1);
  if (!(smooth in SMOOTH)) return inputs[name][i] + (inputs[name][next] - inputs[name][i]) * x;
  const a = inputs[smooth][i], rise = inputs[smooth][next] - a;
  const da = step * inputs[SMOOTH[smooth]][i], db = step * inputs[SMOOTH[smooth]][next];
  const square = 3 * rise - 2 * da - db, cube = da + db - 2 * rise;
  return name === smooth ? a + x * (da + x * (square + x * cube)) : (da + x * (2 * square + 3 * x * cube)) / step;
};
// Newton's method from a first guess: what makes the balances vanish; null where it does not end there.
const settle = (balances, guess) => {
  const x = [...guess];
  let moved = 1;
  for (let iteration = 0; iteration < MOST_ITERATIONS && moved > LEAST_MOVE; iteration++) {
    const now = balances(x), rows = now.map(value => [value]);
    for (let k = x.length - 1; k >= 0; k--) {
      const kept = x[k], ahead = DIFFERENCE * (1 + Math.abs(kept));
      x[k] = kept + ahead;
      balances(x).forEach((value, r) => rows[r].unshift((value - now[r]) / ahead));
      x[k] = kept;
    }
    const steps = eliminate(rows), sizes = steps.map((step, k) => Math.abs(step) / (1 + Math.abs(x[k])));
    moved = Math.max(...sizes);
    steps.forEach((step, k) => { x[k] -= (moved < 0.5 ? 1 : 0.5 / moved) * step; });
  }
  return moved <= SETTLED && balances(x).every(value => Math.abs(value) < BALANCED) ? x : null;
};
// The solution of linear equations, each a row that ends in its right side.
const eliminate = rows => {
  const n = rows.length, solution = new Array(n);
  for (let k = 0; k < n; k++) {
    for (let r = k + 1; r < n; r++) if (Math.abs(rows[r][k]) > Math.abs(rows[k][k])) [rows[k], rows[r]] = [rows[r], rows[k]];
    for (let r = k + 1; r < n; r++) {
      const factor = rows[r][k] / rows[k][k];
      rows[r] = rows[r].map((value, c) => value - factor * rows[k][c]);
    }
  }
  for (let k = n - 1; k >= 0; k--) {
    const known = solution.reduce((sum, value, c) => sum + rows[k][c] * value, 0);
    solution[k] = (rows[k][n] - known) / rows[k][k];
  }
  return solution;
};
// The outputs of the equations above over one event: four stages a step, `substeps` steps a sample.
const simulate = (given, event, inputs, substeps) => {
  const before = [...given, ...event], begin = start(before), starts = begin.slice(0, STARTS);
  if (!begin.slice(STARTS).every(slack => slack >= 0)) return null;
  if (SOLVES) {
    const memories = starts.slice(STATES), states = settle(x => rest([...before, ...x, ...memories]), starts.slice(0, STATES));
    if (states === null) return null;
    starts.splice(0, STATES, ...states);
  }
  const lane = [...before, ...starts, ...constant([...before, ...starts])];
  const step = event[STEP], length = step / substeps, samples = inputs.U.length, outputs = [];
  let y = starts.slice(0, STATES), memories = starts.slice(STATES);
  const at = (i, x) => INPUTS.map(name => x ? between(inputs, name, i, x, step) : inputs[name][i]);
  const rate = (states, now) => slope([...lane, ...memories, ...now, ...states]);
  const along = (share, slopes) => y.map((value, k) => value + share * length * slopes[k]);
  for (let i = 0; i < samples; i++) {
    const now = at(i, 0);
    if (MEMORIES) memories = renewal([...lane, ...memories, ...now, ...y]);
    outputs.push(output([...lane, ...memories, ...now, ...y]));
    if (i + 1 === samples) break;
    for (let j = 0; STATES && j < substeps; j++) {
      const a = at(i, j / substeps), b = at(i, (j + 0.5) / substeps), c = at(i, (j + 1) / substeps);
      const k1 = rate(y, a), k2 = rate(along(HALF_WAY, k1), b);
      const k3 = rate(along(HALF_WAY, k2), b), k4 = rate(along(1, k3), c);
      y = along(1 / 6, k1.map((value, k) => value + 2 * (k2[k] + k3[k]) + k4[k]));
    }
  }
  return outputs[0].map((_, c) => outputs.map(row => row[c]));
};
