/* ur5e: identification in a control loop, written by symgen 0.1.0. Compile and run:
 *
 *     cc -O2 -DLEVEL=portable -DW=1 example_online.c online.c kernels.c update.c convex.c tiles.c -lm -o online && ./online
 *
 * -DLEVEL=v3 -DW=4 -march=x86-64-v3 is the same for AVX2. The state is large, so it does not lie on the
 * stack; one state serves one thread. */
#include <math.h>
#include <stdio.h>

#include "ur5e.h"

enum { JOINTS = 6, PARAMETERS = 60, SAMPLES = 2000, EVERY = 100 };

#define JOIN(a, b, c) a##_##b##_##c
#define LEVEL_FUNCTION(robot, level, name) JOIN(robot, level, name)
#define CONVEX LEVEL_FUNCTION(ur5e, LEVEL, convex)

void CONVEX(ur5e_convex_job *jobs, long count);

/* The first guess, the URDF's, link by link: m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ. */
static const double guess[PARAMETERS] = {
    3.761, 0.0, -0.0072587300000000006, -0.09631921, 0.009482844317, 0.009039594968100001, 0.0064949193489, 1.053e-05, 7.299999999999977e-07, -0.0006858360753000001, /* shoulder_link */
    8.058, -1.7123249999999999, 0.0, 0.91345488, 0.11860809519680002, 0.8012991676968, 0.6963411325, -5.4e-05, 0.194114792, -1.81e-06, /* upper_arm_link */
    2.846, -0.6893012000000001, 0.0, 0.075419, 0.005994923499999997, 0.24773989414, 0.24543385064, -1.365e-05, 0.019639201800000002, -6.6e-06, /* forearm_link */
    1.37, 0.0, -0.0223858, -0.0024660000000000003, 0.002025132772, 0.0012672287999999999, 0.001725403972, 4.3799999999999996e-06, -2.820000000000001e-06, -0.00014186443999999999, /* wrist_1_link */
    1.3, 0.0, 0.021242, -0.00234, 0.00170747628, 0.000970352, 0.00162536428, 4.439999999999999e-06, 2.740000000000001e-06, 8.871559999999993e-05, /* wrist_2_link */
    0.365, 0.0, 0.0, -0.0004230349999999997, 0.000187430297565, 0.000189570297565, 0.00025756, 6e-08, -1.7e-07, -9.2e-07, /* wrist_3_link */
};

static ur5e_online state;

int main(void)
{
    const double home[JOINTS] = {0.0, -1.5707963267948966, 1.5707963267948966, -1.5707963267948966, -1.5707963267948966, 0.0};
    double truth[PARAMETERS], weight[JOINTS];
    for (int i = 0; i < PARAMETERS; ++i) {
        truth[i] = 1.1 * guess[i]; /* a robot that is a tenth heavier than the guess */
    }
    for (int j = 0; j < JOINTS; ++j) {
        weight[j] = 1.0;
    }
    if (!ur5e_online_start(&state, guess, 1.0, 1.0)) {
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
        ur5e_inverse_dynamics(q, dq, ddq, truth, tau);
        for (int j = 0; j < JOINTS; ++j) {
            tau[j] += 0.02 * sin(77.0 * i + 5.0 * j); /* what sensors add */
        }
        ur5e_online_sample(&state, q, dq, ddq, tau, weight);
        if (i % EVERY == 0 && !ur5e_online_solve(&state, CONVEX, 50)) {
            printf("sample %d: not solved\n", i);
        }
    }
    double found[JOINTS], wanted[JOINTS], still[JOINTS] = {0}, worst = 0.0;
    ur5e_inverse_dynamics(home, still, still, state.pi, found);
    ur5e_inverse_dynamics(home, still, still, truth, wanted);
    for (int j = 0; j < JOINTS; ++j) {
        worst = fmax(worst, fabs(found[j] - wanted[j]));
    }
    printf("after %d samples the holding torque is right to %.17g\n", SAMPLES, worst);
    return 0;
}
