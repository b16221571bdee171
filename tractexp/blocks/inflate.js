// The text of `size` bytes that raw deflate (RFC 1951) and base 64 have packed. Browsers do this by themselves, but
// later than the page is shown, printed and read; old ones do not.
const inflate = (packed, size) => {
  const input = Uint8Array.from(atob(packed), letter => letter.charCodeAt(0)), output = new Uint8Array(size);
  let at = 0, byte = 0, bit = 0;
  const take = n => {  // the next n bits, the lowest first
    let value = 0;
    for (let i = 0; i < n; i++) {
      value |= (input[byte] >> bit & 1) << i;
      if (++bit === 8) { bit = 0; byte++; }
    }
    return value;
  };
  // Canonical: how many codes there are of each length, and their symbols in order.
  const codeOf = lengths => {
    const count = new Uint16Array(16), next = new Uint16Array(17), symbols = new Uint16Array(lengths.length);
    lengths.forEach(n => n && count[n]++);
    for (let n = 1; n < 16; n++) next[n + 1] = next[n] + count[n];
    lengths.forEach((n, symbol) => { if (n) symbols[next[n]++] = symbol; });
    return {count, symbols};
  };
  const symbolBy = ({count, symbols}) => {
    for (let n = 1, code = 0, first = 0, index = 0; n < 16; n++) {
      code |= take(1);
      if (code < first + count[n]) return symbols[index + code - first];
      index += count[n];
      first = (first + count[n]) << 1;
      code <<= 1;
    }
    throw new Error("the page is damaged");
  };
  const repeated = (...runs) => runs.flatMap(([n, value]) => Array(n).fill(value));
  const fixed = [codeOf(repeated([144, 8], [112, 9], [24, 7], [8, 8])), codeOf(repeated([30, 5]))];
  const ORDER = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
  const dynamic = () => {
    const literals = take(5) + 257, distances = take(5) + 1, known = take(4) + 4, first = Array(19).fill(0);
    for (let i = 0; i < known; i++) first[ORDER[i]] = take(3);
    const code = codeOf(first), lengths = [];
    while (lengths.length < literals + distances) {
      const symbol = symbolBy(code);
      if (symbol < 16) lengths.push(symbol);
      else if (symbol === 16) lengths.push(...repeated([take(2) + 3, lengths[lengths.length - 1]]));
      else lengths.push(...repeated([symbol === 17 ? take(3) + 3 : take(7) + 11, 0]));
    }
    return [codeOf(lengths.slice(0, literals)), codeOf(lengths.slice(literals))];
  };
  const lengthOf = symbol => {
    if (symbol < 265) return symbol - 254;
    if (symbol === 285) return 258;
    const more = (symbol - 261) >> 2;
    return ((4 + (symbol - 265) % 4) << more) + 3 + take(more);
  };
  const distanceOf = symbol => {
    if (symbol < 4) return symbol + 1;
    const more = (symbol >> 1) - 1;
    return ((2 + symbol % 2) << more) + 1 + take(more);
  };
  const stored = () => {
    if (bit) { bit = 0; byte++; }
    const length = take(16);
    byte += 2;
    output.set(input.subarray(byte, byte + length), at);
    at += length;
    byte += length;
  };
  const coded = ([literal, distance]) => {
    for (let symbol = symbolBy(literal); symbol !== 256; symbol = symbolBy(literal)) {
      if (symbol < 256) {
        output[at++] = symbol;
      } else {
        const end = at + lengthOf(symbol), back = distanceOf(symbolBy(distance));
        while (at < end) { output[at] = output[at - back]; at++; }
      }
    }
  };
  for (let last = 0; !last;) {
    last = take(1);
    const kind = take(2);
    if (kind === 0) stored();
    else coded(kind === 1 ? fixed : dynamic());
  }
  return new TextDecoder().decode(output);
};
const run = program => {
  const element = document.createElement("script");
  element.textContent = program;
  document.head.append(element);
};
