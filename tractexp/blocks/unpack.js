// Run a program that gzip and base 64 have packed, which browsers unpack while the page is shown; then say so.
const unpacked = async program => {
  const bytes = Uint8Array.from(atob(program), letter => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
};
const run = program => unpacked(program).then(text => {
  const element = document.createElement("script");
  element.textContent = text;
  document.head.append(element);
  document.dispatchEvent(new Event("drawn"));
}, () => document.querySelectorAll(".chart").forEach(chart => {
  chart.textContent = "Browsers older than 2023 do not draw this chart.";
}));
