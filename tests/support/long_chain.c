/* One open chain from rest under a sudden drive, by Taylor series, in numbers with 34 digits.

       z_1'' + delta z_1' + z_1 + beta z_1^3 = epsilon cos(omega tau)
       z_m'' + delta z_m' + z_m + beta z_m^3 = lam (z_{m-1} - z_m)

   long_chain n delta beta epsilon lam omega periods: prints how it ended, the period, and the real and imaginary part
   of every first harmonic. It is settled when no oscillator changes over a period by more than 1e-10 of its own size,
   ten periods in turn. -DREAL="long double" is faster and has 19 digits. It shares nothing with chainsim. */

#include <stdio.h>
#include <stdlib.h>

#ifndef REAL
#define REAL _Float128
#endif
#define ORDER 16
#define STEPS 16
#define MOST 64
#define SETTLED 1e-10
#define GONE 50

typedef REAL real;

static int n;
static real delta, beta, epsilon, lam, omega;
static real z[MOST], v[MOST], cosine[STEPS], sine[STEPS];

/* z and v after a step of length h that begins at phase s of the drive. */
static void step(int s, real h) {
  real series[2][ORDER + 2], square[ORDER], force[ORDER], power = 1;
  for (int k = 0; k < ORDER; k++) {
    real turned = k & 1 ? -sine[s] : cosine[s];
    force[k] = epsilon * power * (k & 2 ? -turned : turned);
    power *= omega / (k + 1);
  }
  for (int m = 0; m < n; m++) {
    real *x = series[m & 1], *before = series[(m + 1) & 1], spring = 1 + (m ? lam : 0);
    x[0] = z[m], x[1] = v[m];
    for (int k = 0; k < ORDER; k++) {
      real twice = 0, cube = 0;
      for (int j = 0; 2 * j < k; j++) twice += x[j] * x[k - j];
      square[k] = 2 * twice + (k & 1 ? 0 : x[k / 2] * x[k / 2]);
      for (int j = 0; j <= k; j++) cube += square[j] * x[k - j];
      real push = m ? lam * before[k] : force[k];
      x[k + 2] = (push - delta * (k + 1) * x[k + 1] - spring * x[k] - beta * cube) / ((k + 1) * (k + 2));
    }
    real place = 0, speed = 0;
    for (int k = ORDER + 1; k > 0; k--) place = (place + x[k]) * h, speed = speed * h + k * x[k];
    z[m] = place + x[0], v[m] = speed;
  }
}

/* cos and sin of the STEPS phases: of the first by their series, then by turning. */
static void phases(real turn) {
  real c = 0, s = 0, term = 1;
  for (int k = 0; k < 40; k++) {
    if (k & 1) s += k & 2 ? -term : term;
    else c += k & 2 ? -term : term;
    term *= turn / STEPS / (k + 1);
  }
  cosine[0] = 1, sine[0] = 0;
  for (int k = 1; k < STEPS; k++) {
    cosine[k] = cosine[k - 1] * c - sine[k - 1] * s;
    sine[k] = sine[k - 1] * c + cosine[k - 1] * s;
  }
}

int main(int count, char **given) {
  if (count != 8) return 2;
  n = atoi(given[1]);
  delta = strtod(given[2], 0), beta = strtod(given[3], 0), epsilon = strtod(given[4], 0);
  lam = strtod(given[5], 0), omega = strtod(given[6], 0);
  long most = atol(given[7]), period = 0;
  if (n < 1 || n > MOST) return 2;
  /* The rounding of 2 pi to a long double makes the drive slower by 1e-20 of omega. */
  const real turn = 6.283185307179586476925286766559L;
  const char *end = "not_locked";
  real re[MOST], im[MOST], z0[MOST], v0[MOST];
  phases(turn);
  for (int calm = 0; period < most && calm < 10; period++) {
    int moved = 0;
    for (int m = 0; m < n; m++) z0[m] = z[m], v0[m] = v[m], re[m] = im[m] = 0;
    for (int s = 0; s < STEPS; s++) {
      for (int m = 0; m < n; m++) re[m] += z[m] * cosine[s] * 2 / STEPS, im[m] -= z[m] * sine[s] * 2 / STEPS;
      step(s, turn / omega / STEPS);
      for (int m = 0; m < n; m++)
        if (!(z[m] * z[m] < GONE * GONE)) return printf("escaped %ld\n", period), 0;
    }
    for (int m = 0; m < n; m++) {
      real dz = z[m] - z0[m], dv = v[m] - v0[m], size = z[m] * z[m] + v[m] * v[m];
      moved |= !(dz * dz + dv * dv < (real)SETTLED * SETTLED * size);
    }
    calm = moved ? 0 : calm + 1;
    if (calm == 10) end = "ok";
  }
  printf("%s %ld", end, period);
  for (int m = 0; m < n; m++) printf(" %.17Lg %.17Lg", (long double)re[m], (long double)im[m]);
  printf("\n");
  return 0;
}
