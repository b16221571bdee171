const box = document.currentScript.previousElementSibling;
const canvas = box.querySelector("canvas"), told = box.querySelector("p"), rows = box.querySelector("div");
const step = content.event[STEP], {samples} = content;
const decode = ({bdata}) =>
  Array.from(new Float32Array(Uint8Array.from(atob(bdata), letter => letter.charCodeAt(0)).buffer));
Object.entries(content.inputs).forEach(([name, row]) => {
  content.inputs[name] = row.bdata ? decode(row) : new Array(samples).fill(row);
});
content.measured = content.measured.map(row => decode(row).map(value => Number.isNaN(value) ? null : value));
content.inputs.t = content.inputs.U.map((_, i) => i * step);
const fitted = content.places.map(place => content.given[place]), moved = [...fitted];
const COLORS = ["#D55E00", "#0072B2"], MEASURED = "#9A9A9A", HEIGHT = 360, LEFT = 56, GAP = 26;
let unit = content.scale ? "MW" : "pu";
const number = value => Number(value.toPrecision(5)).toString();
const calculate = () => {
  const given = [...content.given];
  content.places.forEach((place, k) => { given[place] = moved[k]; });
  return simulate(given, content.event, content.inputs, content.substeps);
};
// The relative error of Eq. (20), in percent.
const error = (measured, made) => {
  let off = 0, all = 0;
  measured.forEach((value, i) => {
    if (value === null) return;
    off += (value - made[i]) ** 2; all += value ** 2;
  });
  return 100 * Math.sqrt(off / all);
};
const draw = made => {
  const width = box.clientWidth, ratio = window.devicePixelRatio || 1, panel = (HEIGHT - 2 * GAP) / 2;
  canvas.width = width * ratio; canvas.height = HEIGHT * ratio;
  canvas.style.width = "100%"; canvas.style.height = `${HEIGHT}px`;
  const pen = canvas.getContext("2d"), scale = unit === "pu" ? 1 : content.scale;
  pen.scale(ratio, ratio); pen.font = "12px system-ui, sans-serif";
  content.measured.forEach((measured, c) => {
    const top = GAP / 2 + c * (panel + GAP), seen = measured.filter(value => value !== null);
    const all = [...seen, ...(made ? made[c].filter(Number.isFinite) : [])];
    const low = Math.min(...all), high = Math.max(...all), span = high - low || 1;
    const x = i => LEFT + (width - LEFT - 6) * i / Math.max(samples - 1, 1);
    const y = value => top + panel * (1 - (value - low) / span);
    const line = (values, color, thick) => {
      pen.strokeStyle = color; pen.lineWidth = thick; pen.beginPath();
      let on = false;
      values.forEach((value, i) => {
        if (value === null || !Number.isFinite(value)) { on = false; return; }
        if (on) pen.lineTo(x(i), y(value)); else pen.moveTo(x(i), y(value));
        on = true;
      });
      pen.stroke();
    };
    line(measured, MEASURED, 3);
    if (made) line(made[c], COLORS[c], 1.6);
    pen.fillStyle = "#1d1d1f"; pen.textAlign = "right";
    [[low, top + panel], [high, top + 10]].forEach(([value, at]) => pen.fillText(number(value * scale), LEFT - 4, at));
    pen.fillText(`${"PQ"[c]} [${unit === "pu" ? "pu" : ["MW", "Mvar"][c]}]`, LEFT - 4, top + panel / 2);
  });
  pen.textAlign = "left"; pen.fillText(`${number(content.first)} s`, LEFT, HEIGHT - 2);
  pen.textAlign = "right"; pen.fillText(`${number(content.first + (samples - 1) * step)} s`, width - 6, HEIGHT - 2);
};
const update = () => {
  const made = calculate();
  draw(made);
  const errors = made && made.map((values, c) => `epsilon_${"pq"[c]} ${number(error(content.measured[c], values))} %`);
  told.textContent = `${content.name}, measured in grey: ${made ? errors.join(", ") : "no steady state here"}`;
};
const reset = [];
content.names.forEach((name, k) => {
  const label = document.createElement("label"), slider = document.createElement("input");
  const value = document.createElement("output"), title = document.createElement("span");
  title.textContent = name;
  Object.assign(slider, {type: "range", step: "any", min: content.bounds[k][0], max: content.bounds[k][1]});
  const show = () => { value.textContent = `${number(moved[k])} ${content.units[k]}`; };
  slider.addEventListener("input", () => { moved[k] = Number(slider.value); show(); update(); });
  reset.push(() => { moved[k] = fitted[k]; slider.value = fitted[k]; show(); });
  label.append(title, slider, value);
  rows.append(label);
});
const button = (text, act) => {
  const made = document.createElement("button");
  made.textContent = text;
  made.addEventListener("click", () => { act(made); update(); });
  rows.append(made);
};
button("back to the estimate", () => reset.forEach(act => act()));
if (content.scale) {
  button("in pu", made => {
    unit = unit === "pu" ? "MW" : "pu";
    made.textContent = unit === "pu" ? "in MW and Mvar" : "in pu";
  });
}
reset.forEach(act => act());
update();
window.addEventListener("resize", update);
