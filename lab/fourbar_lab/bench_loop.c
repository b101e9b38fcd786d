/* The crank-rocker of timed.py, position to pin forces, as a plain loop: what the others are compared with. */
#include <math.h>

void loop(long n, const double *restrict theta_2, double *restrict out) {
  const double d = 0.3, a = 0.1, b = 0.25, c = 0.22, w2 = 10.0, g = -9.81;
  const double m2 = 0.2, m3 = 0.5, m4 = 0.4, r2 = a / 2, r3 = b / 2, r4 = c / 2;
  const double J3 = m3 * b * b / 3, J4 = m4 * c * c / 3;
#pragma GCC ivdep
  for (long i = 0; i < n; i++) {
    const double c2 = cos(theta_2[i]), s2 = sin(theta_2[i]);
    const double x = d - a * c2, y = -a * s2, e2 = x * x + y * y;
    const double at_A = e2 + b * b - c * c, at_O4 = e2 - b * b + c * c;
    const double root = sqrt(4 * b * b * e2 - at_A * at_A), k3 = 0.5 / (b * e2), k4 = 0.5 / (c * e2);
    const double c3 = k3 * (x * at_A - y * root), s3 = k3 * (y * at_A + x * root);
    const double c4 = -k4 * (x * at_O4 + y * root), s4 = k4 * (x * root - y * at_O4);
    const double s = c3 * s4 - s3 * c4, cs = c3 * c4 + s3 * s4;
    const double w3 = -a * w2 * (c2 * s4 - s2 * c4) / (b * s), w4 = -a * w2 * (c2 * s3 - s2 * c3) / (c * s);
    const double p = b * w3 * w3, q = c * w4 * w4, f = a * w2 * w2;
    const double al3 = (f * (c2 * c4 + s2 * s4) + p * cs - q) / (b * s);
    const double al4 = (f * (c2 * c3 + s2 * s3) + p - q * cs) / (c * s);
    const double ax = -f * c2, ay = -f * s2;
    const double R2x = m2 * r2 * w2 * w2 * c2, R2y = m2 * r2 * w2 * w2 * s2 + m2 * g;
    const double R3x = -m3 * (ax - r3 * (w3 * w3 * c3 + al3 * s3));
    const double R3y = -m3 * (ay - r3 * (w3 * w3 * s3 - al3 * c3)) + m3 * g;
    const double R4x = m4 * r4 * (w4 * w4 * c4 + al4 * s4), R4y = m4 * r4 * (w4 * w4 * s4 - al4 * c4) + m4 * g;
    const double M2 = m2 * g * r2 * c2;
    const double M3 = -J3 * al3 - m3 * r3 * (c3 * ay - s3 * ax) + m3 * g * r3 * c3;
    const double M4 = -J4 * al4 + m4 * g * r4 * c4;
    const double u = -M3 / (b * s), v = M4 / (c * s);
    const double F43x = u * c4 - v * c3, F43y = u * s4 - v * s3, F32x = R3x + F43x, F32y = R3y + F43y;
    out[i] = atan2(s3, c3);
    out[n + i] = atan2(s4, c4);
    out[2 * n + i] = w3;
    out[3 * n + i] = w4;
    out[4 * n + i] = al3;
    out[5 * n + i] = al4;
    out[6 * n + i] = -R2x - F32x;
    out[7 * n + i] = -R2y - F32y;
    out[8 * n + i] = F32x;
    out[9 * n + i] = F32y;
    out[10 * n + i] = F43x;
    out[11 * n + i] = F43y;
    out[12 * n + i] = F43x - R4x;
    out[13 * n + i] = F43y - R4y;
    out[14 * n + i] = -(M2 + a * (c2 * F32y - s2 * F32x));
  }
}
