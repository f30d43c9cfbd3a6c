// Loop of the virtual robot: runtime/simulation/virtual_robot.py, joint_friction.py, sensors.py.
#include <math.h>
#include <mujoco/mujoco.h>

#define MOST 32
#define ASTRAY 0.5

// Rows of `joint`, each of n numbers.
enum { EFFORT, STIFFNESS, DAMPING, GAIN, ROTOR, FORWARD, BACKWARD, PEAK, SHARPNESS, VISCOUS, LOAD,
       RIPPLE, WAVES, PHASE, BEND, QUANTUM, KEEP, SHARE };

static double clip(double x, double most) { return x > most ? most : x < -most ? -most : x; }

// Number of ticks until the robot left its reference, or count.
__attribute__((visibility("default")))
int run(mjModel* m, mjData* d, const mjModel* mb, mjData* db, int count, int n, int substeps,
        int delay, int computed, const double* reference, const double* jitter,
        const double* joint, double* log, double* clipped)
{
    const double h = m->opt.timestep;
    const long size = (long)count * n;
    const double *q_d = reference, *dq_d = reference + size, *ddq_d = reference + 2 * size;
    double z[MOST] = {0}, link[MOST] = {0}, speed[MOST], last[MOST], before[MOST];
#define OF(row) joint[(row) * n + j]
#define COMMAND(i) (commands + (long)(i) * n)
    double* commands = mju_malloc(sizeof(double) * size);
    int k;
    for (int j = 0; j < n; ++j) {
        d->qpos[j] = q_d[j];
        d->qvel[j] = dq_d[j];
    }
    for (k = 0; k < count; ++k) {
        const long at = (long)k * n;
        double *seen_q = log + at, *seen_dq = log + size + at;
        for (int j = 0; j < n; ++j) {
            const double raw = d->qpos[j] + jitter[at + j], quantum = OF(QUANTUM);
            seen_q[j] = quantum > 0 ? rint(raw * (1 / quantum)) * quantum : raw;
            speed[j] = k ? OF(KEEP) * speed[j] + OF(SHARE) * (seen_q[j] - last[j]) : d->qvel[j];
            last[j] = seen_q[j];
            seen_dq[j] = speed[j];
            log[2 * size + at + j] = d->qpos[j];
            log[3 * size + at + j] = d->qvel[j];
        }
        for (int j = 0; j < n; ++j) {
            const double correction =
                OF(DAMPING) * (dq_d[at + j] - seen_dq[j]) + OF(STIFFNESS) * (q_d[at + j] - seen_q[j]);
            db->qpos[j] = computed ? seen_q[j] : q_d[at + j];
            db->qvel[j] = computed ? seen_dq[j] : dq_d[at + j];
            db->qacc[j] = ddq_d[at + j] + (computed ? correction : 0);
            before[j] = computed ? 0 : OF(GAIN) * correction;
        }
        mj_inverse(mb, db);
        for (int j = 0; j < n; ++j) {
            const double wished = db->qfrc_inverse[j] + before[j];
            commands[at + j] = clip(wished, OF(EFFORT));
            clipped[j] += commands[at + j] != wished;
        }
        for (int i = 0; i < substeps; ++i) {
            const long late = (long)k * substeps + i - delay;
            const double* tau = COMMAND(late > 0 ? late / substeps : 0);
            for (int j = 0; j < n; ++j) {
                const double dq = d->qvel[j], travel = OF(BEND) * dq, way = 1 + fabs(travel);
                z[j] = (z[j] + travel) / way;
                const double level = (dq > 0 ? OF(FORWARD) : OF(BACKWARD))
                    + OF(PEAK) * exp(OF(SHARPNESS) * dq * dq) + OF(LOAD) * fabs(link[j]);
                const double slope = OF(VISCOUS) + level * OF(BEND) * (1 - fabs(z[j])) / way;
                const double f = level * z[j] + OF(VISCOUS) * dq
                    + OF(RIPPLE) * sin(OF(WAVES) * d->qpos[j] + OF(PHASE));
                m->dof_damping[j] = slope;
                d->qfrc_applied[j] = tau[j] - f + slope * dq;
                before[j] = dq;
            }
            mj_step(m, d);
            if (i == 0)
                for (int j = 0; j < n; ++j) {
                    const double ddq = (d->qvel[j] - before[j]) / h;
                    log[4 * size + at + j] = ddq;
                    log[5 * size + at + j] = tau[j];
                    log[6 * size + at + j] = tau[j] - OF(ROTOR) * ddq;
                }
        }
        int lost = 0;
        for (int j = 0; j < n; ++j) {
            link[j] = log[6 * size + at + j];
            lost |= !(fabs(d->qpos[j] - q_d[at + j]) < ASTRAY);
        }
        if (lost) break;
    }
    mju_free(commands);
    return k;
}
