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
// The outputs of the equations above over one event: four stages a step, `substeps` steps a sample.
const simulate = (given, event, inputs, substeps) => {
  const before = [...given, ...event], begin = start(before), starts = begin.slice(0, STARTS);
  if (!begin.slice(STARTS).every(slack => slack >= 0)) return null;
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
