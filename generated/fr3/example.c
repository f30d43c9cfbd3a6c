/* fr3: joint torques of one state, written by symgen 0.1.0. Compile and run:
 *
 *     cc -O2 example.c kernels.c update.c -lm -o example && ./example
 *
 * Nothing is allocated and nothing is remembered, so the calls may stand in a real-time loop. */
#include <stdio.h>

#include "fr3.h"

enum { JOINTS = 7, PARAMETERS = 70 };

/* The URDF's parameters, link by link: m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ. */
static const double pi[PARAMETERS] = {
    2.9274653454, 1.2084576945811199e-06, -0.05306069698178673, -0.11301069242528741, 0.02925166787021582, 0.026844780555151198, 0.007311830417060032, 1.3339806911428163e-05, -0.00011400109837233368, -0.004043365825648023, /* fr3_link1 */
    2.9355370338, 0.009343480901578358, -0.2181754660283719, 0.025875609396644555, 0.05838230247575947, 0.025402971452380317, 0.07794715682138595, 0.0008970010388462729, 0.0039954251019396324, -0.002302084505129415, /* fr3_link2 */
    2.2449013699, 0.09137100710721884, -0.010820551439845399, -0.06504171214549545, 0.026038040020634413, 0.025343934859831684, 0.02281559346537159, 0.002845107975760805, -0.00020896956136297676, -0.002417717411289898, /* fr3_link3 */
    2.6155955791, -0.12008224544145436, 0.16491145988296732, -0.022281701093375437, 0.04511734772824114, 0.03458442247035871, 0.0571652506355736, 0.02079662369701104, 0.009128474937460109, 0.0004285621805492964, /* fr3_link4 */
    2.3271207594, -0.0037326097768076026, 0.06807672081774772, -0.2264209353519172, 0.07563175635952744, 0.06991327104449913, 0.018421103481725317, -0.005605981016622277, -0.0039304869992647425, 0.017297618515175337, /* fr3_link5 */
    1.8170376524, 0.10850099119805856, -0.07455208567008821, -0.018477951211719645, 0.008659073226306147, 0.020725169803852153, 0.025618583168554476, 0.010645194154713471, 0.002525305087475023, -0.002072215856189684, /* fr3_link6 */
    0.6271432862, 0.0028363067494459808, 0.005409858460986475, -0.010136720819132935, 0.00042143348386691065, 0.00035385622307232943, 0.00011942581331551022, -4.879951801986689e-05, 9.148895201240942e-05, 0.00017488200328217435, /* fr3_link7 */
};

int main(void)
{
    /* A state: positions [rad or m], velocities, accelerations. */
    const double q[JOINTS] = {-1.5707963267948966, -0.7853981633974483, 0.0, -2.356194490192345, 0.0, 1.5707963267948966, 0.7853981633974483};
    const double dq[JOINTS] = {0.5, -0.5, 0.5, -0.5, 0.5, -0.5, 0.5};
    const double ddq[JOINTS] = {2.0, -2.0, 2.0, -2.0, 2.0, -2.0, 2.0};

    /* The torques that this motion takes, [N m] or [N]. */
    double tau[JOINTS];
    fr3_inverse_dynamics(q, dq, ddq, pi, tau);

    /* tau = Y pi: a column of Y says what a parameter costs, here the mass of the last link. */
    double Y[JOINTS * PARAMETERS];
    fr3_regressor(q, dq, ddq, Y);
    for (int i = 0; i < JOINTS; ++i) {
        printf("tau[%d] = %+.17g, with one kilogram more at the last link's origin %+.17g\n",
               i, tau[i], tau[i] + Y[i * PARAMETERS + PARAMETERS - 10]);
    }

    /* Identification, one sample at a time: the triangle R begins as zeros and takes in every state
     * with its measured torque; R beta = its last column is then the least-squares problem. */
    double factor[FR3_STATISTICS * FR3_STATISTICS] = {0}, weight[JOINTS], explained = 0.0;
    for (int i = 0; i < JOINTS; ++i) {
        weight[i] = 1.0;
    }
    fr3_statistics_update(factor, 1.0, q, dq, ddq, tau, weight);
    for (int i = 0; i < FR3_STATISTICS; ++i) {
        const double r = factor[i * FR3_STATISTICS + FR3_BASE];
        explained += r * r;
    }
    printf("one sample explains %.17g of squared torque\n", explained);
    return 0;
}
