/* The LuGre law as it is usually written in C: explicit Euler on the bristle's deflection, newlib's
   expf, built with -O3 -ffast-math. It is what the core's instruction counts are held against, not
   a law to use: this step diverges once sigma0 |v| dt / g > 2 (38 rpm at 10 kHz for a stiff seal).

   Both functions read their parameters from memory and keep one state, as the core's do. */
#include <math.h>

struct lugre {
    float coulomb, excess, inverse_stribeck;    /* F_C, F_S - F_C, 1/v_s */
    float sigma0, sigma1, sigma2, period;
    float force_coulomb, pressure_coulomb, eta3_per_period;
};

/* Ding et al., eq. 1. */
float lugre_step(const struct lugre *p, float *z, float v)
{
    float u = v * p->inverse_stribeck;
    float g = p->coulomb + p->excess * expf(-u * u);
    float rate = v - p->sigma0 * fabsf(v) * *z / g;
    *z += rate * p->period;
    return p->sigma0 * *z + p->sigma1 * rate + p->sigma2 * v;
}

struct sample {
    float velocity, force, force_change, pressure;
};

/* Ding et al., eq. 16: side load and pressure on the Coulomb level, the changing side load on the bristle. */
float improved_lugre_step(const struct lugre *p, float *z, const struct sample *sample)
{
    float v = sample->velocity;
    float u = v * p->inverse_stribeck;
    float coulomb = p->coulomb + p->force_coulomb * sample->force + p->pressure_coulomb * sample->pressure;
    float g = coulomb + p->excess * expf(-u * u);
    float rate = v - p->sigma0 * fabsf(v) * *z / g + p->eta3_per_period * sample->force_change;
    *z += rate * p->period;
    return p->sigma0 * *z + p->sigma1 * rate + p->sigma2 * v;
}
