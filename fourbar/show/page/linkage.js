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
