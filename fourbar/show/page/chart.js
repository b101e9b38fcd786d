// ---- chart ---------------------------------------------------------------------------------
const angle = (name, label) => [name, `${label}, deg`, DEG], other = (name, label, si) => [name, `${label}, ${nameOf(si)}`, inUnit(si, 1)];
const INPUT = () => [angle("theta_2", "\u03b8\u2082"), other("omega_2", "\u03c9\u2082", "rad/s"), other("alpha_2", "\u03b1\u2082", "rad/s^2")];
const quantitiesOf = () => [
  ...single() ? INPUT() : [],
  angle("theta_3", "\u03b8\u2083"), angle("theta_4", "\u03b8\u2084"),
  other("omega_3", "\u03c9\u2083", "rad/s"), other("omega_4", "\u03c9\u2084", "rad/s"),
  other("alpha_3", "\u03b1\u2083", "rad/s^2"), other("alpha_4", "\u03b1\u2084", "rad/s^2"),
  ...POINTS.flatMap(([name]) => [other(`v_${name}`, `speed of ${typeset(name)}`, "m/s"), other(`a_${name}`, `acceleration of ${typeset(name)}`, "m/s^2")]),
  other("energy", "kinetic energy", "J"), other("torque", `torque on bar ${data.drive_bar}`, "N m"), other("power", "power of the drive", "W"),
  angle("transmission", "transmission angle"),
  ...[3, 4].map(k => [`omega_${k}/omega_2`, `\u03c9${"\u2083\u2084"[k - 3]}/\u03c9\u2082, 1`, 1]), ["mechanical_advantage", "mechanical advantage, 1", 1],
  other("shaking_force", "|shaking force|", "N"), other("shaking_moment", "shaking moment about O\u2082", "N m"),
  other("drive_force", "force of the drive", "N"), other("stroke", "stroke", "m"),
  ...FORCES.map(name => other(name, `|${typeset(name)}|`, "N")),
];
let QUANTITIES = quantitiesOf(), reference = null;   // reference: the curves of another state, drawn thin behind
const chart = byId("chart");
let plotted = { values: [], x: () => 0, y: () => 0 };

function column(name) {
  const [, , factor] = QUANTITIES.find(q => q[0] === name);
  const point = /^[va]_/.test(name) && POINTS.find(p => p[0] === name.slice(2));
  const values = grid.map((_, i) => {
    if (point) return Math.hypot(...pointMotion(i, point)[name[0] === "v" ? 0 : 1]) * factor;
    const v = table()[name][i];
    if (v === null || v === undefined) return NaN;
    return Array.isArray(v) ? (v[0] === null ? NaN : Math.hypot(v[0], v[1]) * factor) : v * factor;
  });
  if (name.startsWith("theta")) for (let i = 1; i < values.length; i++) values[i] -= 360 * Math.round((values[i] - values[i - 1]) / 360) || 0;
  return values;
}

// Axes of a chart over the motion, from low to high; where its points lie.
function chartFrame(chart, low, high) {
  const width = Math.max(280, chart.parentElement.clientWidth || picture.parentElement.clientWidth), height = 170, left = 62, bottom = 26;
  chart.replaceChildren();
  set(chart, { viewBox: `0 0 ${width} ${height}` });
  const { values: over, factor, sign } = axis(), first = over[0], span = over[over.length - 1] - first || 1;
  const x = t => left + (width - left - 12) * (t - first) / span, y = v => 10 + (height - 10 - bottom) * (high - v) / (high - low);
  const most = Math.max(3, (width - left - 12) / (factor === DEG ? 60 : 85)), wide = Math.abs(span) * factor, decade = 10 ** Math.floor(Math.log10(wide / most));
  const step = (factor === DEG ? [15, 30, 45, 60, 90, 180] : [1, 2, 5, 10].map(m => m * decade)).find(d => wide / d <= most) ?? 360;
  for (let n = Math.ceil(first * factor / step - 1e-9); n * step <= (first + span) * factor + 1e-9 * step; n++) {
    const at = x(n * step / factor), shown = String(Number((n * step).toPrecision(12)));
    make(chart, "line", { class: "axis", x1: at, x2: at, y1: 10, y2: height - bottom });
    make(chart, "text", { class: "small", x: at, y: height - 9, "text-anchor": at > width - 30 ? "end" : "middle" }).textContent = `${shown}${sign}`.replace("-", "\u2212");
  }
  for (const [v, kind] of [[low, "axis"], [high, "axis"], [0, "zero"]]) {
    if (v < low || v > high) continue;
    make(chart, "line", { class: kind, x1: left, x2: width - 12, y1: y(v), y2: y(v) });
    if (v === 0 && Math.min(y(low) - y(0), y(0) - y(high)) < 14 && low !== 0 && high !== 0) continue;
    if (v !== 0 || kind === "zero") make(chart, "text", { class: "small", x: left - 6, y: y(v) + 4, "text-anchor": "end" }).textContent = text(v, 3);
  }
  return { over, x, y, width, height, bottom };
}

// The curves of the data shown, as they stay when other data are.
function captured(name) {
  const values = Object.fromEntries(QUANTITIES.filter(q => q[0] in table() || /^[va]_/.test(q[0]) && "omega_3" in table()).map(q => [q[0], column(q[0])]));
  return { name, over: axis().values, axis: axis().name, values, paths: couplerPaths(), marks: couplerMarks() };
}
const peakOf = values => values.reduce((most, v) => Math.abs(v) > Math.abs(most) ? v : most, 0);
let unchanged = false;   // whether the scene is the one it is compared with
// A change of a peak in percent; one of more than ten times as a factor, and none from what rounding leaves of zero.
function changeOf(then, now) {
  if (!(then > 1e-9 * now && now < Infinity)) return "";
  const grown = now / then - 1;
  if (grown > 9) return ` (${text(now / then, 3)} times)`;
  return ` (${grown < 0 ? "\u2212" : "+"}${Math.abs(100 * grown).toFixed(Math.abs(grown) < 0.1 ? 1 : 0)}\u00a0%)`;
}
// A largest magnitude in words, and as a number: located as `analyze` does, or that of the positions, which is reached at least.
function told(name, values, peaks) {
  const located = name in (peaks ?? {}), size = located ? Math.abs((peaks[name] ?? NaN) * QUANTITIES.find(q => q[0] === name)[2]) : Math.abs(peakOf(values));
  return { size, words: located && peaks[name] === null ? "grows without bound" : `${located ? "" : "at least "}${text(size, 4)}` };
}
function comparison(name, values) {
  const before = reference?.values[name];
  if (!before || unchanged) return "";
  const then = told(name, before, data.kept_peaks), now = told(name, values, data.peaks), label = QUANTITIES.find(q => q[0] === name)[1], cut = label.lastIndexOf(", ");
  return `Peak ${label.slice(0, cut)}, ${label.slice(cut + 2)}: ${then.words} \u2192 ${now.words}${changeOf(then.size, now.size)}, against ${reference.name}.`;
}

const cutNote = (what, top, words) => `The ${what} is cut at ${text(top, 3)}; it ${words.startsWith("grows") ? words : `reaches ${words}`}.`;
function drawChart() {
  const available = QUANTITIES.filter(([name]) => (/^[va]_/.test(name) ? "omega_3" : name) in table());
  const select = byId("quantity"), wanted = available.some(q => q[0] === select.value) ? select.value : (available.find(q => ["torque", "drive_force"].includes(q[0])) ?? available[0])[0];
  select.replaceChildren(...available.map(([name, label]) => new Option(label, name, false, name === wanted)));
  const values = column(wanted);
  const behind = reference?.axis === axis().name ? reference.values[wanted] ?? [] : [];
  const limit = wanted.startsWith("theta") ? { cut: false } : ceiling([...values, ...behind]), finite = [...values, ...behind].filter(Number.isFinite);
  let low = Math.min(...finite), high = Math.max(...finite);
  if (limit.cut) { low = Math.max(low, -limit.top); high = Math.min(high, limit.top); }
  if (!wanted.startsWith("theta")) { low = Math.min(low, 0); high = Math.max(high, 0); }
  if (high - low < 1e-300) { high += 1; low -= 1; }
  const peak = told(wanted, values, data.peaks).words;
  byId("chart-note").textContent = limit.cut ? cutNote("curve", limit.top, peak) : peak.startsWith("grows") ? `Between the positions it ${peak}.` : "";
  plotted = { ...chartFrame(chart, low, high), values, low, high };
  const { over, x, y, width, height, bottom } = plotted;
  const curve = (values, over, kind) => {
    let d = "", open = false;
    values.forEach((v, i) => {
      const jump = i > 0 && limit.cut && v * values[i - 1] < 0 && Math.abs(v - values[i - 1]) > limit.top;   // across a pole no line
      const inside = Number.isFinite(v) && v >= low && v <= high && x(over[i]) >= 60 && x(over[i]) <= width - 10;
      if (inside) d += (open && !jump ? "L" : "M") + x(over[i]).toFixed(2) + " " + y(v).toFixed(2);
      open = inside;
    });
    make(chart, "path", { class: kind, d });
  };
  if (behind.length) curve(behind, reference.over, "curve behind");
  curve(values, over, "curve");
  byId("compared").textContent = comparison(wanted, values);
  byId("plotted").textContent = QUANTITIES.find(q => q[0] === wanted)[1];
  plotted.cursor = make(chart, "line", { class: "cursor", y1: 10, y2: height - bottom });
  plotted.dot = make(chart, "circle", { class: "dot", r: 4.5 });
}

function moveCursor(i) {
  const { cursor, dot, over, values, x, y, low, high } = plotted;
  if (!cursor) return;
  set(cursor, { x1: x(over[i]), x2: x(over[i]) });
  const inside = Number.isFinite(values[i]) && values[i] >= low && values[i] <= high;
  dot.style.display = inside ? "" : "none";
  if (inside) set(dot, { cx: x(over[i]), cy: y(values[i]) });
}

