/* ur5e: joint torques of one state, written by symgen 0.1.0. Compile and run:
 *
 *     cc -O2 example.c kernels.c update.c -lm -o example && ./example
 *
 * Nothing is allocated and nothing is remembered, so the calls may stand in a real-time loop. */
#include <stdio.h>

#include "ur5e.h"

enum { JOINTS = 6, PARAMETERS = 60 };

/* The URDF's parameters, link by link: m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ. */
static const double pi[PARAMETERS] = {
    3.761, 0.0, -0.0072587300000000006, -0.09631921, 0.009482844317, 0.009039594968100001, 0.0064949193489, 1.053e-05, 7.299999999999977e-07, -0.0006858360753000001, /* shoulder_link */
    8.058, -1.7123249999999999, 0.0, 0.91345488, 0.11860809519680002, 0.8012991676968, 0.6963411325, -5.4e-05, 0.194114792, -1.81e-06, /* upper_arm_link */
    2.846, -0.6893012000000001, 0.0, 0.075419, 0.005994923499999997, 0.24773989414, 0.24543385064, -1.365e-05, 0.019639201800000002, -6.6e-06, /* forearm_link */
    1.37, 0.0, -0.0223858, -0.0024660000000000003, 0.002025132772, 0.0012672287999999999, 0.001725403972, 4.3799999999999996e-06, -2.820000000000001e-06, -0.00014186443999999999, /* wrist_1_link */
    1.3, 0.0, 0.021242, -0.00234, 0.00170747628, 0.000970352, 0.00162536428, 4.439999999999999e-06, 2.740000000000001e-06, 8.871559999999993e-05, /* wrist_2_link */
    0.365, 0.0, 0.0, -0.0004230349999999997, 0.000187430297565, 0.000189570297565, 0.00025756, 6e-08, -1.7e-07, -9.2e-07, /* wrist_3_link */
};

int main(void)
{
    /* A state: positions [rad or m], velocities, accelerations. */
    const double q[JOINTS] = {0.0, -1.5707963267948966, 1.5707963267948966, -1.5707963267948966, -1.5707963267948966, 0.0};
    const double dq[JOINTS] = {0.5, -0.5, 0.5, -0.5, 0.5, -0.5};
    const double ddq[JOINTS] = {2.0, -2.0, 2.0, -2.0, 2.0, -2.0};

    /* The torques that this motion takes, [N m] or [N]. */
    double tau[JOINTS];
    ur5e_inverse_dynamics(q, dq, ddq, pi, tau);

    /* tau = Y pi: a column of Y says what a parameter costs, here the mass of the last link. */
    double Y[JOINTS * PARAMETERS];
    ur5e_regressor(q, dq, ddq, Y);
    for (int i = 0; i < JOINTS; ++i) {
        printf("tau[%d] = %+.17g, with one kilogram more at the last link's origin %+.17g\n",
               i, tau[i], tau[i] + Y[i * PARAMETERS + PARAMETERS - 10]);
    }

    /* Identification, one sample at a time: the triangle R begins as zeros and takes in every state
     * with its measured torque; R beta = its last column is then the least-squares problem. */
    double factor[UR5E_STATISTICS * UR5E_STATISTICS] = {0}, weight[JOINTS], explained = 0.0;
    for (int i = 0; i < JOINTS; ++i) {
        weight[i] = 1.0;
    }
    ur5e_statistics_update(factor, 1.0, q, dq, ddq, tau, weight);
    for (int i = 0; i < UR5E_STATISTICS; ++i) {
        const double r = factor[i * UR5E_STATISTICS + UR5E_BASE];
        explained += r * r;
    }
    printf("one sample explains %.17g of squared torque\n", explained);
    return 0;
}
