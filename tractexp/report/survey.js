const {columns, rows, atOnce, colors} = JSON.parse(document.getElementById("rows").textContent);
const $ = id => document.getElementById(id);
let shown = rows, key = null, down = false, most = atOnce;
const marks = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"};
const safe = text => String(text).replace(/[&<>"]/g, mark => marks[mark]);
const picture = (values, color) => {
  if (!values || values.length < 2) return "";
  const known = values.filter(v => v !== null), low = Math.min(0, ...known), high = Math.max(0.01, ...known);
  let line = "", pen = "M";
  values.forEach((v, k) => {
    if (v === null) { pen = "M"; return; }
    line += pen + (1 + 82 * k / (values.length - 1)).toFixed(1) + " " + (1 + 24 * (high - v) / (high - low)).toFixed(1);
    pen = "L";
  });
  const path = `<path d="${line}" fill="none" stroke="${color}" stroke-width="1.2"/>`;
  return `<svg viewBox="0 0 84 26" aria-hidden="true">${path}</svg>`;
};
const cell = (row, [name, , kind, digits]) => {
  const value = row[name];
  if (kind === "picture") return `<td>${picture(value, colors[name])}</td>`;
  if (kind === "name") {
    const whole = value || row.file, cut = whole.lastIndexOf("/") + 1;
    return `<td class="name"><span>${safe(whole.slice(0, cut))}</span>${safe(whole.slice(cut))}</td>`;
  }
  if (kind === "why") {
    const command = row.command ? `<details><summary>command</summary><code>${safe(row.command)}</code></details>` : "";
    return `<td class="words">${safe(row.why || "")}${command}</td>`;
  }
  if (kind === "yes") return `<td>${value ? "yes" : row.event ? "no" : ""}</td>`;
  if (kind === "pair") {
    const figure = v => v === null ? "?" : v && Math.abs(v) < 1e-3 ? v.toExponential(1) : Number(v.toPrecision(digits));
    const [before, after] = [row[`${name}_before`], row[`${name}_after`]];
    const unit = row.unit === "pu" ? " pu" : "";
    return `<td>${before === null && after === null ? "" : `${figure(before)} → ${figure(after)}${unit}`}</td>`;
  }
  if (kind === "words") return `<td class="words">${safe(value ?? "")}</td>`;
  if (value === null || value === undefined) return "<td></td>";
  if (kind === "time") return `<td>${safe(value.replace("T", " ").slice(0, 19))}</td>`;
  if (kind === "figure") return `<td>${Number(value.toPrecision(digits))}</td>`;
  const text = (value * (kind === "share" ? 100 : kind === "milli" ? 1000 : 1)).toFixed(digits);
  return `<td>${Number(text) === 0 ? text.replace("-", "") : text}</td>`;
};
const draw = () => {
  $("body").innerHTML = shown.slice(0, most)
    .map(row => `<tr${row.worth ? ' class="worth"' : ""}>${columns.map(c => cell(row, c)).join("")}</tr>`).join("");
  const rest = shown.length > most ? `, the first ${most} drawn` : "";
  $("count").textContent = `${shown.length} of ${rows.length} rows${rest}`;
  $("more").hidden = shown.length <= most;
};
const order = (a, b) => {
  const [x, y] = [a[key], b[key]], gone = v => v === null || v === undefined || v === "";
  if (gone(x) || gone(y)) return gone(x) - gone(y);  // what is not known comes last, either way
  const ahead = typeof x === "number" ? x - y : String(x).localeCompare(String(y), undefined, {numeric: true});
  return down ? -ahead : ahead;
};
const sift = () => {
  const words = $("text").value.toLowerCase().split(/\s+/).filter(Boolean), kind = $("kind").value;
  const least = $("depth").value === "" ? null : Number($("depth").value) / 100, worth = $("worth").checked;
  const deep = row => least === null || (row.depth !== null && Math.abs(row.depth) >= least);
  shown = rows.filter(row => (!kind || row.kind === kind) && (!worth || row.worth) && deep(row)
    && words.every(word => row.text.includes(word)));
  if (key) shown = [...shown].sort(order);
  most = atOnce;
  draw();
};
rows.forEach(row => {
  row.text = [row.event, row.file, row.load, row.station, row.kind, row.when, row.why].join(" ").toLowerCase();
});
[...new Set(rows.map(row => row.kind))].sort().forEach(kind => $("kind").add(new Option(kind, kind)));
["text", "depth"].forEach(id => $(id).addEventListener("input", sift));
["kind", "worth"].forEach(id => $(id).addEventListener("change", sift));
$("more").addEventListener("click", () => { most += 5 * atOnce; draw(); });
document.querySelectorAll("th[data-key]").forEach(head => head.addEventListener("click", () => {
  down = key === head.dataset.key ? !down : false;
  key = head.dataset.key;
  document.querySelectorAll("th[data-key]").forEach(other => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  sift();
}));
sift();
