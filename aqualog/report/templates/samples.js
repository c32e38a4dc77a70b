// Samples and spans of a drive: read from base64, and as many as a view can show.
const POINTS = 3000; // per line in view: about two per pixel
const HALF_BAR = 0.31; // of the distance of two lanes

function bytes(base64) {
  const text = atob(base64);
  const out = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
  return out.buffer;
}

// Minima and maxima outside the windows and every sample inside them, in order of time.
function unpack(line, windows, dt) {
  const full = new Float32Array(bytes(line.full));
  const index = new Uint32Array(bytes(line.index));
  const value = new Float32Array(bytes(line.value));
  const t = new Float64Array(full.length + index.length);
  const y = new Float32Array(t.length);
  let n = 0, k = 0, f = 0;
  const takeUntil = function (end) {
    for (; k < index.length && index[k] < end; k++, n++) { t[n] = index[k] * dt; y[n] = value[k]; }
  };
  for (const [begin, end] of windows) {
    takeUntil(begin);
    for (let i = begin; i < end; i++, n++) { t[n] = i * dt; y[n] = full[f++]; }
  }
  takeUntil(Infinity);
  return { t: t, y: y, row: line.row };
}

function firstAtOrAfter(t, x) {
  let a = 0, b = t.length;
  while (a < b) { const m = (a + b) >> 1; if (t[m] < x) a = m + 1; else b = m; }
  return a;
}

// Samples from index a to b, or first, least, greatest, last and a gap of each of as many stretches as are visible.
function picked(line, a, b) {
  const x = [], y = [];
  const take = function (i) { x.push(line.t[i]); y.push(Number.isNaN(line.y[i]) ? null : line.y[i]); };
  if (b - a <= POINTS) { for (let i = a; i < b; i++) take(i); return [x, y]; }
  const stretches = POINTS / 4;
  for (let s = 0; s < stretches; s++) {
    const from = a + Math.floor((b - a) * s / stretches), to = a + Math.floor((b - a) * (s + 1) / stretches);
    let low = -1, high = -1, gap = -1;
    for (let i = from; i < to; i++) {
      const v = line.y[i];
      if (Number.isNaN(v)) { if (gap < 0) gap = i; continue; }
      if (low < 0 || v < line.y[low]) low = i;
      if (high < 0 || v > line.y[high]) high = i;
    }
    const chosen = [from, low, high, gap, to - 1].filter(function (i) { return i >= 0; });
    chosen.sort(function (p, q) { return p - q; });
    chosen.forEach(function (i, j) { if (j === 0 || i !== chosen[j - 1]) take(i); });
  }
  return [x, y];
}

// Begins and ends [s], in order of time.
function spansOf(base64, dt) {
  const index = new Uint32Array(bytes(base64)), begin = new Float64Array(index.length / 2), end = begin.slice();
  for (let i = 0; i < begin.length; i++) { begin[i] = index[2 * i] * dt; end[i] = index[2 * i + 1] * dt; }
  return { begin: begin, end: end };
}

// Spans in a range, as [begin, end]; those that are closer than can be seen are one, and none is shorter than `least`.
function inside(spans, from, to, unseen, least = 0) {
  const out = [];
  for (let i = firstAtOrAfter(spans.end, from); i < spans.begin.length && spans.begin[i] <= to; i++) {
    const last = out[out.length - 1], end = Math.max(spans.end[i], spans.begin[i] + least);
    if (last && spans.begin[i] - last[1] < unseen) last[1] = Math.max(last[1], end);
    else out.push([spans.begin[i], end]);
  }
  return out;
}

function outlines(spans, level) {
  const x = [], y = [], low = level - HALF_BAR, high = level + HALF_BAR;
  for (const [a, b] of spans) {
    x.push(a, a, b, b, a, null);
    y.push(low, high, high, low, low, null);
  }
  return [x, y];
}

// One shape for all: thousands of rectangles would be slow.
function rectangles(spans, yref, top, colour) {
  const path = spans.map(function ([a, b]) {
    return `M${a.toFixed(6)},0V${top}H${b.toFixed(6)}V0Z`;
  }).join("");
  return path ? [{
    type: "path", path: path, xref: "x", yref: yref, fillcolor: colour, line: { width: 0 }, layer: "below",
  }] : [];
}
