/* Subroutines of the tests. Components are xx, yy, zz, xy, xz, yz, matrices by columns. */
#include <math.h>
#include <string.h>

#include "arguments.h"

static void stiffness(const double *props, double *c) {
    double mu = props[0] / (2 * (1 + props[1])), lame = 2 * mu * props[1] / (1 - 2 * props[1]);
    memset(c, 0, 36 * sizeof *c);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) c[6 * j + i] = lame + (i == j ? 2 * mu : 0);
        c[6 * (i + 3) + i + 3] = mu;
    }
}

static void add_elastic(const double *c, const double *dstran, double *stress) {
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) stress[i] += c[6 * j + i] * dstran[j];
}

/* PROPS: E, nu. */
void elastic_(UMAT_ARGUMENTS) {
    double before[6];
    memcpy(before, stress, sizeof before);
    stiffness(props, ddsdde);
    add_elastic(ddsdde, dstran, stress);
    for (int i = 0; i < 6; i++) {
        double engineering = 0.5 * (before[i] + stress[i]) * dstran[i];
        *sse += engineering;
    }
    /* with the volume that a stress of Kirchhoff has and a stress of Cauchy has not */
    for (int i = 0; i < 6 && dfgrd1[0] != 1; i++)
        for (int j = 0; j < 3; j++) ddsdde[6 * j + i] += stress[i];
}

/* The same without DDSDDE. */
void elastic_without_tangent_(UMAT_ARGUMENTS) {
    double c[36];
    stiffness(props, c);
    add_elastic(c, dstran, stress);
}

/* PROPS: E, nu, yield stress, hardening modulus. STATEV: equivalent plastic strain. Radial return with the consistent
   tangent of Simo and Hughes (1998), section 3.3. */
void j2_(UMAT_ARGUMENTS) {
    double mu = props[0] / (2 * (1 + props[1])), hardening = props[3];
    stiffness(props, ddsdde);
    add_elastic(ddsdde, dstran, stress);
    double mean = (stress[0] + stress[1] + stress[2]) / 3, s[6], square = 0;
    for (int i = 0; i < 6; i++) {
        s[i] = stress[i] - (i < 3 ? mean : 0);
        square += (i < 3 ? 1 : 2) * s[i] * s[i];
    }
    double q = sqrt(1.5 * square), excess = q - props[2] - hardening * statev[0];
    if (excess <= 0) return;
    double dp = excess / (3 * mu + hardening), left = 1 - 3 * mu * dp / q;
    statev[0] += dp;
    for (int i = 0; i < 6; i++) stress[i] = left * s[i] + (i < 3 ? mean : 0);
    double along = 6 * mu * mu * (dp / q - 1 / (3 * mu + hardening)) * 1.5 / (q * q);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double deviatoric = (i == j ? (i < 3 ? 1 : 0.5) : 0) - (i < 3 && j < 3 ? 1.0 / 3 : 0);
            ddsdde[6 * j + i] += -6 * mu * mu * dp / q * deviatoric + along * s[i] * s[j];
        }
}

/* Puts what it is told into STATEV. */
void echo_(UMAT_ARGUMENTS) {
    double told[] = {time[0],  time[1],   *dtime,   *temp,     *dtemp,     *ndi,       *nshr,      *ntens,
                     *nstatv,  *nprops,   props[1], coords[0], coords[1],  coords[2],  *celent,    *noel,
                     *npt,     *kinc,     *pnewdt,  letters,   cmname[0],  cmname[79], drot[1],    dfgrd0[3],
                     dfgrd1[3], stran[3], dstran[3]};
    memcpy(statev, told, sizeof told);
}

/* Wants a shorter step. */
void impatient_(UMAT_ARGUMENTS) { *pnewdt = 0.5; }

/* STATEV: whether it was called while it ran. */
static volatile int inside;
void alone_(UMAT_ARGUMENTS) {
    inside++;
    for (volatile int i = 0; i < 20000; i++) {}
    if (inside != 1) statev[0] = 1;
    inside--;
}
