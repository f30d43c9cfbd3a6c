/* fr3: identification in a control loop, written by symgen 0.1.0. Compile and run:
 *
 *     cc -O2 -DLEVEL=portable -DW=1 example_online.c online.c kernels.c update.c convex.c tiles.c -lm -o online && ./online
 *
 * -DLEVEL=v3 -DW=4 -march=x86-64-v3 is the same for AVX2. The state is large, so it does not lie on the
 * stack; one state serves one thread. */
#include <math.h>
#include <stdio.h>

#include "fr3.h"

enum { JOINTS = 7, PARAMETERS = 70, SAMPLES = 2000, EVERY = 100 };

#define JOIN(a, b, c) a##_##b##_##c
#define LEVEL_FUNCTION(robot, level, name) JOIN(robot, level, name)
#define CONVEX LEVEL_FUNCTION(fr3, LEVEL, convex)

void CONVEX(fr3_convex_job *jobs, long count);

/* The first guess, the URDF's, link by link: m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ. */
static const double guess[PARAMETERS] = {
    2.9274653454, 1.2084576945811199e-06, -0.05306069698178673, -0.11301069242528741, 0.02925166787021582, 0.026844780555151198, 0.007311830417060032, 1.3339806911428163e-05, -0.00011400109837233368, -0.004043365825648023, /* fr3_link1 */
    2.9355370338, 0.009343480901578358, -0.2181754660283719, 0.025875609396644555, 0.05838230247575947, 0.025402971452380317, 0.07794715682138595, 0.0008970010388462729, 0.0039954251019396324, -0.002302084505129415, /* fr3_link2 */
    2.2449013699, 0.09137100710721884, -0.010820551439845399, -0.06504171214549545, 0.026038040020634413, 0.025343934859831684, 0.02281559346537159, 0.002845107975760805, -0.00020896956136297676, -0.002417717411289898, /* fr3_link3 */
    2.6155955791, -0.12008224544145436, 0.16491145988296732, -0.022281701093375437, 0.04511734772824114, 0.03458442247035871, 0.0571652506355736, 0.02079662369701104, 0.009128474937460109, 0.0004285621805492964, /* fr3_link4 */
    2.3271207594, -0.0037326097768076026, 0.06807672081774772, -0.2264209353519172, 0.07563175635952744, 0.06991327104449913, 0.018421103481725317, -0.005605981016622277, -0.0039304869992647425, 0.017297618515175337, /* fr3_link5 */
    1.8170376524, 0.10850099119805856, -0.07455208567008821, -0.018477951211719645, 0.008659073226306147, 0.020725169803852153, 0.025618583168554476, 0.010645194154713471, 0.002525305087475023, -0.002072215856189684, /* fr3_link6 */
    0.6271432862, 0.0028363067494459808, 0.005409858460986475, -0.010136720819132935, 0.00042143348386691065, 0.00035385622307232943, 0.00011942581331551022, -4.879951801986689e-05, 9.148895201240942e-05, 0.00017488200328217435, /* fr3_link7 */
};

static fr3_online state;

int main(void)
{
    const double home[JOINTS] = {-1.5707963267948966, -0.7853981633974483, 0.0, -2.356194490192345, 0.0, 1.5707963267948966, 0.7853981633974483};
    double truth[PARAMETERS], weight[JOINTS];
    for (int i = 0; i < PARAMETERS; ++i) {
        truth[i] = 1.1 * guess[i]; /* a robot that is a tenth heavier than the guess */
    }
    for (int j = 0; j < JOINTS; ++j) {
        weight[j] = 1.0;
    }
    if (!fr3_online_start(&state, guess, 1.0, 1.0)) {
        printf("the first guess holds a body that cannot exist\n");
        return 1;
    }
    for (int i = 1; i <= SAMPLES; ++i) {
        /* In a loop of one's own: what the robot measured in this millisecond. */
        double q[JOINTS], dq[JOINTS], ddq[JOINTS], tau[JOINTS];
        for (int j = 0; j < JOINTS; ++j) {
            const double turn = 0.7 + 0.45 * j, phase = turn * (0.005 * i) + j;
            q[j] = home[j] + 0.4 * sin(phase);
            dq[j] = 0.4 * turn * cos(phase);
            ddq[j] = -0.4 * turn * turn * sin(phase);
        }
        fr3_inverse_dynamics(q, dq, ddq, truth, tau);
        for (int j = 0; j < JOINTS; ++j) {
            tau[j] += 0.02 * sin(77.0 * i + 5.0 * j); /* what sensors add */
        }
        fr3_online_sample(&state, q, dq, ddq, tau, weight);
        if (i % EVERY == 0 && !fr3_online_solve(&state, CONVEX, 50)) {
            printf("sample %d: not solved\n", i);
        }
    }
    double found[JOINTS], wanted[JOINTS], still[JOINTS] = {0}, worst = 0.0;
    fr3_inverse_dynamics(home, still, still, state.pi, found);
    fr3_inverse_dynamics(home, still, still, truth, wanted);
    for (int j = 0; j < JOINTS; ++j) {
        worst = fmax(worst, fabs(found[j] - wanted[j]));
    }
    printf("after %d samples the holding torque is right to %.17g\n", SAMPLES, worst);
    return 0;
}
