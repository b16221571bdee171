const charts = [...document.querySelectorAll(".chart")];
const KINDS = {i2: Int16Array, f4: Float32Array, f8: Float64Array};
const decode = ({dtype, bdata, offset, scale, start, step, count}) => {
  if (count) return Float64Array.from({length: count}, (_, i) => start + i * step);
  const raw = new KINDS[dtype](Uint8Array.from(atob(bdata), letter => letter.charCodeAt(0)).buffer);
  return dtype === "i2" ? Float64Array.from(raw, code => code === -32768 ? NaN : offset + scale * code) : raw;
};
const unpack = samples => {
  const bytes = Uint8Array.from(atob(samples.bdata), letter => letter.charCodeAt(0));
  samples.raw = new Int16Array(bytes.buffer);
};
// The lowest and the highest sample of each stretch between two times; the first and the last of all keep the axis.
const seen = (samples, from, to) => {
  const {raw, start, step, offset, scale} = samples, last = raw.length - 1, x = [], y = [];
  const first = Math.max(0, Math.floor((from - start) / step)), end = Math.min(last, Math.ceil((to - start) / step));
  const add = i => { x.push(start + i * step); y.push(raw[i] === -32768 ? null : offset + scale * raw[i]); };
  const stretch = Math.max(1, Math.floor(2 * (end - first + 1) / SHOWN));
  if (first > 0) add(0);
  for (let i = first; i <= end; i += stretch) {
    let low = i, high = i, gap = -1;
    for (let k = i; k < Math.min(i + stretch, end + 1); k++) {
      if (raw[k] === -32768) gap = k;
      else if (raw[k] < raw[low] || raw[low] === -32768) low = k;
      else if (raw[k] > raw[high]) high = k;
    }
    [...new Set(gap < 0 ? [low, high] : [low, gap, high])].sort((a, b) => a - b).forEach(add);
  }
  if (end < last) add(last);
  return {x, y};
};
// Where the cursor is: every curve's value, each panel a row, and the phasors.
const sampleAt = ({raw, start, step, offset, scale}, t) => {
  const i = Math.round((t - start) / step);
  return i < 0 || i >= raw.length || raw[i] === -32768 ? null : offset + scale * raw[i];
};
const valueAt = (trace, t) => {
  if (trace.samples) return sampleAt(trace.samples, t);
  const {at, states} = trace.course || {at: [], states: []};
  let last = -1;
  at.forEach((time, i) => { if (time <= t) last = i; });
  return last < 0 || t > at[at.length - 1] ? null : states[last];
};
const digits = (value, n) => value === 0 ? "0" : Number(value.toPrecision(n)).toString();
const arrows = phasors => {
  const most = {};
  phasors.forEach(p => { most[p.panel] = Math.max(most[p.panel] || 1e-300, p.size); });
  const lines = phasors.map(p => {
    const reach = (p.panel === phasors[0].panel ? 78 : 52) * p.size / most[p.panel];
    const x = (reach * Math.cos(p.angle)).toFixed(1), y = (-reach * Math.sin(p.angle)).toFixed(1);
    const thick = p.panel === phasors[0].panel ? 2 : 4;
    return `<line x2="${x}" y2="${y}" stroke="${p.color}" stroke-width="${thick}"/>` +
      `<circle cx="${x}" cy="${y}" r="3.5" fill="${p.color}"/>`;
  });
  return `<svg viewBox="-90 -90 180 180" width="180" height="180"><circle r="78" fill="none" stroke="#dcdcdc"/>` +
    `<path d="M-84 0H84M0 -84V84" stroke="#dcdcdc"/>${lines.join("")}</svg>`;
};
const rows = (chart, t) => {
  const made = new Map();
  chart.data.filter(trace => trace.panel && !trace.phasor).forEach(trace => {
    const value = valueAt(trace, t), cells = made.get(trace.panel) || made.set(trace.panel, []).get(trace.panel);
    if (value === null || (trace.course && !value)) return;
    cells.push([trace.label, trace.course ? "" : digits(value, 5), trace.line.color]);
  });
  return [...made];  // rows stay, so that nothing moves under the cursor
};
const phasors = (chart, t) => {
  const turning = chart.data.filter(trace => trace.phasor && sampleAt(trace.phasor.re, t) !== null).map(trace => {
    const re = sampleAt(trace.phasor.re, t), im = sampleAt(trace.phasor.im, t);
    const {panel, name, line: {color}} = trace;
    return {panel, name, color, size: Math.hypot(re, im), angle: Math.atan2(im, re)};
  });
  return turning.map(p => ({...p, angle: Math.atan2(
    Math.sin(p.angle - turning[0].angle), Math.cos(p.angle - turning[0].angle))}));
};
const readOut = (chart, t) => {
  const box = chart.previousElementSibling, table = document.createElement("table"), turning = phasors(chart, t);
  const line = (panel, cells) => {
    const row = table.insertRow();
    row.insertCell().textContent = panel;
    const cell = row.insertCell();
    cells.forEach(([label, value, color]) => {
      const item = cell.appendChild(document.createElement("span")), mark = document.createElement("i");
      item.textContent = `${label} ${value}`;
      mark.style.background = color;
      item.prepend(mark);
    });
  };
  line("t [s]", [["", t.toFixed(4), "none"]]);
  rows(chart, t).forEach(([panel, cells]) => line(panel, cells));
  const polar = p => [p.name, `${digits(p.size, 4)} ∠ ${(p.angle * 180 / Math.PI).toFixed(1)}°`, p.color];
  [...new Set(chart.data.filter(trace => trace.phasor).map(trace => trace.panel))].forEach(panel =>
    line(`phasors of ${panel}`, turning.filter(p => p.panel === panel).map(polar)));
  box.replaceChildren(table);
  if (turning.length) box.insertAdjacentHTML("beforeend", arrows(turning));
};
const zoomed = chart => {
  const picked = chart.data.map((trace, k) => k).filter(k => chart.data[k].samples);
  if (!picked.length) return;
  const [from, to] = chart.layout.xaxis.range.map(Number);
  const made = picked.map(k => seen(chart.data[k].samples, from, to));
  Plotly.restyle(chart, {x: made.map(m => m.x), y: made.map(m => m.y)}, picked);
};
// Panels whose units are known: curves are kept as they were given, and shown times their panel's factor.
let perUnit = false;
const inUnits = ({own, units, titles}, data) => {
  const factor = trace => perUnit ? 1 : units.factors[Number((trace.yaxis || "y").slice(1) || 1) - 1];
  const labels = perUnit ? titles : units.labels;
  const scaled = (kept, by) => ArrayBuffer.isView(kept) ? kept.map(value => value * by) : kept;
  data.filter(trace => trace.samples).forEach(trace => {
    const {offset, scale} = trace.samples.own = trace.samples.own || {...trace.samples};
    Object.assign(trace.samples, {offset: offset * factor(trace), scale: scale * factor(trace)});
  });
  return {
    curves: data.map((trace, k) => scaled(own[k], factor(trace))),
    axes: Object.fromEntries(labels.map((text, k) => [`yaxis${k ? k + 1 : ""}.title.text`, text])),
  };
};
const switchUnits = () => {
  perUnit = !perUnit;
  document.querySelectorAll("button.units").forEach(label);
  charts.filter(chart => chart.measures && chart.data).forEach(chart => {
    const {curves, axes} = inUnits(chart.measures, chart.data);
    const kept = chart.data.map((trace, k) => k).filter(k => !chart.data[k].samples);
    if (kept.length) Plotly.restyle(chart, {y: kept.map(k => curves[k])}, kept);
    Plotly.relayout(chart, axes);
    zoomed(chart);
  });
};
const label = button => { button.textContent = perUnit ? "in physical units" : "in pu"; };
const measure = (chart, data, layout, units) => {
  const axes = units.labels.map((_, k) => layout[`yaxis${k ? k + 1 : ""}`]);
  const own = data.map(trace => trace.y);
  chart.measures = {own, units, titles: axes.map(axis => axis.title.text)};
  const {curves} = inUnits(chart.measures, data);
  data.forEach((trace, k) => { trace.y = curves[k]; });
  axes.forEach((axis, k) => { axis.title.text = (perUnit ? chart.measures.titles : units.labels)[k]; });
  const button = document.createElement("button");
  button.className = "units"; label(button); button.addEventListener("click", switchUnits);
  chart.before(button);
};
// What a click at x is answered by, below the chart.
const answer = (chart, answers) => {
  const box = chart.nextElementSibling.insertAdjacentElement("afterend", document.createElement("p"));
  box.className = "answer";
  chart.on("plotly_click", event => {
    const x = Number(event.points[0].x);
    box.innerText = answers.filter(({start, end}) => start <= x && x <= end).map(({text}) => text).join("\n");
  });
};
const draw = chart => {
  const {data, layout, cursor, arrays, units, answers} = JSON.parse(chart.nextElementSibling.textContent);
  const decoded = arrays.map(decode);
  data.forEach(trace => ["x", "y"].forEach(key => {
    if (trace[key] && trace[key].array !== undefined) trace[key] = decoded[trace[key].array];
  }));
  if (units) measure(chart, data, layout, units);
  const sampled = data.filter(trace => trace.samples);
  const [from, to] = (layout.xaxis.range || [-Infinity, Infinity]).map(Number);
  sampled.forEach(trace => { unpack(trace.samples); Object.assign(trace, seen(trace.samples, from, to)); });
  data.filter(trace => trace.phasor).forEach(({phasor}) => { unpack(phasor.re); unpack(phasor.im); });
  Plotly.newPlot(chart, data, layout, SETTINGS);
  if (answers) answer(chart, answers);
  const told = event => Object.keys(event).some(key => key.startsWith("xaxis"));
  if (sampled.length) chart.on("plotly_relayout", event => told(event) && zoomed(chart));
  if (cursor === undefined) return;
  readOut(chart, cursor);
  chart.on("plotly_hover", event => readOut(chart, Number(event.xvals ? event.xvals[0] : event.points[0].x)));
};
const folded = chart => chart.closest("details:not([open])");  // drawn when first opened: many cost seconds
charts.filter(chart => !folded(chart)).forEach(draw);
const drawn = () => charts.filter(chart => chart.data && chart.offsetParent);
const resize = () => {
  charts.filter(chart => !chart.data && !folded(chart)).forEach(draw);
  drawn().forEach(chart => Plotly.Plots.resize(chart));
};
const paper = chart => ({width: chart.closest(".charts") ? PAPER / 2 - 10 : PAPER});
addEventListener("beforeprint", () => drawn().forEach(chart => Plotly.relayout(chart, paper(chart))));
addEventListener("afterprint", () => drawn().forEach(chart => Plotly.relayout(chart, {width: null, autosize: true})));
document.querySelectorAll("details").forEach(part => part.addEventListener("toggle", resize));
// Once more: a legend that takes another line moves the panels only then.
addEventListener("beforeprint", () => charts.forEach(chart => chart.data && Plotly.relayout(chart, paper(chart))));
