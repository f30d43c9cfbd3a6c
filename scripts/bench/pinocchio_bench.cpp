// Pinocchio's recursive algorithms in C++ as peers, compiled by peers.py with the headers of the
// pip wheels into a shared library, so that they run in the same thread as the kernels under test.
//
// The model comes as text, one joint per line: parent, kind, axis (3), placement (3x3 by rows,
// then 3) and the inertia of its body as Pinocchio's ten dynamic parameters; first the gravity (3).
// Python's Pinocchio reads the URDF and writes this text, because reading it here would need
// headers that the wheels do not ship. Joints keep their types (JointModelRZ, ...): what runs is
// what any C++ program runs, without the extern templates of the packaged library.
#include <chrono>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

namespace pin = pinocchio;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;
using Block = Eigen::Matrix<double, 10, 10>;

namespace
{

pin::JointModel joint_model(const std::string &kind, const Eigen::Vector3d &axis)
{
    if (kind == "JointModelRX") return pin::JointModelRX();
    if (kind == "JointModelRY") return pin::JointModelRY();
    if (kind == "JointModelRZ") return pin::JointModelRZ();
    if (kind == "JointModelPX") return pin::JointModelPX();
    if (kind == "JointModelPY") return pin::JointModelPY();
    if (kind == "JointModelPZ") return pin::JointModelPZ();
    if (kind == "JointModelPrismaticUnaligned") return pin::JointModelPrismaticUnaligned(axis);
    return pin::JointModelRevoluteUnaligned(axis);
}

void read_numbers(std::istream &in, double *to, int count)
{
    for (int k = 0; k < count; ++k) in >> to[k];
}

pin::Model read_model(const char *text)
{
    std::istringstream in(text);
    pin::Model model;
    Eigen::Vector3d gravity;
    read_numbers(in, gravity.data(), 3);
    model.gravity.linear() = gravity;
    std::size_t parent;
    std::string kind;
    while (in >> parent >> kind) {
        Eigen::Vector3d axis, offset;
        Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation;
        Eigen::Matrix<double, 10, 1> inertia;
        read_numbers(in, axis.data(), 3);
        read_numbers(in, rotation.data(), 9);
        read_numbers(in, offset.data(), 3);
        read_numbers(in, inertia.data(), 10);
        const auto index = model.addJoint(
            parent, joint_model(kind, axis), pin::SE3(rotation, offset),
            "joint" + std::to_string(model.njoints));
        model.appendBodyToJoint(index, pin::Inertia::FromDynamicParameters(inertia));
    }
    return model;
}

struct Sample
{
    Vector q, dq, ddq, tau;
};

struct Peer
{
    pin::Model model;
    pin::Data data;
    std::vector<Sample> samples;
    std::vector<Block> blocks;  // d pi / d lam of every link; any dense numbers cost the same
    Vector pi, tau;
    Matrix jacobian;

    explicit Peer(const char *text) : model(read_model(text)), data(model)
    {
        blocks.assign(model.nv, Block::Random());
        pi.resize(10 * model.nv);
        for (int k = 0; k < model.nv; ++k) {
            pi.segment<10>(10 * k) = model.inertias[k + 1].toDynamicParameters();
        }
        jacobian.resize(model.nv, 10 * model.nv);
    }

    const Matrix &regressor(const Sample &s)
    {
        return pin::computeJointTorqueRegressor(model, data, s.q, s.dq, s.ddq);
    }
};

// Runs one algorithm over all samples `calls` times; nanoseconds per sample.
template <class Run>
double nanoseconds(const Peer &peer, long calls, Run run)
{
    const auto start = std::chrono::steady_clock::now();
    for (long k = 0; k < calls; ++k) {
        for (const Sample &sample : peer.samples) run(sample);
    }
    const std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - start;
    return took.count() / static_cast<double>(calls * static_cast<long>(peer.samples.size()));
}

void copy(const Matrix &from, double *to)
{
    Eigen::Map<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(to, from.rows(), from.cols()) = from;
}

}  // namespace

#define EXPORT extern "C" __attribute__((visibility("default")))

EXPORT Peer *peer_open(const char *text, long n, const double *q, const double *dq,
                       const double *ddq, const double *tau)
{
    auto peer = std::make_unique<Peer>(text);
    const int nv = peer->model.nv;
    for (long k = 0; k < n; ++k) {
        const auto row = [&](const double *from) {
            return Vector(Eigen::Map<const Vector>(from + k * nv, nv));
        };
        peer->samples.push_back({row(q), row(dq), row(ddq), row(tau)});
    }
    return peer.release();
}

EXPORT void peer_close(Peer *peer)
{
    delete peer;
}

// Nanoseconds per sample; leaves the result of the last sample, row by row, in `result`.
EXPORT double peer_run(Peer *peer, const char *name, long calls, double *result)
{
    const std::string what = name;
    pin::Model &model = peer->model;
    pin::Data &data = peer->data;
    double took = -1.0;
    if (what == "rnea") {
        took = nanoseconds(*peer, calls, [&](const Sample &s) {
            pin::rnea(model, data, s.q, s.dq, s.ddq);
        });
        copy(data.tau, result);
    } else if (what == "computeJointTorqueRegressor") {
        took = nanoseconds(*peer, calls, [&](const Sample &s) { peer->regressor(s); });
        copy(data.jointTorqueRegressor, result);
    } else if (what == "computeJointTorqueRegressor · ∂π/∂λ") {
        took = nanoseconds(*peer, calls, [&](const Sample &s) {
            const Matrix &Y = peer->regressor(s);
            for (int k = 0; k < model.nv; ++k) {
                peer->jacobian.middleCols<10>(10 * k).noalias() =
                    Y.middleCols<10>(10 * k) * peer->blocks[k];
            }
        });
        copy(peer->jacobian, result);
    } else if (what == "computeJointTorqueRegressorᵀ W r") {
        Vector gradient = Vector::Zero(peer->pi.size()), r(model.nv);
        took = nanoseconds(*peer, calls, [&](const Sample &s) {
            const Matrix &Y = peer->regressor(s);
            r = -s.tau;  // in two steps: a product inside a sum would allocate
            r.noalias() += Y * peer->pi;
            gradient.noalias() += Y.transpose() * r;
        });
        copy(r, result);
    } else if (what == "crba") {
        took = nanoseconds(*peer, calls, [&](const Sample &s) { pin::crba(model, data, s.q); });
        copy(data.M.selfadjointView<Eigen::Upper>(), result);
    } else if (what == "aba") {
        took = nanoseconds(*peer, calls, [&](const Sample &s) {
            pin::aba(model, data, s.q, s.dq, s.tau);
        });
        copy(data.ddq, result);
    } else if (what == "forwardKinematics") {
        took = nanoseconds(*peer, calls, [&](const Sample &s) {
            pin::forwardKinematics(model, data, s.q);
        });
    }
    return took;
}
