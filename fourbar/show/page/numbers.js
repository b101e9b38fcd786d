"use strict";
let data = JSON.parse(document.getElementById("data").textContent);
const lineAddress = data.live;   // of the workbench; a saved page has none
const byId = id => document.getElementById(id);
const DEG = 180 / Math.PI, TURN = 2 * Math.PI, FORCES = ["F12", "F32", "F43", "F14"];
const REASONS = {   // why a position has no forces, or more than one set of them
  jammed: "Friction jams the linkage here: no forces, or none that begin a motion, are in balance.",
  several: "Friction allows several sets of forces here; shown are those of the least friction.",
  no_direction: "Both ends of a spring or of the drive meet here: its pull has no direction, and forces have no value.",
  no_lever: "The line of the drive has no lever here: its stroke stands still, no force of it holds the linkage in balance.",
  wound: "A torsion spring is wound by more than half a turn here: forces have no value.",
  no_torque: "The two bars that are not driven are in line here: no torque of the drive holds them in balance.",
  overflow: "Numbers here are beyond the range of doubles: they have no value.",
};
const FORCE_PIN = { F12: "O2", F32: "A", F43: "B", F14: "O4" };
const SWEEP_SECONDS = 6;   // one sweep at speed 1
const ORDINARY = 0.95, OUTLIER = 3, CLIPPED = 1.6;   // a scale ends at CLIPPED times the 95th percentile where values diverge
const OTHER_BRANCH = 0.35, INSIDE = 0.02;   // rad: between the couplers of two branches; a little more than a range stays inside its limits
const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;

let unit, lengths, branch, grid, direction, POINTS, clock;   // of the data shown
let row = data.start, phase = row, playing = false, lastTime = null, lastDraw = 0;
let view = { width: 0, height: 0, k: 1, x: 0, y: 0 }, forceScale = { top: 0, cut: false };

const timed = () => data.time !== null;
const single = () => data.over.name !== "theta_2";   // one motion, over time or what is commanded, of one branch
const table = () => data.branches[single() ? data.branch : branch];
const AXES = { theta_2: ["Input angle", "\u03b8\u2082"], theta_3: ["Coupler angle", "\u03b8\u2083"], theta_4: ["Output angle", "\u03b8\u2084"], stroke: ["Cylinder", "stroke"], time: ["Time", "t"] };
const axis = () => {   // what curves and slider run over
  const name = data.over.name, [factor, sign] = { time: [1, " s"], stroke: [unit.factor, ` ${unit.name}`] }[name] ?? [DEG, "\u00b0"];
  return { name, factor, sign, values: data.over.values ?? grid };
};
const shows = name => name in table(), dynamic = () => shows("F12");

// The linkage at a position of the table, drawn by its angles: null where it does not assemble.
const at = i => table().theta_3[i] === null ? null : posed(grid[i], table().theta_3[i], table().theta_4[i]);
const tip = (from, length, angle) => [from[0] + length * Math.cos(angle), from[1] + length * Math.sin(angle)];
function posed(theta2, theta3, theta4) {
  const O2 = [0, 0], O4 = tip(O2, lengths[0], data.theta_1);
  return { theta2, theta3, theta4, O2, A: tip(O2, lengths[1], theta2), B: tip(O4, lengths[3], theta4), O4 };
}

// ---- numbers -------------------------------------------------------------------------------
function text(value, digits = 5) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "\u2013";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const shown = size >= 1e6 || size < 1e-4 ? value.toExponential(digits - 2) : value.toPrecision(digits);
  return shown.replace("-", "\u2212").replace("e+", "e");
}
const rounded = (value, digits) => Math.abs(value) < 1e6 ? String(Number(value.toPrecision(digits))) : text(value, digits + 2);
// A number with so many decimals; rounded to 0 it has no sign.
const fixed = (value, digits) => value.toFixed(digits).replace(/^-(?=[0.]+$)/, "").replace("-", "\u2212");
const degrees = value => value === null || !Number.isFinite(value) ? "\u2013" : fixed(value * DEG, 3);

// A number of an SI unit in the unit it is shown in, and that unit's name.
const inUnit = (si, value) => value === null || value === undefined ? value : value * (data.units[si]?.[1] ?? 1);
const typeset = name => /^(\|F\d\d\||F\d\d|G\d|theta_\d)$/.test(name) ? name.replace("theta_", "\u03b8").replace(/\d/g, d => "\u2080\u2081\u2082\u2083\u2084"[d]) : name;
const nameOf = si => (data.units[si]?.[0] ?? si).replace("^2", "\u00b2");

const valuesAt = i => ({ ...Object.fromEntries(Object.entries(table()).map(([name, column]) => [name, column[i]])), theta_2: grid[i] });

// A number at a position, written; of the drive where dry friction at rest leaves it a range, that range.
const leavesRange = v => v.torque_low < v.torque_high || v.drive_force_low < v.drive_force_high;
function ranged(v, name, write) {
  const [low, high] = [v[`${name}_low`], v[`${name}_high`]];
  return low < high ? `${write(low)} to ${write(high)}` : write(v[name]);
}

// Velocity and acceleration of a point: [name, its bar, from the bar's first pin in the bar's frame].
const pointsOf = () => [["A", 2, () => [lengths[1], 0]], ["B", 4, () => [lengths[3], 0]],
  ...[2, 3, 4].filter(k => data.centres[k]).map(k => [`G${k}`, k, () => data.centres[k]]),
  ...data.points.map(point => [point.name, point.bar, () => point.at])];
function pointMotion(i, [, bar, from]) {
  const v = valuesAt(i), spin = (k, z) => {
    const angle = v[`theta_${k}`] ?? NaN, w = v[`omega_${k}`] ?? NaN, e = v[`alpha_${k}`] ?? NaN, c = Math.cos(angle), s = Math.sin(angle);
    const [x, y] = [z[0] * c - z[1] * s, z[0] * s + z[1] * c];
    return [[-w * y, w * x], [-e * y - w * w * x, e * x - w * w * y]];
  };
  if (bar === 1) return [[0, 0], [0, 0]];
  const own = spin(bar, from());
  return bar === 3 ? spin(2, [lengths[1], 0]).map((foot, n) => [foot[0] + own[n][0], foot[1] + own[n][1]]) : own;
}

// Show other data from now on.
function adopt(next) {
  data = next; unit = data.unit; lengths = data.lengths; branch = data.branch; grid = data.theta_2;
  direction = data.over.speed < 0 ? -1 : 1; POINTS = pointsOf();
  clock = timed() ? Math.max(2, 3 - Math.floor(Math.log10(data.time[data.time.length - 1] || 1))) : 0;   // decimals of a second
}
adopt(data);

function showNumbers(i) {
  const v = valuesAt(i);
  for (const k of [2, 3, 4]) {
    byId(`theta_${k}`).textContent = degrees(v[`theta_${k}`] ?? null);
    byId(`omega_${k}`).textContent = text(inUnit("rad/s", v[`omega_${k}`]));
    byId(`alpha_${k}`).textContent = text(inUnit("rad/s^2", v[`alpha_${k}`]));
  }
  byId("condition").textContent = text(v.condition);
  const across = v.theta_3 === undefined || v.theta_3 === null ? null : Math.atan2(Math.abs(Math.sin(v.theta_4 - v.theta_3)), Math.abs(Math.cos(v.theta_4 - v.theta_3)));
  byId("mu").textContent = degrees(across);
  byId("torque").textContent = ranged(v, "torque", value => text(inUnit("N m", value)));
  byId("drive_force").textContent = ranged(v, "drive_force", value => text(inUnit("N", value)));
  byId("stroke").textContent = text(v.stroke * unit.factor);
  byId("torque-error").textContent = Number.isFinite(v.torque_error) ? `give or take ${text(inUnit("N m", v.torque_error), 2)}` : "";
  byId("energy").textContent = text(inUnit("J", v.energy));
  if (dynamic()) {
    for (const name of FORCES) {
      const f = v[name].map(component => inUnit("N", component)), known = f[0] !== null;
      byId(`${name}_x`).textContent = text(f[0]);
      byId(`${name}_y`).textContent = text(f[1]);
      byId(`${name}_size`).textContent = text(known ? Math.hypot(f[0], f[1]) : null);
      byId(`${name}_angle`).textContent = known ? fixed(Math.atan2(f[1], f[0]) * DEG, 2) : "\u2013";
    }
  }
  const assembled = at(i) !== null, singular = v.status === "singular";
  const status = byId("status");
  status.textContent = !assembled ? "The linkage does not assemble at this position." : singular ? single() && !timed() ? "What is commanded decides no velocities here: they have no value." : "Coupler and output are in line: velocities have no value here." : REASONS[v.status] || (leavesRange(v) ? "At rest dry friction leaves the drive the range shown; pin forces and curves take it as 0." : "");
  status.hidden = status.textContent === "";
  byId("theta").value = i;
  const over = axis(), written = fixed(over.values[i] * over.factor, timed() ? clock : 2), spoken = { " s": " seconds", "\u00b0": " degrees" }[over.sign] ?? over.sign;
  const here = `${fixed(grid[i] * DEG, 2)}\u00b0`;
  byId("theta-text").textContent = written + over.sign;
  byId("theta").setAttribute("aria-valuetext", written + spoken);
  if (!playing) {
    let words = assembled ? `Theta 2 ${here}, theta 3 ${degrees(v.theta_3)}, theta 4 ${degrees(v.theta_4)} degrees` : grid[i] === null ? "does not assemble" : `Theta 2 ${here}: does not assemble`;
    if (over.name !== "theta_2") words = `${over.name === "time" ? "At" : AXES[over.name].join(" ")} ${written}${spoken}: ` + words;
    if (v.torque !== undefined && v.torque !== null) words += `, torque ${ranged(v, "torque", value => text(inUnit("N m", value), 4))} ${nameOf("N m")}`;
    byId("live").textContent = words;
    byId("picture-text").textContent = `Four-bar linkage, ${branch === 1 ? "open" : "crossed"} branch. ${words}`;
  }
}

