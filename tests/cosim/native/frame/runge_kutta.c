#include <math.h>

#include "unit.h"

void runge_kutta(Unit *unit, Acceleration a, double h, double *x, double *v) {
    int n = (int)fmax(1, ceil(h / 1e-3 - 1e-6));
    double dt = h / n;
    for (int i = 0; i < n; i++) {
        double s = i * dt, v1 = *v, a1 = a(unit, s, *x, v1);
        double v2 = *v + dt / 2 * a1, a2 = a(unit, s + dt / 2, *x + dt / 2 * v1, v2);
        double v3 = *v + dt / 2 * a2, a3 = a(unit, s + dt / 2, *x + dt / 2 * v2, v3);
        double v4 = *v + dt * a3, a4 = a(unit, s + dt, *x + dt * v3, v4);
        *x += dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
        *v += dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
}
