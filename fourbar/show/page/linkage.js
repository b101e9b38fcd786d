"use strict";
// The loop closure of the planar four-bar, as in fourbar: Heron's factors of the triangle A, B, O4.
// lengths = [d, a, b, c]: ground, input, coupler, output; sigma = +1 open, -1 crossed; angles in rad.
function closeLoop(lengths, theta1, theta2, sigma) {
  const [d, a, b, c] = lengths;
  const sine = Math.sin(0.5 * (theta2 - theta1)), cosine = Math.cos(0.5 * (theta2 - theta1));
  const x = d - a + 2 * a * sine * sine, y = -2 * a * sine * cosine;  // A to O4, in the ground's frame
  const e = Math.hypot(x, y);
  let p1 = b + c - e, p2 = e + c - b, p3 = e + b - c;
  const p4 = e + b + c, rounding = -4 * Number.EPSILON * (a + b + c + d);
  if (!(p1 >= rounding && p2 >= rounding && p3 >= rounding) || e === 0) return null;
  p1 = Math.max(p1, 0); p2 = Math.max(p2, 0); p3 = Math.max(p3, 0);
  const area = sigma * Math.sqrt(p1 * p2) * Math.sqrt(p3 * p4);
  const phi = theta1 + Math.atan2(y, x);
  const theta3 = phi + Math.atan2(2 * area, p3 * p4 - p1 * p2);
  const theta4 = phi + Math.PI - Math.atan2(2 * area, p2 * p4 - p1 * p3);
  const O4 = [d * Math.cos(theta1), d * Math.sin(theta1)];
  return {
    theta2, theta3, theta4, sigma,
    sinMu: area / (2 * b * c),
    O2: [0, 0], O4,
    A: [a * Math.cos(theta2), a * Math.sin(theta2)],
    B: [O4[0] + c * Math.cos(theta4), O4[1] + c * Math.sin(theta4)],
  };
}

// Angular velocities and accelerations of coupler and output (the differentiated loop), rad/s and rad/s^2.
function rates(lengths, at, omega2, alpha2) {
  const [, a, b, c] = lengths, s = at.sinMu;
  const s42 = Math.sin(at.theta4 - at.theta2), s32 = Math.sin(at.theta3 - at.theta2);
  const omega3 = -a * omega2 * s42 / (b * s), omega4 = -a * omega2 * s32 / (c * s);
  const cosMu = Math.cos(at.theta4 - at.theta3), inner = b * omega3 * omega3, outer = c * omega4 * omega4;
  const term4 = a * (omega2 * omega2 * Math.cos(at.theta4 - at.theta2) - alpha2 * s42);
  const term3 = a * (omega2 * omega2 * Math.cos(at.theta3 - at.theta2) - alpha2 * s32);
  return {
    omega3, omega4,
    alpha3: (term4 + inner * cosMu - outer) / (b * s),
    alpha4: (term3 + inner - outer * cosMu) / (c * s),
  };
}

// Intervals of theta2 - theta1 in which the loop closes; an input that turns fully has one, of 2 pi.
function closingIntervals(lengths) {
  const [d, a, b, c] = lengths;
  const cosineAt = e => (a * a + d * d - e * e) / (2 * a * d);
  const low = cosineAt(b + c), high = cosineAt(Math.abs(b - c));
  if (low > 1 || high < -1) return [];
  const inner = high < 1 ? Math.acos(high) : 0, outer = low > -1 ? Math.acos(low) : Math.PI;
  if (inner === 0 && outer === Math.PI) return [[0, 2 * Math.PI]];
  if (inner === 0) return [[-outer, outer]];
  if (outer === Math.PI) return [[inner, 2 * Math.PI - inner]];
  return [[inner, outer], [-outer, -inner]];
}

// What the linkage is called, as fourbar.classify names it: the sums are exact, equality within the rounding of the lengths.
const BAR_NAMES = { 1: "ground", 2: "input", 3: "coupler", 4: "output" };
const GRASHOF = { 1: "double crank (drag link)", 2: "crank-rocker", 3: "double rocker", 4: "rocker-crank" };
function typeName(lengths) {
  const sum = terms => {
    let total = 0, rest = 0;
    for (const term of terms) {
      const next = total + term;
      rest += Math.abs(total) >= Math.abs(term) ? (total - next) + term : (term - next) + total;
      total = next;
    }
    return total + rest;
  };
  const whole = sum(lengths), least = 0.5 * Number.EPSILON * whole;
  const balance = (bar, other) => {
    const total = sum(lengths.map((length, k) => k + 1 === bar || k + 1 === other ? length : -length));
    return Math.abs(total) <= least ? 0 : total;
  };
  const shortest = lengths.indexOf(Math.min(...lengths)) + 1, longest = lengths.indexOf(Math.max(...lengths)) + 1;
  if (sum([...lengths, -2 * lengths[longest - 1]]) <= least) return `structure (the ${BAR_NAMES[longest]} is as long as the other three)`;
  const surplus = -balance(shortest, longest !== shortest ? longest : 4);
  if (surplus > 0) return GRASHOF[shortest];
  if (surplus < 0) return `triple rocker (longest: ${BAR_NAMES[longest]})`;
  const opposite = balance(1, 3) === 0, withInput = balance(1, 2) === 0, withOutput = balance(1, 4) === 0;
  if (opposite && withInput && withOutput) return "rhombus (triple change point)";
  if (opposite + withInput + withOutput === 2) {
    if (!opposite) return "parallelogram (crossed: antiparallelogram)";
    return `kite (equal: ${withOutput ? "ground and input; coupler and output" : "ground and output; input and coupler"})`;
  }
  return `change-point ${GRASHOF[shortest]}`;
}
